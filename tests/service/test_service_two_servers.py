"""Two servers over one PostgreSQL database and one data directory: what one changes the other tells."""

from __future__ import annotations

import threading
import time

import httpx2
import pytest
from tests.service.api_calls import problem, stored, submit
from tests.service.conftest import StartServer, make_key
from tests.service.postgres import postgres_databases, postgres_server, postgres_url

__all__ = ["postgres_databases", "postgres_server", "postgres_url"]


@pytest.fixture
def pair(start_server: StartServer, postgres_url: str, tmp_path) -> tuple[httpx2.Client, httpx2.Client]:
    first = start_server(tmp_path / "data", database=postgres_url, dispatch=False, warm=False, require_keys=True)
    second = start_server(tmp_path / "data", database=postgres_url, dispatch=False, warm=False, require_keys=True)
    key = make_key(postgres_url, "a", "submit", "read")
    return first.client(key), second.client(key)


def test_what_one_changes_the_other_tells(pair):
    one, other = pair
    here = f"/v1/jobs/{submit(one, stored(one), labels={'ö': '😀'})['id']}"
    assert other.get(here).json()["labels"] == {"ö": "😀"}
    for priority in range(20):
        assert one.patch(here, json={"priority": priority}).status_code == 200
        assert other.get(here).json()["priority"] == priority  # at once, whoever asked just before

    heard: list[tuple[float, str]] = []

    def listen() -> None:
        with other.stream("GET", f"{here}/events", headers={"accept": "text/event-stream"}) as stream:
            heard.extend((time.monotonic(), line) for line in stream.iter_lines() if line.startswith("event: "))

    polled: list[tuple[float, str]] = []

    def poll() -> None:
        answer = other.get(here, headers={"prefer": "wait=20"})
        polled.append((time.monotonic(), answer.json()["state"]))

    threads = [threading.Thread(target=listen), threading.Thread(target=poll)]
    for thread in threads:
        thread.start()
    time.sleep(0.5)
    canceled = time.monotonic()
    one.post(f"{here}/cancel")
    for thread in threads:
        thread.join(20)
    assert heard[-1][1] == "event: end"
    assert polled[0][1] == "canceled"
    assert max(heard[-1][0], polled[0][0]) - canceled < 4

    # A session of one server counts at the other: they share the secret in the data directory.
    begun = one.post("/v1/session", json={"key": one.headers["authorization"].removeprefix("Bearer ")})
    with httpx2.Client(base_url=other.base_url, trust_env=False) as browser:
        cookie = begun.headers["set-cookie"].partition(";")[0]
        assert browser.get(here, headers={"cookie": cookie}).status_code == 200
        problem(browser.get(here), 401, "unauthenticated")

    again = {"json": {"scene": {"id": stored(one)}}, "headers": {"idempotency-key": "k"}}
    assert one.post("/v1/jobs", **again).json() == other.post("/v1/jobs", **again).json()
    problem(other.get("/v1/jobs?label=%00:x"), 422, "invalid-request")
