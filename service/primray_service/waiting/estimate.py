"""Where a job stands in the queue, and when its first frame begins. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from .order import Waiting


@dataclass(frozen=True)
class Active:
    """A job of which frames run; `left_s`: until it is done, waiting frames with it, None if that is not known."""

    priority: int
    frames_running: int
    left_s: float | None


@dataclass(frozen=True)
class Place:
    place: int  # 1: it is begun next, of those that are not
    frames_ahead: int  # that run or will be claimed before its first
    start_s: float | None  # seconds from now; None: unknown


def places(
    order: Sequence[Waiting], active: Sequence[Active], slots: int, seconds_of: Callable[[Waiting], float | None]
) -> Mapping[str, Place]:
    """Of jobs that are not begun. What has a lower priority gives way, so it is not waited for."""
    found: dict[str, Place] = {}
    before: dict[int, tuple[int, float | None]] = {}  # what runs, by the priority of who waits for it
    claimed = 0
    ahead_s: float | None = 0.0  # slot seconds of jobs that are not begun
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
    """Frames that run, and the slot seconds until all are done; None if one's is not known."""
    left = [job.left_s * job.frames_running for job in active if job.left_s is not None]
    return sum(job.frames_running for job in active), sum(left) if len(left) == len(active) else None


def _start_s(running_s: float | None, ahead_s: float | None, frames_ahead: int, slots: int) -> float | None:
    if frames_ahead < slots:
        return 0.0
    if not slots or running_s is None or ahead_s is None:  # without slots, nobody knows when there will be some
        return None
    return (running_s + ahead_s) / slots
