"""Signals that ask a render to end, and whose handlers are left alone."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from primray import render
from primray.render.interruption import interruption, terminate_as_interrupt

from ..conftest import FakePipeline


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_signal_asks_and_a_second_one_breaks_in() -> None:
    with interruption() as asked:
        assert not asked.asked
        signal.raise_signal(signal.SIGINT)
        assert asked.asked
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_sigterm_is_caught_where_it_is_wanted() -> None:
    terminate_as_interrupt()
    with interruption() as asked:
        signal.raise_signal(signal.SIGTERM)
        assert asked.asked
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)


def test_handlers_of_others_stay() -> None:
    got: list[Any] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *of: got.append(of[0]))
    terminate_as_interrupt()
    with interruption() as asked:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        assert not asked.asked
    assert got == [signal.SIGINT, signal.SIGTERM]


def test_ignored_signals_stay_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interruption() as asked:
        signal.raise_signal(signal.SIGINT)
    assert not asked.asked
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_a_signal_at_the_very_end_keeps_further_frames_from_beginning(pipeline: FakePipeline) -> None:
    def progress(fraction: float, samples: int, rays: int) -> None:
        if fraction == 1:
            signal.raise_signal(signal.SIGINT)

    image = render("a.usda", on_interrupt="partial", progress=progress)
    assert image.report["interrupted"] is True
    with pytest.raises(KeyboardInterrupt):
        render("a.usda", progress=progress)


def test_other_threads_cannot_and_need_not() -> None:
    failed: list[BaseException] = []

    def work() -> None:
        try:
            terminate_as_interrupt()
            with interruption() as asked:
                assert not asked.asked
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert failed == []
