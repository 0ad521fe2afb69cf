"""Documents of the API as dataclasses; schemas/openapi.json describes each member."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Hashable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from typing import Any, Literal, TypedDict, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from .errors import UnexpectedAnswer
from .settings import Settings as Settings
from .settings import StopRules as StopRules

T = TypeVar("T")


REST = {"rest": True}


def read(kind: type[T], document: Any, where: str = "") -> T:
    """Return a `kind`; UnexpectedAnswer names the member that does not fit."""
    place = where or kind.__name__
    if not isinstance(document, Mapping):
        raise UnexpectedAnswer(f"{place} is not a JSON object")
    hints = _hints(cast(Hashable, kind))
    values: dict[str, Any] = {}
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    for one in fields:
        name = one.name
        if one.metadata.get("rest"):
            values[name] = {other: document[other] for other in document if all(other != each.name for each in fields)}
        elif name in document:
            values[name] = _value(hints[name], document[name], f"{place}.{name}")
        elif one.default is dataclasses.MISSING and one.default_factory is dataclasses.MISSING:
            raise UnexpectedAnswer(f"{place} has no {name}")
    return kind(**values)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _value(hint: Any, value: Any, where: str) -> Any:
    if hint is Any:
        return value
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        *others, last = (argument for argument in arguments if argument is not type(None))
        for other in others:
            with suppress(UnexpectedAnswer):
                return _value(other, value, where)
        return _value(last, value, where)
    if dataclasses.is_dataclass(hint):
        return read(hint, value, where)  # type: ignore[arg-type]
    if origin is list and isinstance(value, list):
        return [_value(arguments[0], item, f"{where}[{place}]") for place, item in enumerate(value)]
    if origin is tuple and isinstance(value, list) and len(value) == len(arguments):
        return tuple(_value(inner, item, where) for inner, item in zip(arguments, value, strict=True))
    if origin is dict and isinstance(value, dict):
        return {str(name): _value(arguments[1], inner, f"{where}.{name}") for name, inner in value.items()}
    if hint is datetime and isinstance(value, str):
        return _time(value, where)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(hint, type) and origin is None and isinstance(value, hint) and (hint is bool or not isinstance(value, bool)):
        return value
    raise UnexpectedAnswer(f"{where} is not what this client expects ({getattr(hint, '__name__', hint)})")


def _time(text: str, where: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise UnexpectedAnswer(f"{where} is not a time") from None


Json = dict[str, Any]

TERMINAL = frozenset({"succeeded", "failed", "canceled", "expired"})


class QuotaChanges(TypedDict, total=False):
    requests_per_s: float | None
    burst: int
    queued_jobs: int | None
    running_jobs: int | None
    stored_bytes: int | None
    cpu_s_per_day: float | None


class Webhook(TypedDict, total=False):
    url: str
    events: list[Literal["started", "frame.completed", "completed"]]
    secret: str | None


@dataclass(frozen=True)
class Scene:
    """Scene on the server; `facts` holds what its check found: cameras, frame range, files, ..."""

    id: str
    state: str  # checking, ready, rejected
    kind: str = ""
    name: str = ""
    bytes: int = 0
    warnings: list[Json] = field(default_factory=list)
    problem: Json | None = None
    facts: Json = field(default_factory=dict, metadata=REST)


@dataclass(frozen=True)
class ErrorOfNow:
    metric: str
    estimate: float | None = None
    ci95: tuple[float, float] | None = None
    target: float | None = None
    kind: str = "estimated"


@dataclass(frozen=True)
class FrameCounts:
    total: int = 0
    queued: int = 0
    running: int = 0
    succeeded: int = 0
    failed: int = 0
    canceled: int = 0


@dataclass(frozen=True)
class Progress:
    fraction: float = 0.0
    phase: str | None = None
    frames: FrameCounts | None = None
    samples_done: float | None = None
    samples_min: float | None = None
    samples_max: float | None = None
    rays: float | None = None
    rays_per_s: float | None = None
    error: ErrorOfNow | None = None
    elapsed_s: float | None = None
    eta_s: float | None = None
    eta_ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class QueuePlace:
    """Position of a queued job; None: not known yet."""

    place: int | None = None
    waiting: int = 0
    frames_ahead: int | None = None
    estimated_start_s: float | None = None


@dataclass(frozen=True)
class SceneOfJob:
    id: str
    entry: str | None = None


@dataclass(frozen=True)
class Job:
    id: str
    state: str  # queued, preparing, running, pausing, paused, canceling, succeeded, failed, canceled, expired
    created_at: datetime
    scene: SceneOfJob
    name: str | None = None  # None: from a server or a time before jobs had names
    parallel: int | str | None = None  # most slots in which a frame is rendered at a time; "auto": all; None: one
    attempt: int = 1
    priority: int = 50
    queued_at: datetime | None = None
    started_at: datetime | None = None
    finished_at: datetime | None = None
    expires_at: datetime | None = None
    labels: dict[str, str] = field(default_factory=dict)
    settings: Json = field(default_factory=dict)
    effective_settings: Json | None = None
    queue: QueuePlace | None = None
    progress: Progress = Progress()
    result: Json | None = None
    warnings: list[Json] = field(default_factory=list)
    error: Json | None = None
    usage: Json = field(default_factory=dict)
    webhook: Json | None = None
    tenant: str = ""  # only in answers to an administrator

    @property
    def is_terminal(self) -> bool:
        return self.state in TERMINAL


@dataclass(frozen=True)
class Frame:
    number: int
    state: str  # queued, running, succeeded, failed, canceled
    time_code: float | None = None
    attempt: int = 1
    phase: str | None = None
    progress: Json = field(default_factory=dict)
    result: Json | None = None
    error: Json | None = None
    started_at: datetime | None = None
    finished_at: datetime | None = None


@dataclass(frozen=True)
class Output:
    name: str
    bytes: int
    sha256: str
    media_type: str = "application/octet-stream"
    frame: int | None = None


@dataclass(frozen=True)
class Convergence:
    """Row of a frame's convergence curve: `t_s` seconds of sampling, and the error after that many samples per pixel."""

    frame: int
    t_s: float | None = None
    samples: float | None = None
    relmse: float | None = None
    rmse: float | None = None
    ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class Event:
    """`type` is state, progress, preview, frame, warning or end; `id` grows over a job's events."""

    id: int
    type: str
    data: Json = field(default_factory=dict)


@dataclass(frozen=True)
class Share:
    """Use of a quota; `limit` None: unlimited."""

    used: float
    limit: float | None = None


@dataclass(frozen=True)
class Usage:
    tenant: str
    queued_jobs: Share
    running_jobs: Share
    stored_bytes: Share
    cpu_s_per_day: Share
    cpu_s_total: float


@dataclass(frozen=True)
class TenantUsage(Usage):
    """Usage as an administrator sees it; `quotas_set`: members of `quotas` that an administrator has set."""

    quotas: Json = field(default_factory=dict)
    quotas_set: Json = field(default_factory=dict)


@dataclass(frozen=True)
class WorkerNode:
    """Node that runs renders; `why` it takes no work, empty if it does."""

    id: str
    slots: int = 0
    why: str = ""


@dataclass(frozen=True)
class RunningFrame:
    job: str
    tenant: str
    frame: int
    name: str | None = None
    priority: int = 50
    state: str = "running"
    time_code: float | None = None
    phase: str = ""
    fraction: float = 0.0
    started_at: datetime | None = None
    cpu_s: float = 0.0


@dataclass(frozen=True)
class Workers:
    dispatcher: str  # "here", "elsewhere" or "nowhere": the server that dispatches
    slots: int
    cores: int = 0
    memory_bytes: int = 0
    nodes: list[WorkerNode] = field(default_factory=list)
    running: list[RunningFrame] = field(default_factory=list)


@dataclass(frozen=True)
class Key:
    """API key; `key` is set only in the answer to the request that created it."""

    id: str
    tenant: str
    prefix: str
    name: str = ""
    scopes: list[str] = field(default_factory=list)
    created_at: datetime | None = None
    expires_at: datetime | None = None
    revoked_at: datetime | None = None
    key: str | None = None
