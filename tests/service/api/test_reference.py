"""The reference of the HTTP API, as /docs and the site show it: its words, and examples that run as they are."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import httpx2
import pytest
from tests.service.api_calls import finished, submit
from tests.service.serving import RunningServer

from primray_service.api.reference import (
    SERVER,
    Operation,
    Ref,
    curl_example,
    operations,
    operations_page,
    python_example,
    type_words,
)

ROOT = Path(__file__).resolve().parents[3]
DOCUMENT = json.loads((ROOT / "schemas/openapi.json").read_text(encoding="utf-8"))
OPERATIONS = list(operations(DOCUMENT))
STAGE = """#usda 1.0
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball" {
}
"""
NO_SCENE = f"sha256:{'0' * 64}"
# First what ends a job that runs, then what begins others, at last what takes away what others ask for.
PAUSES = (
    "interventions_pause",
    "interventions_resume",
    "admin_jobs_pause",
    "admin_jobs_resume",
    "jobs_cancel",
    "admin_jobs_cancel",
)
ORDER = {key: place - 10 for place, key in enumerate(PAUSES)}
ORDER |= {"jobs_go_on": 1, "submissions_submit": 1, "jobs_delete": 2, "scenes_delete": 2, "keys_revoke": 2}


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"type": "integer", "minimum": 0, "maximum": 100}, "integer, 0 to 100"),
        ({"type": "integer", "minimum": 0, "exclusiveMaximum": 4294967296}, "integer, at least 0, less than 4294967296"),
        ({"type": "string", "enum": ["png", "raw"]}, '"png" or "raw"'),
        ({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "null"}]}, "number, more than 0, or null"),
        ({"type": "array", "items": {"$ref": "#/components/schemas/Job"}, "maxItems": 4}, "array of Job, at most 4 of them"),
        ({"type": "array", "prefixItems": [{"type": "integer"}] * 2, "minItems": 2, "maxItems": 2}, "[integer, integer]"),
        ({"type": "object", "additionalProperties": {"type": "string"}}, "object of string"),
        ({"type": "string", "format": "binary"}, "a file's bytes"),
        ({}, "any value"),
    ],
)
def test_types_are_told_in_words(schema: dict[str, object], words: str) -> None:
    assert "".join(word.name if isinstance(word, Ref) else word for word in type_words(schema)) == words


def test_the_page_has_all_of_the_document() -> None:
    page = operations_page(DOCUMENT)
    assert len(OPERATIONS) == sum(len(methods) for methods in DOCUMENT["paths"].values())
    for one in OPERATIONS:
        assert page.count(f'id="{one.key}"') == 1
        assert {each.status for each in one.answers} == set(DOCUMENT["paths"][one.path][one.method.lower()]["responses"])
    for link in re.findall(r'href="#([^"]+)"', page):
        assert f'id="{link}"' in page, link


@pytest.mark.parametrize("kind", ["curl", "python"])
def test_examples_run(server: RunningServer, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind == "curl" and shutil.which("curl") is None:
        pytest.skip("skipped: no curl")
    monkeypatch.chdir(tmp_path)
    with server.client() as client:
        told, told_apart = made(client, kind)
        script = []
        for one in sorted(OPERATIONS, key=lambda one: ORDER.get(one.key, 0)):
            if one.key == "sessions_begin":  # needs a key that is known
                continue
            names = {**told, **told_apart.get(one.key, {})}
            text = curl_example(one) if kind == "curl" else python_example(one)
            text = text.replace(SERVER, server.url).replace(NO_SCENE, names["scene_id"])
            if kind == "python":
                exec(compile(text, one.name, "exec"), dict(names))
            else:
                script += [f"{name}='{value}'" for name, value in names.items()]
                script.append(f"{text.replace('-sS', '-sSf', 1)} >/dev/null || {{ echo '{one.name}'; exit 1; }}")
        if kind == "curl":
            done = subprocess.run(["bash", "-c", "\n".join(script)], capture_output=True, text=True, timeout=120)
            assert done.returncode == 0, done.stdout + done.stderr
        assert (tmp_path / "preview.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / "beauty.exr").read_bytes().startswith(b"v/1\x01")
        assert client.get(f"/v1/jobs/{told['job_id']}").status_code == 404  # deleted
        for job in client.get("/v1/jobs").json()["items"]:
            client.post(f"/v1/jobs/{job['id']}/cancel")


def made(client: httpx2.Client, kind: str) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """By the names that examples have for what paths need: a job that ended. For some operations, another: one that runs, and a
    scene that no job has."""
    Path("shot.usda").write_text(f"{STAGE}# {kind} 0\n", encoding="utf-8")

    def scene(number: int) -> str:
        return str(client.post("/v1/scenes?name=shot.usda", content=f"{STAGE}# {kind} {number}\n").json()["id"])

    def job(**settings: Any) -> str:
        return str(submit(client, used, {"resolution": [32, 18], **settings})["id"])

    def ended() -> str:
        return str(finished(client, job(spp=4), 120)["id"])

    used = scene(1)
    key = client.post("/v1/keys", json={"tenant": "a", "scopes": ["read"], "name": "b"}).json()["id"]
    told = {"scene_id": used, "job_id": ended(), "name": "beauty.exr", "number": "0", "key_id": key, "tenant": "a"}
    told["sha256"] = hashlib.sha256(Path("shot.usda").read_bytes()).hexdigest()
    again = {name: {"job_id": ended()} for name in ("interventions_retry", "admin_jobs_retry")}
    runs = {"job_id": job(time_limit=60)}
    return told, {**dict.fromkeys(PAUSES, runs), **again, "scenes_delete": {"scene_id": scene(2)}}


def test_examples_name_what_the_path_needs() -> None:
    def of(key: str) -> Operation:
        return next(one for one in OPERATIONS if one.key == key)

    assert curl_example(of("jobs_cancel")) == f'curl -sS -X POST "{SERVER}/v1/jobs/$job_id/cancel"'
    assert f'f"{SERVER}/v1/jobs/{{job_id}}/frames/{{number}}"' in python_example(of("frames_frame"))
