"""Decisions and sums that need no worker: who gives way, whose turn it is, what an end means, what frames add up to."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from primray_service.dispatcher import fair_share
from primray_service.dispatcher.chunks.adoption import append_log
from primray_service.dispatcher.chunks.commands import output_names
from primray_service.dispatcher.chunks.messages import Failed, Yielded
from primray_service.dispatcher.frames import outcomes
from primray_service.dispatcher.frames.outcomes import Again, Broken, Circumstances, GivenUp, outcome_of
from primray_service.dispatcher.frames.report_throttle import ReportThrottle
from primray_service.dispatcher.frames.totals import JobTotals
from primray_service.dispatcher.giving_way import Running, who_gives_way
from primray_service.executor.base import Ended
from primray_service.jobs import Frame, FrameState, Job, JobState
from primray_service.limits import Limits, Quotas
from primray_service.problems import Problem

LIMITS = Limits(crashes=2, kills=3, time_slice_s=20.0)
FRAME = Frame("job_1", 0, None)
JOB = Job("job_1", "t", JobState.RUNNING, "sha256:0", None, {"stop": {}}, 0.0, 0.0, 1.0, 1.0)
CALM = Circumstances(canceling=False, killed_for="", disk_is_full=False, had_checkpoint=False)


def ended(reason: str, number: int | None = None) -> Ended:
    return Ended(reason, None, number, Path(), 0.0, 0, "")


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
    assert [key for key, _ in who_gives_way(frames, waiting, LIMITS.time_slice_s)] == told


def test_giving_way_comes_to_rest() -> None:
    """Whatever was decided, deciding again on what it led to moves nothing to and fro between tenants that both have slots."""
    frames = [running("a", n) for n in range(5)] + [running("b")]
    for _ in range(10):
        told = who_gives_way(frames, [(50, "a"), (50, "b")], 20.0)
        for key in told:
            gone = next(frame for frame in frames if frame.key == key)
            other = "b" if gone.tenant == "a" else "a"
            frames[frames.index(gone)] = replace(gone, tenant=other, key=(f"{other}{id(gone)}", 0))
    assert sorted(frame.tenant for frame in frames) == ["a"] * 3 + ["b"] * 3
    assert who_gives_way(frames, [(50, "a"), (50, "b")], 20.0) == []


@pytest.mark.parametrize(
    ("waiting", "slots", "served", "passed_over"),
    [
        ([(50, "a")], {}, {}, set()),
        ([(50, "a"), (50, "b")], {}, {}, set()),  # never served: the queue's order
        ([(50, "a"), (50, "b")], {}, {"a": 1.0}, {"a"}),
        ([(50, "a"), (50, "b"), (50, "c")], {}, {"a": 3.0, "b": 1.0, "c": 2.0}, {"a", "c"}),
        ([(50, "a"), (50, "b")], {"b": 1}, {"a": 2.0, "b": 1.0}, set()),  # b has a slot, a has none
        ([(60, "a"), (50, "b")], {}, {"a": 2.0, "b": 1.0}, set()),
    ],
)
def test_whose_turn_it_is(waiting: Any, slots: dict[str, int], served: dict[str, float], passed_over: set[str]) -> None:
    quotas = fair_share.quotas_of_next_claim(lambda tenant: Quotas(), waiting, slots, served)
    assert {tenant for _, tenant in waiting if quotas(tenant).running_jobs == 0} == passed_over


CRASHED = replace(FRAME, crashes=1)
KILLED = replace(FRAME, kills=2)
DISK = replace(CALM, disk_is_full=True)


def failed(slug: str) -> Failed:
    return Failed(Problem(slug, "d").as_json())


@pytest.mark.parametrize(
    ("frame", "last", "end", "about", "outcome"),
    [
        (FRAME, Yielded(), ended("exited"), CALM, Again(FRAME, "yield")),
        (FRAME, None, ended("signal", signal.SIGSEGV), CALM, Again(CRASHED, "crash")),
        (CRASHED, None, ended("signal", signal.SIGSYS), CALM, "renderer-crashed"),
        (CRASHED, None, ended("exited"), CALM, "renderer-crashed"),
        (CRASHED, None, ended("signal", signal.SIGKILL), CALM, Again(replace(CRASHED, kills=1), "kill")),
        (FRAME, None, ended("lost"), CALM, Again(replace(FRAME, kills=1), "kill")),
        (FRAME, None, ended("killed"), CALM, Again(replace(FRAME, kills=1), "kill")),  # but not by us
        (FRAME, None, ended("killed"), replace(CALM, killed_for="yield"), Again(FRAME, "yield")),
        (FRAME, None, ended("killed"), replace(CALM, killed_for="silent"), Again(replace(FRAME, kills=1), "silent")),
        (KILLED, None, ended("killed"), replace(CALM, killed_for="silent"), "render-failed"),
        (KILLED, None, ended("signal", signal.SIGTERM), CALM, "render-failed"),
        (FRAME, None, ended("memory-limit"), CALM, "memory-limit"),
        (FRAME, None, ended("time-limit"), CALM, "time-limit"),
        (FRAME, None, ended("storage-limit"), CALM, "storage-limit"),
        (FRAME, None, ended("storage-limit"), DISK, Again(FRAME, "storage")),
        (FRAME, failed("storage-limit"), ended("exited"), DISK, Again(FRAME, "storage")),
        (FRAME, failed("scene-too-large"), ended("exited"), CALM, "scene-too-large"),
        (FRAME, failed("checkpoint-unusable"), ended("exited"), CALM, "checkpoint-unusable"),
        (
            FRAME,
            failed("checkpoint-unusable"),
            ended("exited"),
            replace(CALM, had_checkpoint=True),
            Again(FRAME, "checkpoint", drop_checkpoint=True),
        ),
        (FRAME, failed("scene-rejected"), ended("exited"), replace(CALM, canceling=True), GivenUp()),
        (FRAME, None, ended("signal", signal.SIGSEGV), replace(CALM, canceling=True), GivenUp()),
    ],
)
def test_what_an_end_means(frame: Frame, last: Any, end: Ended, about: Circumstances, outcome: Any) -> None:
    found = outcome_of(frame, last, end, about, LIMITS)
    if isinstance(outcome, str):
        assert isinstance(found, Broken)
        assert found.problem["type"] == f"/problems/{outcome}"
    else:
        assert found == outcome


def test_a_crash_tells_its_signal() -> None:
    assert outcomes.crash_problem(ended("signal", signal.SIGABRT)).extra == {"signal": "SIGABRT"}


def test_progress_is_told_often_at_first_and_seldom_later() -> None:
    """Of a render that has news ten times a second for two hours."""
    throttle, told = ReportThrottle(0.0), []
    for tick in range(72_000):
        if throttle.takes_event("progress", tick / 10):
            told.append(tick / 10)
    first_hour = [at for at in told if at < 3600]
    assert told[:4] == [0.0, 0.5, 1.0, 1.5]
    assert 300 < len(first_hour) < 600
    assert len(told) - len(first_hour) <= 361


def frame(number: int, state: FrameState, **progress: Any) -> Frame:
    return replace(FRAME, number=number, state=state, progress=progress)


def test_a_jobs_progress_is_its_frames() -> None:
    done, runs, waits = FrameState.SUCCEEDED, FrameState.RUNNING, FrameState.QUEUED
    error = {"metric": "relmse", "estimate": 0.5, "ci95": [0.4, 0.6], "target": None, "kind": "estimated"}
    totals = JobTotals(
        JOB,
        [
            frame(0, done, elapsed_s=10.0, rays=100, fraction=1.0),
            frame(1, runs, elapsed_s=4.0, rays=50, rays_per_s=5.0, fraction=0.5, eta_s=6.0, eta_ci95=[3.0, 12.0], error=error),
            frame(2, waits),
            frame(3, waits),
        ],
    )
    found = totals.progress(0.0)
    assert found["fraction"] == pytest.approx(1.5 / 4)
    assert (found["rays"], found["rays_per_s"], found["elapsed_s"]) == (150, 5.0, 14.0)
    assert found["error"] == error
    assert found["eta_s"] == pytest.approx(6.0 + 2 * 10.0)  # two more like the one that is done
    assert found["eta_ci95"] == pytest.approx([13.0, 52.0])
    assert found["frames"] == {"total": 4, "queued": 2, "running": 1, "succeeded": 1, "failed": 0, "canceled": 0}
    totals.set(frame(1, waits))
    assert totals.progress(0.0)["fraction"] == pytest.approx(1.5 / 4), "it never falls"


def test_a_jobs_stop_is_its_frames_worst() -> None:
    totals = JobTotals(JOB, [])
    for number, (reason, met) in enumerate([("target-error", True), ("samples", False), ("target-error", True)]):
        result = {"stop": {"reason": reason, "target_met": met}, "error": {"estimate": number}, "outputs": ["a"], "samples": 5}
        totals.set(replace(FRAME, number=number, state=FrameState.SUCCEEDED, result=result))
    found = totals.result()
    assert found is not None
    assert found["stop"] == {"reason": "samples", "target_met": False}
    assert (found["error"], found["outputs"], found["samples"]) == ({"estimate": 2}, 3, 15)


@pytest.mark.parametrize(
    ("time_code", "frames", "attempt", "name"),
    [
        (None, 1, 1, "beauty.exr"),
        (7.0, 1, 1, "beauty.exr"),
        (7.0, 2, 1, "beauty.0007.exr"),
        (12345.0, 2, 1, "beauty.12345.exr"),
        (-3.0, 2, 1, "beauty.-003.exr"),
        (1.5, 2, 1, "beauty.0001.500.exr"),
        (7.0, 2, 3, "beauty-3.0007.exr"),
    ],
)
def test_names_of_outputs(time_code: float | None, frames: int, attempt: int, name: str) -> None:
    assert output_names(replace(JOB, attempt=attempt), replace(FRAME, time_code=time_code), frames)[0] == name


def test_a_log_keeps_its_newest_part(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    for i in range(100):
        append_log(path, f"run {i}", "a line\n" * 20, 2000)
        assert path.stat().st_size <= 2000
    text = path.read_text()
    assert text.startswith("[earlier lines are left out]\n")
    assert "run 99" in text
    assert "run 50" not in text
