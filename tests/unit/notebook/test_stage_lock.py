"""Cells that edit stages and threads that read them do not meet."""

from __future__ import annotations

import sys
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from primray.notebook.stage_lock import StageLock


def is_free(lock: StageLock) -> bool:
    """Whether another thread would get it."""
    found = list[bool]()

    def ask() -> None:
        got = lock._lock.acquire(blocking=False)
        found.append(got)
        if got:
            lock._lock.release()

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return found[0]


def test_a_cell_holds_it_once() -> None:
    lock = StageLock()
    lock.hold()
    lock.hold()
    assert not is_free(lock)
    with lock:  # as a thread that reads does
        pass
    assert not is_free(lock)
    lock.let_go()
    assert is_free(lock)
    lock.let_go()
    assert is_free(lock)


def test_what_waits_lets_go_and_holds_again() -> None:
    lock = StageLock()
    with lock.held():
        with lock.released():
            assert is_free(lock)
        assert not is_free(lock)
        with lock.held():
            pass
        assert not is_free(lock)
    assert is_free(lock)
    with lock.released():
        assert is_free(lock)
    assert is_free(lock)


def test_cells_are_followed_where_there_is_ipython(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: dict[str, Any] = {}
    shell = SimpleNamespace(events=SimpleNamespace(register=heard.__setitem__))
    ended: list[bool] = []
    lock = StageLock()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    lock.follow_cells(lambda: ended.append(True))
    assert is_free(lock)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    lock.follow_cells(lambda: ended.append(is_free(lock)))
    assert not is_free(lock)  # the rest of the cell that asked
    heard["post_execute"]()
    assert ended == [True]
    assert is_free(lock)
    heard["pre_execute"]()
    assert not is_free(lock)
    heard["post_execute"]()
    assert ended == [True, True]
