"""Events over HTTP: pages, streams that resume, many streams at once."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator

import httpx2
import pytest
from tests.service.api_calls import Json, problem, stored, submit, wait_until
from tests.service.conftest import StartServer
from tests.service.serving import RunningServer

from primray_service.api import views

STREAM = {"accept": "text/event-stream"}


@pytest.fixture(scope="module")
def server(start_server: StartServer) -> RunningServer:
    return start_server(dispatch=False, warm=False)


@pytest.fixture(scope="module")
def client(server: RunningServer) -> httpx2.Client:
    return server.client()


@pytest.fixture
def here(client: httpx2.Client) -> str:
    return f"/v1/jobs/{submit(client, stored(client))['id']}"


def read(lines: Iterator[str]) -> Iterator[tuple[int, str, Json]]:
    """(id, type, data) of each event."""
    event: dict[str, str] = {}
    for line in lines:
        name, _, value = line.partition(": ")
        if line:
            event[name] = value
        elif "id" in event:
            yield int(event["id"]), event["event"], json.loads(event["data"])
            event = {}
        else:
            event = {}


def test_pages_and_streams_tell_the_same(client, here):
    client.post(f"{here}/cancel")
    page = client.get(f"{here}/events")
    views.EventPage.model_validate_json(page.content)
    items = page.json()["items"]
    assert page.json()["ended"]
    with client.stream("GET", f"{here}/events", headers=STREAM) as stream:
        assert stream.headers["content-type"] == "text/event-stream; charset=utf-8"
        told = list(read(stream.iter_lines()))
    assert told == [(item["id"], item["type"], item["data"]) for item in items]
    assert [kind for _, kind, _ in told] == ["state", "state", "end"]


def test_who_comes_back_misses_nothing_and_gets_nothing_twice(client, here):
    client.post(f"{here}/cancel")
    ids = [item["id"] for item in client.get(f"{here}/events").json()["items"]]
    for at, seen in enumerate(ids[:-1]):
        with client.stream("GET", f"{here}/events", headers={**STREAM, "last-event-id": str(seen)}) as stream:
            assert [number for number, _, _ in read(stream.iter_lines())] == ids[at + 1 :]
        page = client.get(f"{here}/events?after={seen}&limit=1").json()
        assert [item["id"] for item in page["items"]] == ids[at + 1 : at + 2]
        assert page["next_after"] == ids[at + 1]
    assert client.get(f"{here}/events", headers={**STREAM, "last-event-id": str(ids[-1])}).status_code == 204
    problem(client.get(f"{here}/events", headers={"last-event-id": "x"}), 422, "invalid-request")
    problem(client.get(f"{here}/events", headers={"accept": "image/png"}), 406, "not-acceptable")


def test_a_stream_tells_at_once_and_goes_on_over_attempts(server, client, here):
    told: list[tuple[float, str, Json]] = []

    def listen() -> None:
        with server.client() as mine, mine.stream("GET", f"{here}/events", headers=STREAM) as stream:
            told.extend((time.perf_counter(), kind, data) for _, kind, data in read(stream.iter_lines()))

    listener = threading.Thread(target=listen)
    listener.start()
    wait_until(lambda: told)
    changed = time.perf_counter()
    client.post(f"{here}/cancel")
    listener.join(10)
    assert [kind for _, kind, _ in told] == ["state", "state", "end"]
    assert told[-1][0] - changed < 1.0

    client.post(f"{here}/continue", json={})
    client.post(f"{here}/cancel")
    with client.stream("GET", f"{here}/events", headers=STREAM) as stream:
        states = [(data["attempt"], kind) for _, kind, data in read(stream.iter_lines()) if kind == "end"]
    assert states == [(1, "end"), (2, "end")]


def test_a_stream_ends_when_its_job_is_deleted(client, here):
    with client.stream("GET", f"{here}/events", headers=STREAM) as stream:
        lines = stream.iter_lines()
        assert next(lines) == "retry: 2000"
        client.delete(here)
        began = time.perf_counter()
        list(lines)
    assert time.perf_counter() - began < 30


def test_many_streams_hear_the_same(server, client, here):
    """And the server still answers quickly; half of the listeners go away in the middle."""

    async def listen(mine: httpx2.AsyncClient, begun: asyncio.Semaphore, stay: bool) -> list[str]:
        kinds = []
        async with mine.stream("GET", f"{here}/events", headers=STREAM) as stream:
            async for line in stream.aiter_lines():
                if line.startswith("event: "):
                    kinds.append(line[7:])
                    begun.release()
                    if not stay:
                        break
        return kinds

    async def all_of_them() -> list[list[str]]:
        begun = asyncio.Semaphore(0)
        limits = httpx2.Limits(max_connections=200)
        async with httpx2.AsyncClient(base_url=server.url, timeout=30, limits=limits, trust_env=False) as mine:
            tasks = [asyncio.create_task(listen(mine, begun, number % 2 == 0)) for number in range(60)]
            for _ in tasks:
                await begun.acquire()
            assert (await mine.post(f"{here}/cancel")).status_code == 202
            return await asyncio.gather(*tasks)

    heard = asyncio.run(all_of_them())
    assert heard == [["state", "state", "end"], ["state"]] * 30
    assert client.get(here).json()["state"] == "canceled"
