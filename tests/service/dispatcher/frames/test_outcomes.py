"""What the end of a frame's worker means for the frame."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from primray_service.dispatcher.chunks.messages import Failed, Yielded
from primray_service.dispatcher.frames import outcomes
from primray_service.dispatcher.frames.outcomes import Again, Broken, Circumstances, GivenUp, outcome_of
from primray_service.executor.base import Ended
from primray_service.jobs import Frame
from primray_service.limits import Limits
from primray_service.problems import Problem

LIMITS = Limits(crashes=2, kills=3)
FRAME = Frame("job_1", 0, None)
CRASHED = replace(FRAME, crashes=1)
KILLED = replace(FRAME, kills=2)
CALM = Circumstances(canceling=False, killed_for="", disk_is_full=False, had_checkpoint=False)
DISK = replace(CALM, disk_is_full=True)


def ended(reason: str, number: int | None = None) -> Ended:
    return Ended(reason, None, number, Path(), 0.0, 0, "")


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
