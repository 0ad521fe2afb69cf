"""Uploads by content over HTTP: what is asked for, what is refused, what is counted, and what nobody learns."""

from __future__ import annotations

import hashlib
import os
import statistics
import time
from typing import Any

import pytest
from tests.service.api_calls import QUICK, SCENE, checked, finished, problem, submit, wait_until
from tests.service.conftest import make_key
from tests.service.serving import RunningServer

TEXTURE = os.urandom(300_000)
ROOT = SCENE.replace(b"defaultPrim", b"subLayers = [@parts/set.usda@]\n    defaultPrim")
LAYER = b'#usda 1.0\nover "w"\n{\n}\n'
FILES = {"shot.usda": ROOT, "parts/set.usda": LAYER, "tex/wood.png": TEXTURE, "tex/again.png": TEXTURE, "empty.txt": b""}


@pytest.fixture(scope="module")
def server(start_server: Any) -> RunningServer:
    return start_server(require_keys=True, limits={"unpacked_bytes": 2**21, "package_entries": 50})


def client_of(server: RunningServer, tenant: str, **quotas: Any) -> Any:
    from primray_service.limits import Quotas

    key = make_key(f"sqlite:///{server.data / 'primray.sqlite'}", tenant, "submit", "read", quotas=Quotas(**quotas))
    return server.client(key)


def sha256(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()


def listed(files: dict[str, bytes]) -> dict[str, Any]:
    rows = [{"path": path, "sha256": sha256(body), "bytes": len(body)} for path, body in files.items()]
    return {"name": "shot.zip", "files": rows}


def send(client: Any, files: dict[str, bytes]) -> tuple[Any, list[bytes]]:
    """The answer that has the scene, and what was sent for it."""
    bodies = {sha256(body): body for body in files.values()}
    answer = client.post("/v1/packages", json=listed(files))
    sent = [bodies[digest] for digest in answer.json().get("missing", [])]
    for body in sent:
        assert client.put(f"/v1/contents/{sha256(body)}", content=body).status_code == 201
    return (client.post("/v1/packages", json=listed(files)) if sent else answer), sent


def test_only_what_is_missing_is_asked_for(server: RunningServer) -> None:
    client = client_of(server, "first")
    first = client.post("/v1/packages", json=listed(FILES)).json()
    assert first["missing"] == [sha256(LAYER), sha256(ROOT), sha256(TEXTURE)]
    assert first["missing_bytes"] == len(LAYER) + len(ROOT) + len(TEXTURE)
    answer, sent = send(client, FILES)
    assert (answer.status_code, len(sent)) == (201, 3)
    scene = answer.json()
    assert (scene["id"], scene["kind"], scene["name"]) == (first["id"], "zip", "shot.zip")
    assert scene["bytes"] == sum(map(len, FILES.values()))
    commented, sent = send(client, FILES | {"shot.usda": ROOT + b"# a comment\n"})
    assert sent == [ROOT + b"# a comment\n"]
    assert commented.json()["id"] != scene["id"]
    used = client.get("/v1/usage").json()["stored_bytes"]["used"]
    assert used < len(TEXTURE) + 5 * len(ROOT)  # the texture is counted once
    wait_until(lambda: checked(client, commented.json()["id"]), 60)
    facts = client.get(f"/v1/scenes/{commented.json()['id']}").json()
    assert (facts["entry"], facts["file_count"]) == ("shot.usda", 5)
    job = finished(client, submit(client, commented.json()["id"], {**QUICK, "camera": "/w/cam"})["id"])
    assert job["state"] == "succeeded", job["error"]
    stored = [path.stat().st_ino for path in server.data.glob("**/*") if path.is_file() and path.stat().st_size == len(TEXTURE)]
    assert len(set(stored)) == 1, "it lies on the disk once"


def test_an_upload_that_broke_off_is_resumed(server: RunningServer) -> None:
    client = client_of(server, "resumes")
    files = {"a.usda": SCENE, "b.bin": os.urandom(5000), "c.bin": os.urandom(6000)}
    assert len(client.post("/v1/packages", json=listed(files)).json()["missing"]) == 3
    client.put(f"/v1/contents/{sha256(files['b.bin'])}", content=files["b.bin"])
    torn = client.put(f"/v1/contents/{sha256(files['c.bin'])}", content=files["c.bin"][:3000])
    problem(torn, 422, "digest-mismatch")
    answer, sent = send(client, files)
    assert answer.status_code == 201
    assert sorted(sent) == sorted([files["a.usda"], files["c.bin"]])
    assert client.put(f"/v1/contents/{sha256(files['c.bin'])}", content=files["c.bin"]).status_code == 200


def test_nobody_learns_what_another_tenant_has(server: RunningServer) -> None:
    has, asks = client_of(server, "has"), client_of(server, "asks")
    secret = {"shot.usda": SCENE, "secret.bin": os.urandom(200_000)}
    send(has, secret)
    unknown = {"shot.usda": SCENE, "secret.bin": os.urandom(200_000)}
    seconds: dict[int, list[float]] = {0: [], 1: []}
    for _ in range(15):
        for which, files in enumerate((secret, unknown)):
            began = time.perf_counter()
            answer = asks.post("/v1/packages", json=listed(files))
            seconds[which].append(time.perf_counter() - began)
            assert answer.status_code == 200
            assert answer.json()["missing"] == [
                row["sha256"] for row in sorted(listed(files)["files"], key=lambda r: r["path"])
            ]
    known, absent = (statistics.median(seconds[which]) for which in (0, 1))
    assert abs(known - absent) < 0.5 * max(known, absent) + 0.01
    scene = has.post("/v1/packages", json=listed(secret)).json()["id"]
    problem(asks.get(f"/v1/scenes/{scene}"), 404, "not-found")
    body = secret["secret.bin"]
    assert asks.put(f"/v1/contents/{sha256(body)}", content=body).status_code == 201  # as if nobody had it
    assert asks.get("/v1/usage").json()["stored_bytes"]["used"] == len(body)
    answer, sent = send(asks, secret)
    assert (answer.status_code, sent, answer.json()["id"]) == (201, [SCENE], scene)
    assert has.delete(f"/v1/scenes/{scene}").status_code == 204  # and neither needs the other's
    assert asks.get("/v1/usage").json()["stored_bytes"]["used"] > len(body)
    assert wait_until(lambda: checked(asks, scene), 60)


def test_what_no_scene_has_is_not_counted_any_more(server: RunningServer) -> None:
    client = client_of(server, "deletes")
    answer, _ = send(client, FILES)
    wait_until(lambda: checked(client, answer.json()["id"]), 60)
    folder = next(server.data.glob("contents/*-deletes"))
    assert len(list(folder.iterdir())) == 3
    assert client.delete(f"/v1/scenes/{answer.json()['id']}").status_code == 204
    assert client.get("/v1/usage").json()["stored_bytes"]["used"] == 0
    assert list(folder.iterdir()) == []
    assert len(client.post("/v1/packages", json=listed(FILES)).json()["missing"]) == 3


def test_quotas_are_said_before_anything_is_sent(server: RunningServer) -> None:
    client = client_of(server, "small", stored_bytes=100_000)
    problem(client.post("/v1/packages", json=listed(FILES)), 429, "quota-exceeded")
    refused = client.put(f"/v1/contents/{sha256(TEXTURE)}", content=TEXTURE)
    problem(refused, 429, "quota-exceeded")
    assert list(server.data.glob("contents/*-small/*")) == []


@pytest.mark.parametrize(
    ("files", "status", "slug"),
    [
        ({"../out.usda": SCENE}, 422, "package-unsafe"),
        ({"/etc/x.usda": SCENE}, 422, "package-unsafe"),
        ({"a/./b.usda": SCENE}, 422, "package-unsafe"),
        ({"a\\b.usda": SCENE}, 422, "package-unsafe"),
        ({"a.usda": SCENE, "A.usda": SCENE}, 422, "package-unsafe"),
        ({"a": SCENE, "a/b.usda": SCENE}, 422, "package-unsafe"),
        ({"folder/": b"", "a.usda": SCENE}, 422, "invalid-request"),
        ({"aux.usda": SCENE}, 422, "package-unsafe"),
        ({"x" * 2000 + ".usda": SCENE}, 422, "package-unsafe"),
        ({f"{n}.usda": SCENE for n in range(51)}, 422, "package-unsafe"),
        ({"a.txt": SCENE}, 422, "not-usd"),
        ({}, 422, "invalid-request"),
    ],
)
def test_lists_that_no_package_could_have(server: RunningServer, files: dict[str, bytes], status: int, slug: str) -> None:
    client = client_of(server, "hostile")
    asked = listed(files)
    if slug == "invalid-request" and files:
        asked["files"][0]["sha256"] = "0" * 64
    problem(client.post("/v1/packages", json=asked), status, slug)


def test_sizes_and_digests_are_not_believed(server: RunningServer) -> None:
    client = client_of(server, "lies")
    answer, _ = send(client, {"a.usda": SCENE})
    assert answer.status_code == 201
    for row in (
        {"bytes": len(SCENE) + 1},
        {"bytes": 0},
        {"sha256": "G" * 64},
        {"sha256": sha256(SCENE).upper()},
        {"bytes": -1},
    ):
        asked = listed({"a.usda": SCENE})
        asked["files"][0] |= row
        problem(client.post("/v1/packages", json=asked), 422, "invalid-request")
    big = listed({"a.usda": SCENE, "b.bin": b"x"})
    big["files"][1]["bytes"] = 2**22
    problem(client.post("/v1/packages", json=big), 422, "package-too-large")
    problem(client.put(f"/v1/contents/{'0' * 64}", content=b"something else"), 422, "digest-mismatch")
    problem(client.put("/v1/contents/..%2f..%2fx", content=b"x"), 404, "not-found")
    problem(client.put(f"/v1/contents/{sha256(b'')}", content=b""), 400, "upload-incomplete")


def test_archives_in_a_package_are_refused_as_in_a_zip(server: RunningServer) -> None:
    client = client_of(server, "archives")
    answer, _ = send(client, {"a.usda": SCENE, "inner.zip": b"PK\x03\x04" + bytes(60)})
    problem(answer, 422, "package-unsafe")
    disguised, _ = send(client, {"a.usda": SCENE, "b.png": b"7z\xbc\xaf\x27\x1c" + bytes(60)})
    problem(disguised, 422, "package-unsafe")


def test_no_failures(server: RunningServer) -> None:
    assert server.failures() == []
