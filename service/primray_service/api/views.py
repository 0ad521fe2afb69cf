"""Answers of the API as pydantic models, for the OpenAPI document and for tests; job_json.py makes the JSON."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..jobs import FrameState, JobState, SceneState
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


Color = tuple[float, float, float]


class PixelPart(View):
    """A part of a pixel's light. The parts of a split add up to the pixel."""

    name: str
    value: Color = Field(description="R, G and B.")
    error: Color | None = Field(description="Standard errors.")
    ci95: tuple[Color, Color] | None = Field(description="95 % confidence interval; null: too few of its paths were found.")
    share: float = Field(description="Share of the pixel's luminance.")
    share_error: float | None
    rare: bool = Field(description="Whether its paths are so rare that its error is hardly known.")
    expression: str | None = Field(None, description="Light path expression of this light.")


class PixelSplits(View):
    light: list[PixelPart]
    kind: list[PixelPart]
    bounce: list[PixelPart]
    prim: list[PixelPart] = Field(description="By the prim that sends the light to what the pixel shows.")


class LeftOut(View):
    """Parts of each split that are left out, the smallest."""

    light: int
    kind: int
    bounce: int
    prim: int


class NoisePath(View):
    """A path from the camera to a light that makes some of a pixel's noise."""

    light: str
    prims: list[str]
    share: float = Field(description="Share of the pixel's noise.")
    random: bool = Field(description="Whether it was drawn at random, not for its share.")
    words: str
    adds: Color
    points: list[Color] = Field(description="In the world, from the camera on.")


class ShownByPixel(View):
    prim: str
    instance: str
    material: str
    distance: float
    position: Color


class ExplainedPixel(View):
    """What a pixel's light is made of, as `primray explain --json` prints it."""

    type: Literal["explained-pixel"]
    pixel: tuple[int, int] = Field(description="Column and row in the whole frame.")
    camera: str
    value: Color = Field(description="R, G and B, before a background or a denoiser.")
    error: Color | None
    alpha: float
    samples: int
    renders: int = Field(description="Renders with other seeds, from which the errors come.")
    shown: ShownByPixel | None = Field(description="What the middle of the pixel shows; null: no surface.")
    splits: PixelSplits
    more: LeftOut
    noise: list[NoisePath] = Field(description="The paths that make the noise, the largest share first.")


class Session(View):
    tenant: str
    scopes: list[Literal["submit", "read", "admin"]]
    expires_at: datetime


Scope = Literal["submit", "read", "admin"]


class KeyQuotas(View):
    """Quotas of a key; null: no limit."""

    requests_per_s: float | None
    burst: int
    queued_jobs: int | None
    running_jobs: int | None
    stored_bytes: int | None
    cpu_s_per_day: float | None


class Key(View):
    id: str
    object: Literal["key"]
    tenant: str
    name: str
    prefix: str = Field(description="First characters of the key, to recognise it by.")
    scopes: list[Scope]
    quotas: KeyQuotas
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None


class NewKey(Key):
    key: str = Field(description="The key itself, which only this answer contains.")


class KeyList(View):
    items: list[Key]


class WhoAmI(View):
    tenant: str
    name: str
    scopes: list[Scope]
    key: Key | None
    session: bool = Field(description="Whether the caller used a session cookie instead of a key.")


class Count(View):
    used: int
    limit: int | None


class Seconds(View):
    used: float
    limit: float | None


class Rate(View):
    limit: float | None
    burst: int


class Usage(View):
    tenant: str
    queued_jobs: Count
    running_jobs: Count
    stored_bytes: Count
    cpu_s_per_day: Seconds
    cpu_s_total: float
    requests_per_s: Rate


class InputKind(View):
    kind: str
    media_type: str
    suffixes: list[str]


class OutputKind(View):
    name: str
    media_type: str


class Previews(View):
    views: list[str]
    formats: dict[str, str]


class AovName(View):
    name: str = Field(description="Name for settings.aovs.")
    meaning: str


class ExecutorOfServer(View):
    slots: int
    cores: int
    threads: int
    memory_bytes: int
    nodes: int


class Capabilities(View):
    version: str
    api: str
    inputs: list[InputKind]
    outputs: list[OutputKind]
    previews: Previews
    error_metrics: list[str]
    aovs: list[AovName] = Field(description="AOVs of any scene; primvar:NAME and labels:TAXONOMY depend on the scene.")
    limits: dict[str, Any]
    quotas: KeyQuotas
    executor: ExecutorOfServer
    sandbox: dict[str, Any]
    shared_roots: list[str] = Field(description="Names of shared storage whose stages this tenant's jobs may name.")


class SceneUrls(View):
    self: str


class Scene(View):
    """A scene. Once the state is ready, further members have the results of the check."""

    id: str = Field(
        pattern="^sha256:[0-9a-f]{64}$", description="Digest of the bytes as sent, or of the package's list of files."
    )
    object: Literal["scene"]
    state: SceneState
    kind: Literal["usda", "usdc", "usdz", "zip", "shared"]
    name: str
    bytes: int
    stored_bytes: int
    created_at: datetime
    warnings: list[Warning]
    problem: Problem | None = Field(description="Why it was rejected.")
    urls: SceneUrls


class Package(View):
    """Files of a package that have to be sent."""

    id: str = Field(pattern="^sha256:[0-9a-f]{64}$", description="The scene's future id.")
    missing: list[str] = Field(description="SHA-256s of files that this tenant has not sent.")
    missing_bytes: int


class ScenePage(View):
    items: list[Scene]
    next_cursor: str | None


class OutputUrls(View):
    self: str
    immutable: str = Field(description="Address of exactly this version, which may be cached for ever.")


class Output(View):
    name: str
    frame: int | None
    bytes: int
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    media_type: str
    created_at: datetime
    urls: OutputUrls


class OutputList(View):
    items: list[Output]


class Health(View):
    status: Literal["ok"]


class Readiness(View):
    status: Literal["ready", "not ready", "stopping"]
    checks: dict[str, dict[str, Any]] = Field(
        description="Results for database, disk, executor and sandbox: ok, detail, seconds."
    )


class AdminJob(Job):
    tenant: str = Field(description="The job's tenant.")


class AdminJobPage(View):
    items: list[AdminJob]
    next_cursor: str | None


class AdminFramePage(View):
    items: list[Frame]
    next_after: int | None = Field(description="Value of ?after= for the next page.")


class Tenant(Usage):
    quotas: KeyQuotas = Field(description="Effective quotas.")
    quotas_set: dict[str, Any] = Field(description="Quotas that an administrator has set.")


class TenantPage(View):
    items: list[Tenant]
    next_after: str | None = Field(description="Value of ?after= for the next page.")


class WorkerNode(View):
    id: str
    slots: int = Field(description="Number of concurrent renders.")
    why: str = Field(description="Why the node takes no work; empty if it does.")


class RunningFrame(View):
    job: str
    name: str | None
    tenant: str
    priority: int
    state: JobState
    frame: int
    time_code: float | None
    phase: str
    fraction: float
    parts: int | Literal["auto"] | None = Field(description="Most slots in which it is rendered; null: one.")
    started_at: datetime | None
    cpu_s: float


class Workers(View):
    dispatcher: Literal["here", "elsewhere", "nowhere"] = Field(
        description="The server that dispatches: this one, another, or none."
    )
    slots: int
    cores: int
    memory_bytes: int = Field(description="Memory limit of one render.")
    nodes: list[WorkerNode]
    running: list[RunningFrame]
