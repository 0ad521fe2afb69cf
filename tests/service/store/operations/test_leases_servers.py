"""What servers know of each other by the store: who dispatches and what they can do, how long works take, who logged out."""

from __future__ import annotations

import threading
import time

import pytest

from primray_service.store import SqlStore, open_store
from primray_service.store.base import Lost

from ..world import T0, World

ABOUT = {"executor": {"slots": 2}, "sandbox": {"landlock": "on"}}


def test_who_leads_says_what_it_can_do(store: SqlStore) -> None:
    assert store.leader() is None
    now = store.clock()
    fence = store.acquire_lease("a", now, 60, ABOUT)
    assert fence is not None
    leader = store.leader()
    assert leader is not None
    assert (leader.holder, leader.about) == ("a", ABOUT)
    assert 0 < leader.expires_in_s <= 60
    store.renew_lease(fence, now, 60, {"executor": {"slots": 3}})
    store.renew_lease(fence, now, 60)
    leader = store.leader()
    assert leader is not None
    assert leader.about == {"executor": {"slots": 3}}
    store.release_lease(fence)
    assert store.leader() is None
    store.acquire_lease("b", now - 100, 60)
    assert store.leader() is None  # its time is over


def test_the_newest_works_are_kept(world: World) -> None:
    store = world.store
    for number, work in enumerate(("a", "b", "c", "a")):
        store.note_work(world.fence, work, float(number), T0 + number, 2)
    assert list(store.work_seconds().items()) == [("c", 2.0), ("a", 3.0)]
    with pytest.raises(Lost):
        store.note_work(world.fence - 1, "d", 1.0, T0, 2)


def test_a_session_that_ended_is_known_as_long_as_it_would_have_gone_on(store: SqlStore, url: str) -> None:
    assert not store.session_has_ended("a")
    store.end_session("a", T0 + 10, T0)
    store.end_session("a", T0 + 10, T0)
    other = open_store(url)
    assert other.session_has_ended("a")
    other.end_session("b", T0 + 100, T0 + 50)
    assert not store.session_has_ended("a")
    assert store.session_has_ended("b")
    other.close()


def test_one_at_a_time_is_inside(store: SqlStore) -> None:
    inside, most, lock = 0, 0, threading.Lock()

    def work() -> None:
        nonlocal inside, most
        for _ in range(5):
            with store.exclusive("scene 1"):
                with lock:
                    inside += 1
                    most = max(most, inside)
                time.sleep(0.005)
                with lock:
                    inside -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert most == 1
