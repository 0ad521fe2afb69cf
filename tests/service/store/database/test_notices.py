"""What servers over one PostgreSQL tell each other arrives at once, in part also after a connection broke."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from tests.service.api_calls import wait_until

from primray_service.store import SqlStore, open_store

from ...postgres import Databases, postgres_databases, postgres_server, postgres_url
from ..conftest import database_of
from ..world import World

__all__ = ["postgres_databases", "postgres_server", "postgres_url"]


class Listener:
    def __init__(self, url: str) -> None:
        self.store = open_store(url)
        self.heard: list[object] = []
        self.store.subscribe(self.heard.append)
        self.store.listen(self.heard.append)

    def is_listening(self) -> bool:
        notices = self.store._db._notices
        assert notices is not None
        return notices.is_listening.is_set()


@pytest.fixture
def pair(postgres_url: str) -> Iterator[tuple[Listener, Listener]]:
    both = Listener(postgres_url), Listener(postgres_url)
    wait_until(lambda: all(one.is_listening() for one in both), 20)
    yield both
    for one in both:
        one.store.close()


def test_the_others_hear_of_changes_and_words_and_oneself_of_ones_own_changes_once(pair: tuple[Listener, Listener]) -> None:
    one, other = pair
    world = World(one.store)
    world.lead()
    job = world.job()
    one.store.tell({"do": "wake"})
    wait_until(lambda: {"do": "wake"} in other.heard)
    wait_until(lambda: job.id in other.heard)
    assert set(map(str, one.heard)) == {job.id}


def test_they_arrive_within_milliseconds(pair: tuple[Listener, Listener]) -> None:
    one, other = pair
    taken = []
    for _ in range(50):
        other.heard.clear()
        began = time.perf_counter()
        one.store.tell({"do": "wake"})
        while not other.heard and time.perf_counter() - began < 5:
            time.sleep(0.0002)
        taken.append(time.perf_counter() - began)
    print("median", sorted(taken)[25], "slowest", max(taken))
    assert sorted(taken)[25] < 0.1


def test_after_a_broken_connection_they_are_heard_again(
    pair: tuple[Listener, Listener], postgres_url: str, postgres_databases: Databases
) -> None:
    one, other = pair
    postgres_databases.server.kill_connections(database_of(postgres_url))

    def told() -> bool:
        one.store.tell({"do": "wake"})
        return {"do": "wake"} in other.heard

    wait_until(told, 20)


def test_many_changes_fit_into_notices(pair: tuple[Listener, Listener]) -> None:
    one, other = pair
    ids = [f"job_{number:026d}" for number in range(3000)]
    for job_id in ids:
        one.store._db._tell(job_id)
    wait_until(lambda: set(ids) <= set(other.heard), 20)


def test_a_store_that_does_not_listen_has_nothing_open(postgres_url: str) -> None:
    store: SqlStore = open_store(postgres_url)
    store.tell({"do": "wake"})
    assert store._db._notices is None
    store.close()


def test_all_agree_on_the_time_whatever_their_own_clocks_say(postgres_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    store = open_store(postgres_url)
    before = store.clock()
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + 3600)
    assert 0 <= store.clock() - before < 60
    store.close()
