"""Outcome of a frame whose chunk has ended. Pure: facts about the end go in, a decision comes out."""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace

from ...executor.base import Ended
from ...jobs import Frame, Json
from ...limits import GiB, Limits, MiB
from ...problems import Problem
from ..chunks.messages import Done, Failed, Yielded

Last = Done | Yielded | Failed

# Signals from outside, as by an administrator or the kernel's out-of-memory killer: not the scene's fault.
_FROM_OUTSIDE = frozenset({signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGPIPE})


@dataclass(frozen=True)
class Picture:
    """The chunk made outputs, which are to be adopted."""

    done: Done


@dataclass(frozen=True)
class Broken:
    """The frame has failed."""

    problem: Json


@dataclass(frozen=True)
class Again:
    """The frame is queued again; `frame` counts its worker's deaths."""

    frame: Frame
    why: str  # yield, crash, kill, shutdown, storage, silent, checkpoint, withdrawn
    drop_checkpoint: bool = False


@dataclass(frozen=True)
class GivenUp:
    """The frame was canceled and leaves no picture."""


Outcome = Picture | Broken | Again | GivenUp


@dataclass(frozen=True)
class Circumstances:
    """Facts about the end; `killed_for` is why the dispatcher itself killed the chunk, "" if it did not."""

    canceling: bool
    killed_for: str
    disk_is_full: bool
    had_checkpoint: bool


def outcome_of(frame: Frame, last: Last | None, ended: Ended, about: Circumstances, limits: Limits) -> Outcome:
    is_believed = about.killed_for != "not-believed"
    if isinstance(last, Done) and is_believed:
        return Picture(last)
    if about.canceling:
        return GivenUp()
    if not is_believed or (last is None and ended.protocol_error):
        return Broken(Problem("render-failed", "The render process sent an invalid message.").as_json())
    if isinstance(last, Yielded):
        return Again(frame, "yield")
    if isinstance(last, Failed):
        return _of_failure(frame, last, about)
    if about.killed_for == "silent":
        return _killed(frame, limits, "silent", "The render process hung repeatedly.")
    if about.killed_for:
        return Again(frame, about.killed_for)
    if ended.reason == "withdrawn":
        return Again(frame, "withdrawn", drop_checkpoint=True)
    if ended.reason in LIMITS_REACHED:
        return Again(frame, "storage") if _is_disk(ended.reason, about) else Broken(limit_problem(ended, limits).as_json())
    if ended.reason == "signal" and ended.signal not in _FROM_OUTSIDE:
        return _of_crash(frame, ended, limits)
    if ended.reason == "exited":
        return _of_crash(frame, ended, limits)
    return _killed(frame, limits, "kill", "The render process was killed from outside repeatedly.")


def _of_failure(frame: Frame, last: Failed, about: Circumstances) -> Outcome:
    slug = str(last.problem["type"]).removeprefix("/problems/")
    if _is_disk(slug, about):
        return Again(frame, "storage")
    if slug == "checkpoint-unusable" and about.had_checkpoint:
        return Again(frame, "checkpoint", drop_checkpoint=True)  # all that it holds can be rendered again
    return Broken(last.problem)


def _is_disk(slug: str, about: Circumstances) -> bool:
    """Return whether the server's disk was full, as opposed to the job's own limit being reached."""
    return about.disk_is_full and slug in ("storage-limit", "storage-full")


def _of_crash(frame: Frame, ended: Ended, limits: Limits) -> Outcome:
    frame = replace(frame, crashes=frame.crashes + 1)
    if frame.crashes < limits.crashes:
        return Again(frame, "crash")
    return Broken(crash_problem(ended).as_json())


def _killed(frame: Frame, limits: Limits, why: str, sentence: str) -> Outcome:
    frame = replace(frame, kills=frame.kills + 1)
    if frame.kills < limits.kills:
        return Again(frame, why)
    return Broken(Problem("render-failed", sentence).as_json())


LIMITS_REACHED = ("memory-limit", "time-limit", "storage-limit")


def limit_problem(ended: Ended, limits: Limits, memory_bytes: int | None = None, cpu_s: float | None = None) -> Problem:
    """Return the problem for a worker that an executor ended at a limit."""
    if ended.reason == "memory-limit":
        most = memory_bytes or limits.memory_bytes
        return Problem("memory-limit", f"The render needed more than the {_size(most)} of memory that are allowed.", limit=most)
    if ended.reason == "time-limit":
        seconds = limits.load_cpu_s if cpu_s is None else cpu_s
        sentence = f"Reading the scene took more than the {seconds:g} CPU seconds that are allowed."
        return Problem("time-limit", sentence, limit=seconds)
    return Problem(
        "storage-limit",
        f"The render wrote more than the {_size(limits.output_bytes)} that are allowed.",
        limit=limits.output_bytes,
    )


def _size(count: int) -> str:
    return f"{count / GiB:.3g} GiB" if count >= GiB else f"{count / MiB:.3g} MiB"


def crash_problem(ended: Ended) -> Problem:
    if ended.signal is not None:
        name = signal_name(ended.signal)
        return Problem("renderer-crashed", f"The render process was ended by {name}.", signal=name)
    return Problem(
        "renderer-crashed", f"The render process exited unexpectedly with code {ended.exit_code}.", exit_code=ended.exit_code
    )


def signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def was_killed(ended: Ended) -> bool:
    """Return whether the process was killed by others, neither by its own fault nor by us."""
    return ended.reason in ("killed", "lost") or (ended.reason == "signal" and ended.signal in _FROM_OUTSIDE)
