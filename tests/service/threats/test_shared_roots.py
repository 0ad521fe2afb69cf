"""Stages on shared storage: what tenants may name, and that nothing outside of the root is read, with every wall and with
Landlock alone."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from tests.service.api_calls import QUICK, SCENE, finished, problem, submit, upload
from tests.service.conftest import make_key
from tests.service.serving import RunningServer

SECRET = b'#usda 1.0\ndef Sphere "secret"\n{\n}\n'
JOBS = "/v1/jobs"


@pytest.fixture(scope="module")
def storage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A show with a stage that is whole, and others that lead out of it."""
    base = tmp_path_factory.mktemp("storage")
    shows, beside = base / "shows", base / "beside"
    for folder in (shows / "010/parts", beside):
        folder.mkdir(parents=True)
    (beside / "secret.usda").write_bytes(SECRET)
    (shows / "set.usda").write_bytes(b'#usda 1.0\nover "w"\n{\n    def Sphere "more"\n    {\n    }\n}\n')
    head = SCENE.decode()

    def stage(name: str, path: str) -> None:
        (shows / f"010/{name}.usda").write_text(head.replace("defaultPrim", f"subLayers = [@{path}@]\n    defaultPrim", 1))

    stage("shot", "../set.usda")
    stage("by_absolute_path", f"{shows}/set.usda")
    stage("above", "../../beside/secret.usda")
    stage("absolute", f"{beside}/secret.usda")
    stage("system", "/etc/passwd")
    stage("scheme", "file:/etc/passwd")
    stage("gone", "../../beside/gone.usda")
    stage("linked", "../link.usda")
    os.symlink(beside / "secret.usda", shows / "link.usda")
    os.symlink(beside, shows / "folder")
    (shows / "010/notes.txt").write_text("no stage")
    (shows / "010/parts/broken.usda").write_text("#usda 1.0\ndef {\n")
    return base


@pytest.fixture(scope="module")
def server(start_server: Any, storage: Path) -> RunningServer:
    roots = [f"shows={storage}/shows", f"old={storage}/shows/010"]
    return start_server(require_keys=True, shared_roots=roots, shared_tenants=["old=archive"])


def client_of(server: RunningServer, tenant: str) -> Any:
    return server.client(make_key(f"sqlite:///{server.data / 'primray.sqlite'}", tenant, "submit", "read"))


@pytest.fixture(scope="module")
def client(server: RunningServer) -> Any:
    return client_of(server, "lighting")


def asked(client: Any, path: str) -> Any:
    return client.post(JOBS, json={"scene": {"shared": path}, "settings": {**QUICK, "camera": "/w/cam"}})


@pytest.mark.parametrize("path", ["shows/010/shot.usda", "shared:shows/010/by_absolute_path.usda"])
def test_a_stage_of_the_root_is_rendered_with_what_it_refers_to(client: Any, path: str, storage: Path) -> None:
    job = asked(client, path)
    assert job.status_code == 202, job.text
    ended = finished(client, job.json()["id"])
    assert ended["state"] == "succeeded", ended["error"]
    scene = client.get(f"/v1/scenes/{ended['scene']['id']}").json()
    assert (scene["kind"], scene["name"]) == ("shared", f"shared:{path.removeprefix('shared:')}")
    assert {file["name"] for file in scene["files"]} == {path.partition("/")[2], "set.usda"}
    assert client.get("/v1/capabilities").json()["shared_roots"] == ["shows"]
    assert str(storage) not in client.get(f"/v1/jobs/{ended['id']}").text
    assert str(storage) not in client.get(f"/v1/jobs/{ended['id']}/log").text
    assert client.get("/v1/usage").json()["stored_bytes"]["used"] < 100_000


def test_a_changed_stage_is_checked_again(client: Any, storage: Path) -> None:
    path = storage / "shows/010/edited.usda"
    path.write_bytes(SCENE)
    first = finished(client, asked(client, "shows/010/edited.usda").json()["id"])
    again = finished(client, asked(client, "shows/010/edited.usda").json()["id"])
    path.write_bytes(SCENE + b"# a comment\n")
    other = finished(client, asked(client, "shows/010/edited.usda").json()["id"])
    assert first["scene"] == again["scene"] != other["scene"]
    assert [job["state"] for job in (first, again, other)] == ["succeeded"] * 3


@pytest.mark.parametrize("name", ["above", "absolute", "system", "scheme", "gone", "linked"])
def test_references_out_of_the_root_are_refused(client: Any, name: str, storage: Path) -> None:
    """In the same words whether there is such a file or not."""
    ended = finished(client, asked(client, f"shows/010/{name}.usda").json()["id"])
    assert ended["state"] == "failed"
    error = ended["error"]
    assert error["type"] == "/problems/asset-path-outside-job", error
    assert error["layer"] == f"010/{name}.usda"
    assert "outside the shared root" in error["detail"]


@pytest.mark.parametrize(
    ("path", "status", "slug"),
    [
        ("shows/../beside/secret.usda", 422, "invalid-request"),
        ("shows/010/../../beside/secret.usda", 422, "invalid-request"),
        ("shows//etc/passwd", 422, "invalid-request"),
        ("shows/link.usda", 422, "invalid-request"),
        ("shows/folder/secret.usda", 422, "invalid-request"),
        ("shows/010/notes.txt", 422, "invalid-request"),
        ("shows", 422, "invalid-request"),
        ("shows/010/none.usda", 404, "not-found"),
        ("shows/010", 422, "invalid-request"),
        ("nowhere/shot.usda", 404, "not-found"),
        ("old/shot.usda", 404, "not-found"),
        ("/etc/passwd", 404, "not-found"),
        ("", 404, "not-found"),
    ],
)
def test_what_cannot_be_named(client: Any, path: str, status: int, slug: str) -> None:
    problem(asked(client, path), status, slug)


def test_a_root_of_other_tenants_is_as_one_that_there_is_not(server: RunningServer, client: Any, storage: Path) -> None:
    said = [{**asked(client, path).json(), "request_id": ""} for path in ("old/shot.usda", "none/shot.usda")]
    assert said[0] == said[1]
    archive = client_of(server, "archive")
    assert archive.get("/v1/capabilities").json()["shared_roots"] == ["old", "shows"]
    refused = finished(archive, asked(archive, "old/shot.usda").json()["id"])  # ../set.usda is not in this root
    assert refused["error"]["type"] == "/problems/asset-path-outside-job"
    (storage / "shows/010/alone.usda").write_bytes(SCENE)
    alone = finished(archive, asked(archive, "old/alone.usda").json()["id"])
    assert alone["state"] == "succeeded"


def test_an_uploaded_scene_reads_nothing_of_a_root(client: Any, storage: Path) -> None:
    """Not by an absolute path, and not in a worker that has rendered from the root before."""
    finished(client, asked(client, "shows/010/shot.usda").json()["id"])
    hostile = SCENE.replace(b"defaultPrim", f"subLayers = [@{storage}/shows/set.usda@]\n    defaultPrim".encode(), 1)
    scene = client.post("/v1/scenes", content=hostile).json()["id"]
    ended = finished(client, submit(client, scene)["id"])
    assert (ended["state"], ended["error"]["type"]) == ("failed", "/problems/asset-path-outside-job")
    variables = SCENE.replace(
        b"defaultPrim",
        b'expressionVariables = { string X = "' + str(storage).encode() + b'/shows/set" }\n    '
        b'subLayers = [@`"${X}.usda"`@]\n    defaultPrim',
        1,
    )
    scene = client.post("/v1/scenes", content=variables).json()["id"]
    ended = finished(client, submit(client, scene)["id"])
    log = client.get(f"/v1/jobs/{ended['id']}/log").text
    assert "more" not in str(ended["effective_settings"])
    assert (ended["state"] == "failed") or ended["effective_settings"]["scene"].get("spheres", 1) == 1, log


def test_either_an_id_or_a_stage_is_named(client: Any) -> None:
    scene = upload(client)
    for which in ({"id": scene, "shared": "shows/010/shot.usda"}, {}, {"shared": "shows/010/shot.usda", "entry": "a.usda"}):
        problem(client.post(JOBS, json={"scene": which, "settings": QUICK}), 422, "invalid-request")


def test_a_syntax_error_has_its_place_in_the_root(client: Any, storage: Path) -> None:
    ended = finished(client, asked(client, "shows/010/parts/broken.usda").json()["id"])
    assert ended["error"]["type"] == "/problems/layer-unreadable"
    assert str(storage) not in str(ended["error"])


def test_no_failures(server: RunningServer) -> None:
    assert server.failures() == []
