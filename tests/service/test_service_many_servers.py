"""Three servers over one PostgreSQL database and one data directory: all answer alike, one dispatches, and when it dies another
does, before its lease would have been over twice."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx2
import pytest
from tests.service.api_calls import ENDLESS, SCENE, finished, submit, upload, wait_until
from tests.service.conftest import StartServer, make_key
from tests.service.faults import made
from tests.service.many_servers import Many, metric
from tests.service.postgres import Databases, postgres_databases, postgres_server

from primray_service.dispatcher.lease import TTL_S
from primray_service.files import DataDirectory
from primray_service.store import open_store

__all__ = ["postgres_databases", "postgres_server"]

SETTINGS = {"slots": 1, "warm": False, "allow_unsandboxed": True, "limits": {"checkpoint_every_s": 0.3, "free_disk_bytes": 0}}
LONG = {"resolution": [96, 72], "seed": 3, "frames": "1:2", "stop": {"max_samples": 256}}


@pytest.fixture(scope="module")
def database(postgres_databases: Databases) -> Iterator[str]:
    name = postgres_databases.take()
    yield postgres_databases.server.url_of(name)
    postgres_databases.give_back(name)


@pytest.fixture(scope="module")
def many(start_server: StartServer, database: str, tmp_path_factory: pytest.TempPathFactory) -> Many:
    data = tmp_path_factory.mktemp("many") / "data"
    found = Many(lambda: start_server(data, database=database, **SETTINGS))
    found.more(3)
    return found


@pytest.fixture(scope="module")
def alone(start_server: StartServer) -> httpx2.Client:
    return start_server(**SETTINGS).client()


def alike(clients: list[httpx2.Client], path: str) -> httpx2.Response:
    """What all of them answer, which is the same."""
    answers = [client.get(path) for client in clients]
    assert [answer.status_code for answer in answers] == [200] * len(clients), [answer.text[:300] for answer in answers]
    assert len({answer.content for answer in answers}) == 1, [answer.text[:1000] for answer in answers]
    assert len({answer.headers.get("etag") for answer in answers}) == 1
    return answers[0]


def test_one_dispatches_and_all_say_the_same_of_it(many: Many) -> None:
    many.leader()
    clients = many.all()
    leads = [client.get("/readyz").json()["checks"]["dispatcher"]["leads"] for client in clients]
    assert sorted(leads) == ["elsewhere", "elsewhere", "here"]
    assert sum(metric(client, "primray_dispatcher_leader") for client in clients) == 1
    assert sum(metric(client, "primray_executor_slots") for client in clients) == 1
    wait_until(lambda: all(client.get("/v1/capabilities").json()["sandbox"] for client in clients))
    alike(clients, "/v1/capabilities")


def test_what_one_takes_all_have(many: Many) -> None:
    clients = many.all()
    for turn in range(3):
        ordered = clients[turn:] + clients[:turn]
        scene = upload(ordered[0], SCENE + b"# %d\n" % turn)
        job = finished(ordered[2], submit(ordered[1], scene)["id"])
        assert job["state"] == "succeeded", job
        here = f"/v1/jobs/{job['id']}"
        for path in ("", "/outputs", "/frames", "/convergence", "/log", "/preview"):
            alike(clients, here + path)
        for output in clients[0].get(f"{here}/outputs").json()["items"]:
            body = alike(clients, output["urls"]["immutable"]).content
            assert hashlib.sha256(body).hexdigest() == output["sha256"]
            part = [client.get(output["urls"]["self"], headers={"range": "bytes=3-7"}) for client in clients]
            assert [answer.content for answer in part] == [body[3:8]] * 3
        assert clients[turn].delete(here).status_code == 204
        assert [client.get(here).status_code for client in clients] == [404] * 3
        assert not (many.data / "jobs" / job["id"]).exists()


def test_a_job_is_watched_and_ended_from_servers_that_do_not_dispatch(many: Many) -> None:
    one, other = many.only_answers()
    scene = upload(one)
    heard: list[tuple[float, str]] = []
    job_id = submit(one, scene, ENDLESS)["id"]
    here = f"/v1/jobs/{job_id}"

    def listen() -> None:
        with other.stream("GET", f"{here}/events", headers={"accept": "text/event-stream"}) as stream:
            heard.extend((time.monotonic(), line) for line in stream.iter_lines() if line.startswith("event: "))

    listening = threading.Thread(target=listen)
    listening.start()
    wait_until(lambda: other.get(here).json()["progress"]["samples_done"] > 0, 60)
    first = wait_until(lambda: picture(other, here), 20)  # the dispatcher is told that somebody looks
    wait_until(lambda: (newer := picture(other, here)) is not None and newer != first, 20)
    canceled = time.monotonic()
    assert one.post(f"{here}/cancel").status_code == 202
    listening.join(30)
    assert heard[-1][1] == "event: end"
    assert {"event: state", "event: progress", "event: preview"} <= {line for _, line in heard}
    assert finished(other, job_id)["state"] == "canceled"
    assert heard[-1][0] - canceled < 15


def picture(client: httpx2.Client, here: str) -> str | None:
    answer = client.get(f"{here}/preview")
    return answer.headers["etag"] if answer.status_code == 200 else None


def test_what_one_writes_another_hears_at_once(many: Many) -> None:
    """By a notice of the database, not when somebody looks again: from request to answer, on a machine that has other work."""
    one, other = many.only_answers()
    job_id = submit(one, upload(one), ENDLESS)["id"]
    wait_until(lambda: one.get(f"/v1/jobs/{job_id}").json()["progress"]["samples_done"] > 0, 60)
    taken = []
    for priority in range(60, 75):
        waits = {"prefer": "wait=20", "if-none-match": other.get(f"/v1/jobs/{job_id}").headers["etag"]}
        before: dict[str, Any] = {}

        def poll(waits: dict[str, str] = waits, before: dict[str, Any] = before) -> None:
            other.get(f"/v1/jobs/{job_id}", headers=waits)
            before["heard"] = time.monotonic()

        polling = threading.Thread(target=poll)
        polling.start()
        time.sleep(0.05)
        patched = time.monotonic()
        one.patch(f"/v1/jobs/{job_id}", json={"priority": priority})
        polling.join(30)
        taken.append(before["heard"] - patched)
    one.post(f"/v1/jobs/{job_id}/cancel")
    finished(one, job_id)
    print("heard after", sorted(taken))
    assert sorted(taken)[len(taken) // 2] < 0.4  # looking alone would take half a second on average


def test_places_in_the_queue_are_told_alike(many: Many) -> None:
    clients = many.all()
    scene = upload(clients[0])
    short = {"resolution": [32, 24], "stop": {"max_samples": 8}}
    finished(clients[0], submit(clients[0], scene, short)["id"])  # so that it is known how long such a frame takes
    running = submit(clients[0], scene, ENDLESS | {"stop": {"max_seconds": 120}})["id"]
    wait_until(lambda: clients[0].get(f"/v1/jobs/{running}").json()["progress"]["eta_s"], 60)
    first, second = (submit(clients[1], scene, short, priority=10)["id"] for _ in range(2))

    def told() -> list[dict[str, Any]] | None:
        found = [client.get(f"/v1/jobs/{second}").json()["queue"] for client in clients]
        return found if all(each["estimated_start_s"] is not None for each in found) else None

    found = wait_until(told, 15)
    assert {(each["place"], each["waiting"], each["frames_ahead"]) for each in found} == {(2, 2, 2)}
    starts = [each["estimated_start_s"] for each in found]
    assert max(starts) - min(starts) < 10
    for job_id in (running, first, second):
        clients[2].post(f"/v1/jobs/{job_id}/cancel")
        finished(clients[2], job_id)


def test_who_logs_out_at_one_is_out_at_all(start_server: StartServer, database: str, many: Many) -> None:
    kept = {"dispatch": False, "warm": False, "require_keys": True, "database": database}
    one, other = (start_server(many.data, **kept) for _ in range(2))
    key = make_key(database, "a", "read")
    cookie = one.client().post("/v1/session", json={"key": key}).headers["set-cookie"].partition(";")[0]
    assert other.client().get("/v1/whoami", headers={"cookie": cookie}).status_code == 200
    one.client().delete("/v1/session", headers={"cookie": cookie})
    assert one.client().get("/v1/whoami", headers={"cookie": cookie}).status_code == 401
    wait_until(lambda: other.client().get("/v1/whoami", headers={"cookie": cookie}).status_code == 401)
    for server in (one, other):
        server.stop()


def test_when_the_one_that_dispatches_dies_another_goes_on(many: Many, database: str, alone: httpx2.Client) -> None:
    expected = finished(alone, submit(alone, upload(alone), LONG)["id"], 120)
    client = many.only_answers()[0]
    scene = upload(client)
    jobs = [submit(client, scene, LONG)["id"] for _ in range(2)]
    wait_until(lambda: any(frame["checkpoint"] for frame in frames(database, jobs[0])), 90)
    killed, left = many.kill_leader()
    uploaded_meanwhile = left[0].post("/v1/scenes", content=SCENE + b"# meanwhile\n")
    assert uploaded_meanwhile.status_code == 201
    wait_until(lambda: many.leaders(), 30)
    taken_over_s = time.monotonic() - killed
    print("taken over after", taken_over_s)
    assert taken_over_s < TTL_S + 20
    many.more()  # the dead one's successor removes nothing of theirs
    store = open_store(database)
    for job_id in jobs:
        found = [finished(each, job_id, 180) for each in many.all()]
        assert [job["state"] for job in found] == ["succeeded"] * 3, found[0]
        assert found[0]["result"]["pixels_sha256"] == expected["result"]["pixels_sha256"]
        assert made(store, DataDirectory(many.data), job_id).pixels  # all of it is there, once
    store.close()
    assert sum(metric(each, "primray_dispatcher_leader") for each in many.all()) == 1
    assert [line for server in many.servers for line in server.failures()] == []


def frames(database: str, job_id: str) -> list[dict[str, Any]]:
    store = open_store(database)
    found = [{"checkpoint": frame.checkpoint} for frame in store.frames(job_id)]
    store.close()
    return found
