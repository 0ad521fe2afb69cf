"""Who gives way to whom, and that it comes to rest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.queue.order import Running, frames_to_preempt

TIME_SLICE_S = 20.0


def running(tenant: str, n: int = 0, priority: int = 50, ran_s: float = 30.0, going: bool = False) -> Running:
    return Running((f"{tenant}{n}", 0), priority, tenant, ran_s, going)


@pytest.mark.parametrize(
    ("frames", "waiting", "told"),
    [
        ([running("a")], [(50, "a")], []),  # one's own jobs wait
        ([running("a")], [(51, "a")], ["a0"]),  # but for higher priority
        ([running("a", ran_s=0.0)], [(51, "a")], ["a0"]),  # at once
        ([running("a")], [(49, "b")], []),
        ([running("a")], [(50, "b")], ["a0"]),
        ([running("a", ran_s=19.0)], [(50, "b")], []),  # within its slice
        ([running("a", going=True)], [(50, "b")], []),  # its slot is b's already
        ([running("a", going=True)], [(50, "b"), (50, "c")], []),
        ([running("a"), running("a", 1, ran_s=40.0)], [(50, "b")], ["a1"]),  # who ran longest
        ([running("a"), running("b")], [(50, "c")], ["a0"]),
        ([running("a"), running("a", 1), running("b")], [(50, "b")], []),  # 2 and 1: the other way would be no fairer
        ([running("a"), running("a", 1), running("a", 2), running("b")], [(50, "b")], ["a0"]),
        ([running("a", priority=10), running("b", priority=20)], [(30, "c")], ["a0"]),  # the lowest
        ([running("a", priority=10), running("b", priority=20)], [(30, "c"), (30, "d")], ["a0", "b0"]),
        ([running("a"), running("b")], [(50, "a"), (50, "b")], []),
    ],
)
def test_who_gives_way(frames: list[Running], waiting: list[tuple[int, str]], told: list[str]) -> None:
    assert [key[0] for key in frames_to_preempt(frames, waiting, TIME_SLICE_S)] == told


def test_giving_way_comes_to_rest() -> None:
    """Whatever was decided, deciding again on what it led to moves nothing to and fro between tenants that both have slots."""
    frames = [running("a", n) for n in range(5)] + [running("b")]
    for _ in range(10):
        told = frames_to_preempt(frames, [(50, "a"), (50, "b")], TIME_SLICE_S)
        for key in told:
            gone = next(frame for frame in frames if frame.key == key)
            other = "b" if gone.tenant == "a" else "a"
            frames[frames.index(gone)] = replace(gone, tenant=other, key=(f"{other}{id(gone)}", 0))
    assert sorted(frame.tenant for frame in frames) == ["a"] * 3 + ["b"] * 3
    assert frames_to_preempt(frames, [(50, "a"), (50, "b")], TIME_SLICE_S) == []
