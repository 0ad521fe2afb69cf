"""What clients get: the answers' JSON as pydantic models, for the OpenAPI document and for tests; job_json.py makes it."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..jobs import FrameState, JobState
from .models import SceneReference, Settings


class View(BaseModel):
    """Members that are always there; more may come."""

    model_config = ConfigDict(extra="allow")


class Problem(View):
    """RFC 9457. `type` is stable, and the path of a page that explains it."""

    type: str = Field(pattern="^/problems/[a-z-]+$")
    title: str
    status: int = Field(ge=400, le=599)
    detail: str
    retryable: bool = Field(description="Whether the same request may succeed later.")
    request_id: str | None = Field(None, description="As in X-Request-Id and in the server's log.")
    member: str | None = Field(None, description="The member or parameter at fault.")


class Warning(View):
    code: str = Field(description="Stable; docs/fidelity.md lists the renderer's.")
    prim: str | None = None
    detail: str
    severity: Literal["error", "warning", "info"] | None = None
    kind: Literal["missing", "ignored", "approximated", "out-of-range", "defaulted", "chosen", "note"] | None = Field(
        None, description="In what way the picture keeps to what the scene says."
    )
    attribute: str | None = Field(None, description="The attribute or relationship in question; empty: the prim as a whole.")


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
    kind: Literal["estimated", "measured"] = Field(description="By the samples' variance, or against a reference.")


class Progress(View):
    """Of the whole job. Members appear as they become known."""

    fraction: float = Field(ge=0, le=1, description="Never falls within an attempt.")
    phase: str | None = None
    frames: FrameCounts | None = None
    samples_done: float | None = Field(None, description="A pixel, on average.")
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
    """Of a job that is not begun. null: not known yet."""

    place: int | None = Field(ge=1, description="1: the next to begin, by priority, fair share and age.")
    waiting: int = Field(ge=0, description="Jobs that wait for their turn, this one with them.")
    frames_ahead: int | None = Field(ge=0, description="That run, or will, before its first.")
    estimated_start_s: float | None = Field(
        ge=0, description="Seconds until it begins, by what runs and by how long frames took that were like those ahead."
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
    secret: str | None = Field(None, description="Only in the answer that made the job.")


class Job(View):
    id: str = Field(pattern="^job_[0-9A-HJKMNP-TV-Z]{26}$")
    object: Literal["job"]
    name: str | None = Field(description="As given, or the scene's, its camera and frames; null: of before jobs had names.")
    state: JobState
    attempt: int = Field(ge=1, description="Grows when the job goes on by `continue`.")
    parallel: int | Literal["auto"] | None = Field(description="The most places that each frame is rendered in; null: one.")
    priority: int
    created_at: datetime
    queued_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    expires_at: datetime
    ttl_s: float
    scene: SceneReference
    labels: dict[str, str]
    settings: Settings = Field(description="As asked.")
    effective_settings: dict[str, Any] | None = Field(description="What scene and request resolved to.")
    queue: QueuePlace | None = Field(description="Its place, while it waits for its turn.")
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
    number: int = Field(ge=0, description="Its place among the job's frames, from 0.")
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
    id: int = Field(description="Grows from event to event, not by one.")
    type: Literal["state", "progress", "preview", "frame", "warning", "end"]
    created_at: datetime
    data: dict[str, Any]


class EventPage(View):
    items: list[Event]
    next_after: int = Field(description="For ?after= of the page that comes next.")
    ended: bool = Field(description="Whether nothing will come after these unless the job goes on by `continue`.")


class ConvergenceRow(View):
    """What was known after some samples."""

    frame: int
    t_s: float | None = Field(None, description="Seconds of sampling.")
    samples: float | None = Field(None, description="A pixel, on average.")
    relmse: float | None = None
    rmse: float | None = None
    ci95: tuple[float, float] | None = Field(None, description="Of relmse.")


class Session(View):
    tenant: str
    scopes: list[Literal["submit", "read", "admin"]]
    expires_at: datetime
