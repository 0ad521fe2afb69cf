"""Jobs and frames, their states, and the legal moves between them. Pure: time and ids are arguments.

    queued -> preparing -> running -> succeeded | failed | canceled | expired         (canceling on the way to canceled)
                                   -> paused -> queued                                 (pausing on the way to paused)

Terminal states never change, except that `continue` starts a new attempt, and a retry renders one frame again: both queue the
job again.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

Json = dict[str, Any]


class JobState(StrEnum):
    QUEUED = "queued"
    PREPARING = "preparing"  # its scene is being checked, or opened and built by a worker
    RUNNING = "running"  # at least one frame has taken samples in this attempt
    CANCELING = "canceling"
    PAUSING = "pausing"  # its running frames write a checkpoint and free their workers
    PAUSED = "paused"  # no frame runs or starts
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"
    EXPIRED = "expired"  # not finished before its time to live ended


class FrameState(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


_J, _F = JobState, FrameState
TERMINAL = frozenset({_J.SUCCEEDED, _J.FAILED, _J.CANCELED, _J.EXPIRED})
FRAME_TERMINAL = frozenset({_F.SUCCEEDED, _F.FAILED, _F.CANCELED})

# A dead dispatcher or a preempted frame takes a job back to queued. Terminal states are left by `continue`.
MOVES: Mapping[JobState, frozenset[JobState]] = {
    _J.QUEUED: frozenset({_J.PREPARING, _J.FAILED, _J.CANCELED, _J.EXPIRED, _J.PAUSED}),
    _J.PREPARING: frozenset(
        {_J.RUNNING, _J.QUEUED, _J.SUCCEEDED, _J.FAILED, _J.CANCELING, _J.CANCELED, _J.EXPIRED, _J.PAUSING, _J.PAUSED}
    ),
    _J.RUNNING: frozenset({_J.QUEUED, _J.SUCCEEDED, _J.FAILED, _J.CANCELING, _J.CANCELED, _J.EXPIRED, _J.PAUSING, _J.PAUSED}),
    _J.PAUSING: frozenset(
        {_J.PAUSED, _J.PREPARING, _J.RUNNING, _J.SUCCEEDED, _J.FAILED, _J.CANCELING, _J.CANCELED, _J.EXPIRED}
    ),
    _J.PAUSED: frozenset({_J.QUEUED, _J.FAILED, _J.CANCELED, _J.EXPIRED}),
    _J.CANCELING: frozenset({_J.CANCELED}),
    _J.SUCCEEDED: frozenset({_J.QUEUED}),
    _J.FAILED: frozenset({_J.QUEUED}),
    _J.CANCELED: frozenset({_J.QUEUED}),
    _J.EXPIRED: frozenset({_J.QUEUED}),
}


@dataclass(frozen=True)
class Frame:
    """One frame of a job: its state, and the checkpoint from which it resumes."""

    job_id: str
    number: int  # 0-based index in the job's list of frames
    time_code: float | None  # None: the stage's default time
    state: FrameState = FrameState.QUEUED
    attempt: int = 1
    # Checkpoints merged so far in all attempts, and the file of the last one (a name in the job's folder; "" for none).
    checkpoint: int = 0
    checkpoint_file: str = ""
    # The checkpoint holds exactly the first `merged` samples of each pixel, merged from parts; 0: it is another kind of
    # checkpoint.
    merged: int = 0
    # Deaths of its worker since the last checkpoint: by its own fault (SIGSEGV, SIGABRT, ...), and by others (SIGKILL).
    crashes: int = 0
    kills: int = 0
    phase: str = ""  # opening, translating, building, sampling, writing
    progress: Json = field(default_factory=dict)
    effective_settings: Json | None = None
    convergence: list[Json] = field(default_factory=list)
    result: Json | None = None
    error: Json | None = None
    cpu_s: float = 0.0
    peak_rss_bytes: int = 0
    started_at: float | None = None
    finished_at: float | None = None


class PartState(StrEnum):
    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"  # all of its samples are in its checkpoint, which waits to be merged


@dataclass(frozen=True)
class Part:
    """Part of a frame: the samples [first, end) of each pixel, rendered by one worker; `claim` is the chunk that has it."""

    job_id: str
    frame: int
    first: int
    end: int
    state: PartState = PartState.WAITING
    claim: str = ""
    checkpoint: int = 0
    checkpoint_file: str = ""
    crashes: int = 0
    kills: int = 0

    @property
    def samples(self) -> int:
        return self.end - self.first


@dataclass(frozen=True)
class Job:
    """A job's row. Times are seconds since 1970 UTC.

    There are two counters: `revision` grows with every commit that changes anything of the job (progress, a frame, an event),
    `version` only when its state, attempt, priority, name, labels or ttl_s change. `etag` holds both. A client's copy is stale
    when the whole tag differs (If-None-Match, 304); a change is refused only when `version` differs (If-Match, 412): otherwise
    a render that makes progress twice a second would never let anybody change its priority.
    """

    id: str
    tenant: str
    state: JobState
    scene_id: str  # "sha256:..."
    entry: str | None
    settings: Json  # as requested: models.Settings
    created_at: float
    queued_at: float
    expires_at: float
    ttl_s: float
    attempt: int = 1
    version: int = 1
    revision: int = 1
    priority: int = 50  # higher goes first
    labels: Mapping[str, str] = field(default_factory=dict)
    webhook: Json | None = None
    started_at: float | None = None
    finished_at: float | None = None
    effective_settings: Json | None = None
    progress: Json = field(default_factory=dict)
    result: Json | None = None
    warnings: list[Json] = field(default_factory=list)
    error: Json | None = None
    usage: Json = field(default_factory=dict)
    request_id: str = ""
    traceparent: str = ""
    name: str | None = None  # None: created before jobs had names
    parallel: int | str | None = None  # most slots in which a frame is rendered at a time; "auto": all; None: one


@dataclass(frozen=True)
class Event:
    """A row of a job's history; `type` is state, progress, preview, frame, warning or end."""

    id: int  # increases over all jobs
    job_id: str
    type: str
    created_at: float
    data: Json


@dataclass(frozen=True)
class Output:
    """An output file of a job; `file` is its name in the job's outputs folder, and in URLs."""

    job_id: str
    name: str
    frame: int | None
    bytes: int
    sha256: str
    media_type: str
    created_at: float


class SceneState(StrEnum):
    CHECKING = "checking"
    READY = "ready"
    REJECTED = "rejected"


@dataclass(frozen=True)
class Scene:
    """A tenant's uploaded scene; the data directory holds equal uploads of several tenants once."""

    id: str  # "sha256:<hex>" of the body as sent
    tenant: str
    state: SceneState
    kind: str  # usda, usdc, usdz, zip
    name: str  # the file name that the client gave, or ""
    bytes: int  # as sent
    stored_bytes: int  # unpacked
    created_at: float
    used_at: float
    facts: Json = field(default_factory=dict)  # results of the check: entries, files, cameras, frame range, ...
    warnings: list[Json] = field(default_factory=list)
    problem: Json | None = None


def is_legal(state: JobState, to: JobState) -> bool:
    return to in MOVES[state]


class IllegalMove(Exception):
    """A move between states that is not legal: an internal error, never the request's fault."""


def etag(job: Job) -> str:
    """Return a strong entity tag of the job's JSON."""
    return f'"{job.version}.{job.revision}"'


def version_in(tag: str) -> int | None:
    """Return the version in one of our entity tags, for If-Match; None for a foreign tag."""
    found = re.fullmatch(r'"([0-9]{1,15})\.[0-9]{1,15}"', tag, re.ASCII)
    return int(found[1]) if found else None


def state_of_all(frame_states: Iterable[FrameState]) -> JobState | None:
    """Return the terminal state that follows from the states of a job's frames, or None while some have not ended."""
    states = set(frame_states)
    if states - FRAME_TERMINAL:
        return None
    if FrameState.CANCELED in states:
        return JobState.CANCELED
    return JobState.FAILED if FrameState.FAILED in states else JobState.SUCCEEDED
