"""What a job's frames add up to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from primray_service.dispatcher.frames.totals import JobTotals
from primray_service.jobs import Frame, FrameState, Job, JobState

FRAME = Frame("job_1", 0, None)
JOB = Job("job_1", "t", JobState.RUNNING, "sha256:0", None, {"stop": {}}, 0.0, 0.0, 1.0, 1.0)


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


@pytest.mark.parametrize("state", [FrameState.CANCELED, FrameState.FAILED, FrameState.RUNNING])
def test_a_frame_that_did_not_succeed_is_not_done(state: FrameState) -> None:
    totals = JobTotals(JOB, [frame(0, state, fraction=1.0)])
    assert totals.progress(0.0)["fraction"] == 0.99
