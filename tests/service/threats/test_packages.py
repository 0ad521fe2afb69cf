"""usdz that escape, lie or nest; layers with errors; requests for more than there can be; HTML in names; walls that hold."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.service.conftest import make_key
from tests.service.scenes.zips import Entry, zip_of
from tests.service.threats.fates import ROOM, Canary, Fate, fate, package, usda, usdz, workers_of


def ended(found: Fate, *slugs: str) -> None:
    assert found.end in ("refused", "failed", "rejected"), (found.end, found.job.get("warnings"))
    assert found.slug in slugs, found.problem


def aligned(name: str, data: str | bytes, **more: Any) -> Entry:
    return Entry(name, data.encode() if isinstance(data, str) else data, align=True, **more)


def nested(depth: int) -> bytes:
    inner: dict[str, str | bytes] = {} if depth == 0 else {"a.usdz": nested(depth - 1)}
    return usdz({"a.usda": usda(), **inner})


ROOT = usda(ROOM)
USDZ = {
    "absolute first member": zip_of(aligned("/root.usda", ROOT)),
    "dots": zip_of(aligned("root.usda", ROOT), aligned("../evil.png", b"x")),
    "deflated": zip_of(Entry("root.usda", ROOT.encode(), deflate=True)),
    "deflated, later": zip_of(aligned("root.usda", ROOT), Entry("a.png", b"x" * 500, deflate=True)),
    "first is no layer": zip_of(aligned("a.png", b"x"), aligned("root.usda", ROOT)),
    "encrypted": zip_of(aligned("root.usda", ROOT, flags=1)),
    "nested three deep": usdz({"root.usda": ROOT, "a.usdz": nested(3)}),
}


@pytest.mark.parametrize("what", USDZ)
def test_a_usdz_that_is_unsafe(what: str, client: Any) -> None:
    found = fate(client, USDZ[what], name="scene.usdz")
    ended(found, "package-unsafe")
    assert found.problem["member"]


def test_a_path_out_of_a_usdz(client: Any, canary: Canary) -> None:
    root = usda(ROOM + 'def "R" (references = @in.usdz[../../secret.usda]@</X>) {}')
    found = fate(client, package({"root.usda": root, "in.usdz": usdz({"a.usda": usda()})}), entry="root.usda")
    ended(found, "package-unsafe", "asset-path-outside-job")
    canary.never_sang(found)


def test_a_usdz_is_rendered(client: Any) -> None:
    found = fate(
        client, usdz({"root.usda": usda(ROOM + 'def "R" (references = @b.usda@</X>) {}'), "b.usda": usda('def "X" {}')})
    )
    assert found.end == "succeeded", found.problem


def test_two_roots_need_an_entry(client: Any) -> None:
    body = package({"a.usda": ROOT, "b.usda": ROOT})
    found = fate(client, body)
    ended(found, "ambiguous-entry")
    assert found.problem["candidates"] == ["a.usda", "b.usda"]
    again = client.post("/v1/jobs", json={"scene": {"id": found.scene["id"]}})  # the scene is checked by now: told at once
    assert (again.status_code, again.json()["type"]) == (422, "/problems/ambiguous-entry")
    assert again.json()["candidates"] == ["a.usda", "b.usda"]
    assert fate(client, body, entry="b.usda").end == "succeeded"
    missing = fate(client, body, entry="c.usda")
    ended(missing, "entry-missing")
    for entry in ("../../etc/passwd", "/etc/passwd", "a.usda/../b.usda", "\u0000", "a.usdz[x]"):
        found = fate(client, body, entry=entry)
        ended(found, "entry-missing", "invalid-request", "invalid-json", "package-unsafe")


SYNTAX = '#usda 1.0\n\ndef Sphere "a"\n{\n    string leaked = "words of the file"\n    double radius = (((\n}\n'


def test_a_syntax_error_names_the_layer_and_line(client: Any) -> None:
    found = fate(client, SYNTAX, name="broken.usda")
    ended(found, "layer-unreadable")
    assert (found.problem["layer"], found.problem["line"]) == ("broken.usda", 7)
    assert "broken.usda:7:" in found.problem["detail"]
    below = fate(client, package({"root.usda": usda(ROOM, "subLayers = [@sub/broken.usda@]"), "sub/broken.usda": SYNTAX}))
    assert (below.end, "composition-error" in below.warnings) == ("succeeded", True)
    assert "sub/broken.usda:7:" in below.said
    for answers in (found.said, below.said):
        assert "words of the file" not in answers  # but for where it broke


@pytest.mark.parametrize(
    "settings",
    [
        {"resolution": [2_000_000, 2_000_000]},
        {"resolution": [32768, 32768]},
        {"frames": "1:1000000000000000"},
        {"frames": "1:2x0.0000001"},
        {"stop": {"max_samples": 10**12}},
        {"stop": {"max_seconds": 1e12}},
    ],
)
def test_a_request_for_more_than_there_can_be(settings: dict[str, Any], client: Any) -> None:
    found = fate(client, ROOT, settings=settings)
    assert found.end == "refused"
    assert found.slug in ("limit-exceeded", "invalid-request"), found.problem
    assert found.seconds < 30


RENDER = """def Scope "Render" { def RenderSettings "S" { rel camera = </cam>
uniform int2 resolution = (2000000, 2000000) } }"""


def test_a_scene_that_asks_for_more_than_there_can_be(client: Any) -> None:
    found = fate(client, usda(ROOM + RENDER, 'renderSettingsPrimPath = "/Render/S"'), settings={"stop": {"max_samples": 1}})
    ended(found, "limit-exceeded", "settings-rejected", "scene-too-large", "memory-limit")


HTML = "<script>alert(1)</script><img src=x onerror=alert(1)>"


def test_html_stays_text(client: Any) -> None:
    found = fate(client, usda(ROOM + f'def "R" (doc = "{HTML}") {{}}'), name=f"{HTML}.usda", labels={"note": HTML})
    assert found.end == "succeeded", found.problem
    job, log = client.get(f"/v1/jobs/{found.job['id']}"), client.get(f"/v1/jobs/{found.job['id']}/log")
    assert job.json()["labels"] == {"note": HTML}
    for answer in (job, log, client.get("/v1/scenes"), client.get(f"/v1/jobs/{HTML}")):
        assert answer.headers["content-type"].partition(";")[0] in (
            "application/json", "application/problem+json", "text/plain",
        )  # fmt: skip
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "default-src 'none'" in answer.headers["content-security-policy"]
    for output in client.get(f"/v1/jobs/{found.job['id']}/outputs").json()["items"]:
        answer = client.get(output["urls"]["self"])
        assert answer.headers["content-disposition"].startswith("attachment")
        assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "url",
    [
        "https://169.254.169.254/latest", "https://10.0.0.1/", "https://[::1]/", "https://127.0.0.1/", "https://localhost/",
        "https://0x7f000001/", "https://[::ffff:10.0.0.1]/", "http://example.com/", "ftp://example.com/", "file:///etc/passwd",
        "https://user:pass@10.1.2.3/", "https://192.168.1.1:8443/", "https://[fe80::1]/", "https://100.64.0.1/", "nonsense",
    ],
)  # fmt: skip
def test_webhooks_never_lead_inside(url: str, client: Any) -> None:
    found = fate(client, ROOT, webhook={"url": url})
    assert (found.end, found.slug) in (("refused", "webhook-address"), ("refused", "invalid-request")), found.problem


def test_another_tenants_job_is_as_if_it_did_not_exist(start_server: Any) -> None:
    """tests/service/routes/test_keys.py goes through all its parts."""
    server = start_server(require_keys=True, dispatch=False, warm=False)
    url = f"sqlite:///{server.data / 'primray.sqlite'}"
    one, two = (server.client(make_key(url, tenant, "submit", "read")) for tenant in ("one", "two"))
    scene = one.post("/v1/scenes", content=ROOT.encode()).json()["id"]
    job = one.post("/v1/jobs", json={"scene": {"id": scene}}).json()["id"]
    answers = [two.get(f"/v1/jobs/{each}") for each in (job, "job_" + "0" * 26)]
    assert [answer.status_code for answer in answers] == [404, 404]
    assert len({answer.json()["detail"] for answer in answers}) == 1


def test_the_walls_are_tried_from_inside_at_the_start(client: Any) -> None:
    sandbox = client.get("/readyz").json()["checks"]["sandbox"]
    assert sandbox["ok"]
    attempts = sandbox["attempts"]
    assert any("tcp" in name.lower() or "connect" in name.lower() for name in attempts), attempts
    assert any("udp" in name.lower() or "socket" in name.lower() for name in attempts), attempts
    assert not [name for name, result in attempts.items() if result == "allowed"]


def test_no_worker_outlives_its_work(server: Any, client: Any) -> None:
    """After everything above: three at most. One waits for a check, one for a render, one keeps its scene."""
    until = time.monotonic() + 20
    while len(left := workers_of(server)) > 9 and time.monotonic() < until:
        time.sleep(0.2)
    assert len([command for command in left if "primray_service.worker" in command]) <= 9, left


@pytest.mark.long
def test_nothing_outside_is_ever_opened(tmp_path: Path) -> None:
    """The kernel's own word: a traced server, its workers too, opens no file of the canary's, whatever the scene says."""
    if shutil.which("strace") is None:
        pytest.skip("skipped: no strace")
    from tests.service.threats import traced

    found = subprocess.run(
        [sys.executable, "-m", "tests.service.threats.traced", str(tmp_path)],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert found.returncode == 0, found.stdout[-3000:] + found.stderr[-3000:]
    report = traced.read_report(tmp_path)
    assert report.slugs, report
    assert report.opened == [], report.opened
    assert report.seen_control, "the trace has the opening of files that are allowed, so it would have had these"
