"""Answers of the API as pydantic models, for the OpenAPI document and for tests; job_json.py makes the JSON."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..jobs import FrameState, JobState
from .models import SceneReference, Settings


class View(BaseModel):
    """Base of answers: the listed members are always present; more may be added."""

    model_config = ConfigDict(extra="allow")


class Problem(View):
    """A problem document (RFC 9457). `type` is stable, and the path of a page that explains it."""

    type: str = Field(pattern="^/problems/[a-z-]+$")
    title: str
    status: int = Field(ge=400, le=599)
    detail: str
    retryable: bool = Field(description="Whether the same request may succeed later.")
    request_id: str | None = Field(None, description="The request's X-Request-Id, also in the server's log.")
    member: str | None = Field(None, description="The member or parameter at fault.")


class Warning(View):
    code: str = Field(description="A stable code; docs/fidelity.md lists the renderer's.")
    prim: str | None = None
    detail: str
    severity: Literal["error", "warning", "info"] | None = None
    kind: Literal["missing", "ignored", "approximated", "out-of-range", "defaulted", "chosen", "note"] | None = Field(
        None, description="How the picture deviates from the scene."
    )
    attribute: str | None = Field(None, description="The attribute or relationship concerned; empty: the whole prim.")


class FrameCounts(View):
    total: int
    queued: int
    running: int
    succeeded: int
    failed: int
    canceled: int


class ErrorOfNow(View):
    metric: Literal["relmse", "rmse", "display"]
    estimate: float | None
    ci95: tuple[float, float] | None = None
    target: float | None = None
    kind: Literal["estimated", "measured"] = Field(
        description="Estimated from the samples' variance, or measured against a reference."
    )


class Progress(View):
    """Progress of the whole job. Members appear as they become known."""

    fraction: float = Field(ge=0, le=1, description="Fraction done; never decreases within an attempt.")
    phase: str | None = None
    frames: FrameCounts | None = None
    samples_done: float | None = Field(None, description="Samples per pixel, on average.")
    samples_min: float | None = None
    samples_max: float | None = None
    pass_: int | None = Field(
        None, alias="pass", description="Passes over the picture so far; a preview's ETag begins with it."
    )
    rays: float | None = None
    rays_per_s: float | None = None
    error: ErrorOfNow | None = None
    elapsed_s: float | None = None
    eta_s: float | None = None
    eta_ci95: tuple[float, float] | None = None
    updated_at: datetime | None = None


class QueuePlace(View):
    """Position of a queued job. null: not known yet."""

    place: int | None = Field(ge=1, description="Position, by priority, fair share and age; 1: the next to begin.")
    waiting: int = Field(ge=0, description="Number of queued jobs, including this one.")
    frames_ahead: int | None = Field(ge=0, description="Frames that run now, or will run before its first.")
    estimated_start_s: float | None = Field(
        ge=0, description="Estimated seconds until it begins, from running frames and the durations of frames like those ahead."
    )


class JobUrls(View):
    """Paths on the same server."""

    self: str
    cancel: str
    pause: str
    resume: str
    continue_: str = Field(alias="continue")
    events: str
    frames: str
    convergence: str
    preview: str
    outputs: str
    log: str
    scene: str


class WebhookOfJob(View):
    url: str
    events: list[Literal["started", "frame.completed", "completed"]]
    secret: str | None = Field(None, description="Only in the answer that created the job.")


class Job(View):
    id: str = Field(pattern="^job_[0-9A-HJKMNP-TV-Z]{26}$")
    object: Literal["job"]
    name: str | None = Field(description="As given, or made from the scene; null: created before jobs had names.")
    state: JobState
    attempt: int = Field(ge=1, description="Increased by `continue`.")
    parallel: int | Literal["auto"] | None = Field(description="Most slots in which each frame is rendered; null: one.")
    priority: int
    created_at: datetime
    queued_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    expires_at: datetime
    ttl_s: float
    scene: SceneReference
    labels: dict[str, str]
    settings: Settings = Field(description="As requested.")
    effective_settings: dict[str, Any] | None = Field(description="Settings after resolving scene and request.")
    queue: QueuePlace | None = Field(description="Its position while it is queued.")
    progress: Progress
    result: dict[str, Any] | None
    warnings: list[Warning]
    error: Problem | None
    usage: dict[str, Any]
    urls: JobUrls
    webhook: WebhookOfJob | None


class JobPage(View):
    items: list[Job]
    next_cursor: str | None


class FrameUsage(View):
    cpu_s: float
    peak_rss_bytes: int


class Frame(View):
    number: int = Field(ge=0, description="Index among the job's frames, from 0.")
    time_code: float | None = Field(description="null: the stage's default time.")
    state: FrameState
    attempt: int
    phase: str
    checkpoint: int = Field(description="Checkpoints merged so far.")
    progress: dict[str, Any]
    effective_settings: dict[str, Any] | None
    result: dict[str, Any] | None
    error: Problem | None
    usage: FrameUsage
    started_at: datetime | None
    finished_at: datetime | None


class FramePage(View):
    items: list[Frame]
    next_cursor: str | None


class Event(View):
    id: int = Field(description="Increases from event to event, not always by one.")
    type: Literal["state", "progress", "preview", "frame", "warning", "end"]
    created_at: datetime
    data: dict[str, Any]


class EventPage(View):
    items: list[Event]
    next_after: int = Field(description="Value of ?after= for the next page.")
    ended: bool = Field(description="Whether no more events will follow, unless the job is continued.")


class ConvergenceRow(View):
    """A row of a convergence curve."""

    frame: int
    t_s: float | None = Field(None, description="Seconds of sampling.")
    samples: float | None = Field(None, description="Samples per pixel, on average.")
    relmse: float | None = None
    rmse: float | None = None
    ci95: tuple[float, float] | None = Field(None, description="95 % confidence interval of relmse.")


class Session(View):
    tenant: str
    scopes: list[Literal["submit", "read", "admin"]]
    expires_at: datetime
