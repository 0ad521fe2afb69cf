"""Servers that share a PostgreSQL and an S3 bucket, and no folder: all answer alike, a dead one's jobs go on at another."""

from __future__ import annotations

import hashlib
from typing import Any

import httpx2
import pytest
from tests.service.api_calls import SCENE, finished, problem, submit, upload, wait_until
from tests.service.conftest import StartServer
from tests.service.many_servers import Many
from tests.service.postgres import postgres_databases, postgres_server
from tests.service.s3 import object_store_packages, s3_bucket, s3_server
from tests.service.scenes.zips import LAYER, Entry, zip_of
from tests.service.test_service_many_servers import LONG, SETTINGS, alike, alone, database, picture

from primray_service.files import DataDirectory
from primray_service.objects import Objects, opened
from primray_service.store import open_store

__all__ = ["alone", "database", "object_store_packages", "postgres_databases", "postgres_server", "s3_bucket", "s3_server"]


@pytest.fixture(scope="module")
def many(start_server: StartServer, database: str, s3_bucket: str, tmp_path_factory: pytest.TempPathFactory) -> Many:
    def start() -> Any:
        return start_server(tmp_path_factory.mktemp("cache") / "data", database=database, objects=s3_bucket, **SETTINGS)

    found = Many(start)
    found.more(2)
    return found


@pytest.fixture(scope="module")
def objects(s3_bucket: str) -> Objects:
    return opened(s3_bucket)


def test_what_one_takes_the_other_has(many: Many, objects: Objects) -> None:
    [client], leader = many.only_answers(), many.dispatches()
    clients = [client, leader]
    package = zip_of(Entry("shot.usda", SCENE), Entry("textures/a.txt", b"here"))
    for body in (SCENE, package):
        scene = upload(client, body)  # its cache is not the dispatcher's
        job = finished(client, submit(client, scene)["id"])
        assert job["state"] == "succeeded", job
        here = f"/v1/jobs/{job['id']}"
        for path in ("", "/outputs", "/frames"):
            alike(clients, here + path)
        assert len({each.get(f"{here}/log").text for each in clients}) == 1
        assert client.get(f"{here}/log").text
        assert len({each.get(f"{here}/preview").content for each in clients}) == 1
        for output in client.get(f"{here}/outputs").json()["items"]:
            body = alike(clients, output["urls"]["immutable"]).content
            assert hashlib.sha256(body).hexdigest() == output["sha256"]
            at = output["urls"]["self"]
            assert client.get(at, headers={"range": "bytes=3-7"}).content == body[3:8]
            several = client.get(at, headers={"range": "bytes=0-1,5-6"})
            assert (several.status_code, several.headers["content-type"].split(";")[0]) == (206, "multipart/byteranges")
            assert client.get(at, headers={"if-none-match": f'"{output["sha256"]}"'}).status_code == 304
            assert client.head(at).headers["content-length"] == str(output["bytes"])
            assert objects.has(f"jobs/{job['id']}/outputs/{output['sha256']}-{output['name']}")
        assert client.delete(here).status_code == 204
        assert leader.get(here).status_code == 404
        assert job["id"] not in objects.folders("jobs")
        assert client.delete(f"/v1/scenes/{scene}").status_code == 204
        assert scene.removeprefix("sha256:") not in objects.folders("scenes")


def test_the_same_bytes_are_put_once_and_stay_as_long_as_somebody_has_them(many: Many, objects: Objects) -> None:
    one, other = many.all()
    scene = upload(one, SCENE + b"# twice\n")
    assert other.post("/v1/scenes", content=SCENE + b"# twice\n").status_code == 200
    assert scene.removeprefix("sha256:") in objects.folders("scenes")
    assert other.post("/v1/scenes", content=b"no scene").status_code == 422
    assert len(objects.folders("scenes")) == 1
    assert other.delete(f"/v1/scenes/{scene}").status_code == 204
    assert objects.folders("scenes") == []
    assert one.get(f"/v1/scenes/{scene}").status_code == 404


def test_a_package_by_content_is_put_together_where_it_is_rendered(many: Many, objects: Objects) -> None:
    [client], leader = many.only_answers(), many.dispatches()
    files = {"shot.usda": SCENE, "textures/a.txt": b"here"}

    def package(at: httpx2.Client, files: dict[str, bytes]) -> tuple[str, int]:
        """The scene, and how many files were sent."""
        bodies = {hashlib.sha256(body).hexdigest(): body for body in files.values()}
        rows = [{"path": path, "sha256": hashlib.sha256(body).hexdigest(), "bytes": len(body)} for path, body in files.items()]
        missing = at.post("/v1/packages", json={"files": rows}).json().get("missing", [])
        for digest in missing:
            assert at.put(f"/v1/contents/{digest}", content=bodies[digest]).status_code == 201
        return str(at.post("/v1/packages", json={"files": rows}).json()["id"]), len(missing)

    scene, sent = package(client, files)
    assert sent == 2
    job = finished(client, submit(client, scene)["id"])  # rendered by the leader, which has none of its files
    assert job["state"] == "succeeded", job
    other, sent = package(leader, files | {"shot.usda": SCENE + b"# a comment\n"})
    assert sent == 1
    assert finished(leader, submit(leader, other)["id"])["state"] == "succeeded"
    [tenant] = objects.folders("contents")
    assert len(objects.folders(f"contents/{tenant}")) == 3
    for job_id in [each["id"] for each in client.get("/v1/jobs").json()["items"]]:
        assert client.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert client.delete(f"/v1/scenes/{scene}").status_code == 204
    assert len(objects.folders(f"contents/{tenant}")) == 2
    assert leader.delete(f"/v1/scenes/{other}").status_code == 204
    assert objects.folders("contents") == []
    assert objects.folders("scenes") == []


def test_a_session_of_one_counts_at_the_other(many: Many, objects: Objects, start_server: StartServer) -> None:
    assert objects.has("session.secret")
    secrets = {(server.data / "session.secret").read_bytes() for server in many.servers}
    assert secrets == {objects.read("session.secret", 0, 64)}


def test_a_dead_ones_jobs_go_on_from_the_store(many: Many, database: str, alone: httpx2.Client, objects: Objects) -> None:
    expected = finished(alone, submit(alone, upload(alone), LONG)["id"], 120)
    [client] = many.only_answers()
    jobs = [submit(client, upload(client), LONG | more)["id"] for more in ({}, {"frames": "1:1"})]
    store = open_store(database)
    wait_until(lambda: store.frames(jobs[0])[0].checkpoint > 0, 90)
    assert wait_until(lambda: picture(client, f"/v1/jobs/{jobs[0]}"), 30)
    many.kill_leader()
    many.more()
    for job_id in jobs:
        found = [finished(each, job_id, 180) for each in many.all()]
        assert [job["state"] for job in found] == ["succeeded"] * 2, found[0]
        for row in store.outputs(job_id):
            body = objects.read(f"jobs/{job_id}/outputs/{row.sha256}-{row.name}", 0, row.bytes + 1)
            assert hashlib.sha256(body).hexdigest() == row.sha256
        for frame in store.frames(job_id):
            kept = [name for name in objects.folders(f"jobs/{job_id}/frames/{frame.number}") if name.endswith(".prc")]
            assert kept == [frame.checkpoint_file.rsplit("/", 1)[1]]
    assert client.get(f"/v1/jobs/{jobs[0]}").json()["result"]["pixels_sha256"] == expected["result"]["pixels_sha256"]
    store.close()
    assert [line for server in many.servers for line in server.failures()] == []


def test_bytes_that_changed_in_the_store_are_not_rendered(many: Many, objects: Objects) -> None:
    [client] = many.only_answers()
    body = SCENE + b"# changed\n"
    scene = client.post("/v1/scenes", content=body).json()["id"]
    wait_until(lambda: client.get(f"/v1/scenes/{scene}").json()["state"] == "ready", 30)
    objects.write(f"scenes/{scene.removeprefix('sha256:')}/upload", body + b"# later\n")
    for server in many.servers:  # as if it was evicted
        folder = DataDirectory(server.data).scene(scene)
        for path in folder.iterdir() if folder.exists() else ():
            path.unlink()
        if folder.exists():
            folder.rmdir()
    job = finished(client, submit(client, scene)["id"])
    assert job["state"] == "failed"
    assert "is damaged" in job["error"]["detail"]


def test_a_layer_that_is_no_package_is_one(many: Many) -> None:
    assert upload(many.all()[0], LAYER)


def test_a_store_that_is_away_is_told_and_nothing_is_promised(
    start_server: StartServer, database: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("store")
    server = start_server(
        tmp_path_factory.mktemp("away") / "data",
        database=database,
        objects=f"file://{folder}",
        **{**SETTINGS, "dispatch": False},
    )
    client = server.client()
    stored = client.post("/v1/scenes", content=SCENE + b"# away\n")
    assert stored.status_code == 201
    moved = folder.rename(folder.with_name("gone"))
    folder.touch()  # nothing can be put below a file
    problem(client.post("/v1/scenes", content=SCENE + b"# later\n"), 503, "unavailable")
    folder.unlink()
    moved.rename(folder)
    assert client.post("/v1/scenes", content=SCENE + b"# later\n").status_code == 201
