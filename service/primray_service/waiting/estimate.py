"""Position of a job in the queue, and the start of its first frame. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from .order import Waiting


@dataclass(frozen=True)
class Active:
    """A job with running frames; `left_s`: until it is done, including waiting frames, None if unknown."""

    priority: int
    frames_running: int
    left_s: float | None


@dataclass(frozen=True)
class Place:
    place: int  # 1: the next to begin
    frames_ahead: int  # frames that run or will be claimed before its first
    start_s: float | None  # seconds from now; None: unknown


def places(
    order: Sequence[Waiting], active: Sequence[Active], slots: int, seconds_of: Callable[[Waiting], float | None]
) -> Mapping[str, Place]:
    """Return the places of jobs that have not begun. Frames of lower priority are preempted, so they are not waited for."""
    found: dict[str, Place] = {}
    before: dict[int, tuple[int, float | None]] = {}  # running work, by the priority of the waiting job
    claimed = 0
    ahead_s: float | None = 0.0  # slot seconds of jobs that have not begun
    for job in order:
        if not job.begun:
            if job.priority not in before:
                before[job.priority] = _added_up([other for other in active if other.priority >= job.priority])
            running, running_s = before[job.priority]
            start_s = _start_s(running_s, ahead_s, running + claimed, slots)
            found[job.job_id] = Place(len(found) + 1, running + claimed, start_s)
            each = seconds_of(job)
            ahead_s = None if each is None or ahead_s is None else ahead_s + job.frames * each
        claimed += job.frames
    return found


def _added_up(active: Sequence[Active]) -> tuple[int, float | None]:
    """Return the number of running frames, and the slot seconds until all are done; None if one of those is unknown."""
    left = [job.left_s * job.frames_running for job in active if job.left_s is not None]
    return sum(job.frames_running for job in active), sum(left) if len(left) == len(active) else None


def _start_s(running_s: float | None, ahead_s: float | None, frames_ahead: int, slots: int) -> float | None:
    if frames_ahead < slots:
        return 0.0
    if not slots or running_s is None or ahead_s is None:  # without slots, the time of the next is unknown
        return None
    return (running_s + ahead_s) / slots
