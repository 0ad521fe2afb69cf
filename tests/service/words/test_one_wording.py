"""One diagnostic has one code, severity, place and sentence: in reports, from inspect, of scenes and jobs, and as printed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.service.api_calls import finished, wait_until
from tests.service.serving import RunningServer
from tests.service.threats.fates import package
from tests.service.words.bad_stages import REFUSED, RENDERED, sublayers, truncated_crate, write

from primray.cli import run

Row = tuple[str, str, str, str, str, str]  # severity, kind, code, prim, attribute, message

SIZE = ["--res", "8", "8"]
# The service's own: of files, not of the picture.
OF_FILES = {"asset-not-uploaded", "file-ignored"}
# Only who samples can tell.
OF_SAMPLES = {"empty-picture", "invalid-samples"}
# What a check tells before anything is read that takes long.
OF_STAGES = {"composition-error", "asset-missing", "unsupported-prim", "unsupported-light", "unknown-prim-type", "layer-units"}


@dataclass
class Told:
    """What each of them says of one stage; `lines`: on a terminal."""

    by: dict[str, set[Row]] = field(default_factory=dict)
    lines: dict[str, list[str]] = field(default_factory=dict)


def rows(found: list[dict[str, Any]], prim: str = "prim_path", message: str = "message") -> set[Row]:
    return {(d["severity"], d["kind"], d["code"], d[prim], d["attribute"], d[message]) for d in found}


@pytest.fixture(scope="module")
def told(
    server: RunningServer, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Callable[[str], Told]:
    """By the stage's name; made when it is first asked for."""
    known: dict[str, Told] = {}

    def of(name: str) -> Told:
        if name not in known:
            known[name] = ask(server, name, tmp_path_factory.mktemp("stage"), request)
        return known[name]

    return of


def files_of(name: str, folder: Path) -> dict[str, str | bytes]:
    if name == "truncated crate":
        (folder / "made").mkdir()
        return {"shot.usda": sublayers("bad.usdc"), "bad.usdc": truncated_crate(folder / "made")}
    return RENDERED[name]


def printed(arguments: list[str], request: pytest.FixtureRequest) -> tuple[list[str], list[str]]:
    """Lines of stdout and stderr."""
    manager = request.config.pluginmanager.getplugin("capturemanager")
    manager.read_global_capture()
    run(arguments)
    out, error = manager.read_global_capture()
    return out.splitlines(), error.splitlines()


def diagnostics_in(lines: list[str]) -> list[str]:
    return [line for line in lines if line.startswith(("error: ", "warning: ", "info: ", "    /"))]


def ask(server: RunningServer, name: str, folder: Path, request: pytest.FixtureRequest) -> Told:
    files, found = files_of(name, folder), Told()
    stage = write(folder / "scene", files)
    out, error = printed(
        ["render", str(stage), "-o", str(folder / "a.exr"), "--report", str(folder / "a.json"), "--spp", "2", *SIZE], request
    )
    found.by["report"] = rows(json.loads((folder / "a.json").read_text())["diagnostics"])
    found.lines["render"] = diagnostics_in(error)
    out, _ = printed(["inspect", str(stage), "--json", *SIZE], request)
    found.by["inspect"] = rows(json.loads(out[-1])["diagnostics"])

    client = server.client()
    body = package(files) if len(files) > 1 else next(iter(files.values()))
    uploaded = client.post("/v1/scenes", content=body, params={"name": "shot.zip" if len(files) > 1 else "shot.usda"})
    path = f"/v1/scenes/{uploaded.json()['id']}"
    scene = wait_until(lambda: s if (s := client.get(path).json())["state"] != "checking" else None, 30)
    assert scene["problem"] is None
    reference = {"id": scene["id"]} | ({"entry": "shot.usda"} if len(files) > 1 else {})
    settings = {"resolution": [8, 8], "stop": {"max_samples": 2}}
    job = client.post("/v1/jobs", json={"scene": reference, "settings": settings}).json()
    ended = finished(client, job["id"])
    assert ended["state"] == "succeeded", ended
    found.by["scene"] = rows([w for w in scene["warnings"] if w["code"] not in OF_FILES], "prim", "detail")
    found.by["job"] = rows(ended["warnings"], "prim", "detail")
    report = client.get(f"/v1/jobs/{job['id']}/outputs/report.json")
    found.by["job's report"] = rows(report.json()["diagnostics"])
    events = client.get(f"/v1/jobs/{job['id']}/events", headers={"accept": "application/json"})
    said = [event["data"] for event in events.json()["items"] if event["type"] == "warning"]
    found.by["events"] = rows([data.get("warning", data) for data in said], "prim", "detail")
    out, _ = printed(["status", job["id"], "--server", server.url], request)
    found.lines["status"] = diagnostics_in(out)
    _, error = printed(["watch", job["id"], "--server", server.url], request)
    found.lines["watch"] = diagnostics_in(error)
    return found


NAMES = [*RENDERED, "truncated crate"]


@pytest.mark.parametrize("name", NAMES)
def test_all_say_the_same(name: str, told: Callable[[str], Told]) -> None:
    by = told(name).by
    assert by["report"] == by["job"] == by["job's report"] == by["events"]
    assert by["inspect"] == {row for row in by["report"] if row[2] not in OF_SAMPLES}
    if name != "cycle":  # each of two layers may be its root: nothing is composed before a job says which
        assert by["scene"] <= by["report"]
        assert {row for row in by["report"] if row[2] in OF_STAGES} <= by["scene"]
    assert any(row[0] != "info" for row in by["report"]) or name == "other units"


@pytest.mark.parametrize("name", NAMES)
def test_terminals_show_the_same(name: str, told: Callable[[str], Told]) -> None:
    lines = told(name).lines
    assert lines["render"] == lines["status"] == lines["watch"]


@pytest.mark.parametrize("name", ["parse error", "pointer"])
def test_a_root_that_cannot_be_opened_is_refused_in_one_sentence(
    name: str, server: RunningServer, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    stage = write(tmp_path / "scene", REFUSED[name])
    _, error = printed(["render", str(stage), "-o", str(tmp_path / "a.exr"), *SIZE], request)
    said = error[-1].removeprefix("error: ").removesuffix(f" [{stage}]")
    code, _, sentence = said.partition(": ")
    client = server.client()
    uploaded = client.post("/v1/scenes", content=stage.read_bytes(), params={"name": "shot.usda"})
    document = uploaded.json()
    if uploaded.status_code < 400:
        path = f"/v1/scenes/{document['id']}"
        scene = wait_until(lambda: s if (s := client.get(path).json())["state"] != "checking" else None, 30)
        document = scene["problem"]
    assert (document["code"], document["detail"].rstrip(".")) == (code, sentence.rstrip("."))
    if uploaded.status_code < 400:
        assert document["layer"] == "shot.usda"
    if name == "parse error":
        assert (document["line"], document["column"]) == (7, 5)
        assert document["detail"] == "USD cannot open it: shot.usda:7:5: Expected } at 'double radius = = 3' in </W>"
    # What is not sent at all is refused in the same words.
    _, error = printed(["submit", str(stage), "--server", server.url], request)
    assert error[-1].removeprefix("error: ").removesuffix(f" [{stage}]").rstrip(".") == said.rstrip(".")
