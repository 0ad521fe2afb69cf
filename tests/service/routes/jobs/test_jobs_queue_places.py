"""What a job that waits says of its turn: in its document, in lists, in its stream of events, and to `primray watch`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tests.service.api_calls import ENDLESS, QUICK, finished, submit, upload, wait_until
from tests.service.conftest import StartServer
from tests.service.serving import RunningServer

from primray_service.client import Client


@pytest.fixture(scope="module")
def server(start_server: StartServer) -> RunningServer:
    return start_server(slots=1, cores=1)


def test_three_jobs_of_two_priorities(server: RunningServer) -> None:
    client = server.client()
    scene = upload(client)
    before = submit(client, scene)  # so that something is known of such frames
    assert finished(client, before["id"])["queue"] is None
    running = submit(client, scene, ENDLESS, priority=90)
    wait_until(lambda: client.get(f"/v1/jobs/{running['id']}").json()["state"] == "running", 60)

    first, low = submit(client, scene, priority=50), submit(client, scene, priority=10)
    high = submit(client, scene, {**QUICK, "frames": "1:3"}, priority=90)
    assert low["queue"]["place"] == low["queue"]["waiting"] == 2
    ids = [high["id"], first["id"], low["id"]]

    def queues() -> list[dict[str, int]]:
        """When no answer of an earlier moment is left."""
        found = [client.get(f"/v1/jobs/{job_id}").json()["queue"] for job_id in ids]
        return found if [queue["place"] for queue in found] == [1, 2, 3] else []

    told = wait_until(queues)
    assert [queue["waiting"] for queue in told] == [3, 3, 3]
    assert [queue["frames_ahead"] for queue in told] == [1, 4, 5]
    # `high` waits for one that has the same priority; what is known of that grows as it runs.
    starts = wait_until(lambda: (s := [queue["estimated_start_s"] for queue in queues()]) and None not in s and s, 60)
    assert 0 < starts[0] < starts[1] < starts[2]
    listed = {job["id"]: job["queue"] for job in client.get("/v1/jobs").json()["items"]}
    assert [listed[job_id]["place"] for job_id in ids] == [1, 2, 3]
    assert listed[running["id"]] is None

    with Client(server.url) as python:
        job = python.job(first["id"])
        assert job.queue is not None
        assert job.queue.place == 2
        event = next(event for event in python.watch(first["id"]) if event.type == "queue")
        assert event.data["place"] == 2
    watch = subprocess.Popen(
        [str(Path(sys.executable).with_name("primray")), "watch", low["id"], "--server", server.url],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert watch.stderr is not None
    assert f"{low['id']} queued: place 3 of 3, starts in about " in watch.stderr.readline()
    client.post(f"/v1/jobs/{running['id']}/cancel")
    assert watch.wait(180) == 0
    said = watch.stderr.read()
    assert "place 2 of 2" in said or "place 1 of 1" in said or "succeeded" in said
    for job_id in ids:
        assert finished(client, job_id)["queue"] is None


def test_what_is_not_known_is_null(start_server: StartServer) -> None:
    """A server that renders nothing: its scenes stay unchecked, so nothing can be begun."""
    client = start_server(dispatch=False).client()
    scene = client.post("/v1/scenes", content=b"#usda 1.0\n").json()["id"]
    job = submit(client, scene)
    assert job["queue"] == {"place": None, "waiting": 0, "frames_ahead": None, "estimated_start_s": None}
