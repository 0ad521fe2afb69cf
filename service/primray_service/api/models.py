"""Requests of the API as pydantic models, from which the OpenAPI document is made.

The members of settings are those of the rows of RenderSettings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

from primray.settings import RenderSettings, rows
from primray.settings.forms import form_of
from primray.settings.setting import Member, Row, as_json, choice

Fraction = Annotated[float, Field(ge=0, le=1)]
Name = Annotated[str, Field(min_length=1, max_length=255, pattern=r"^[^\x00-\x1f\x7f]+$")]


Parallel = Annotated[int, Field(ge=1, le=1024)] | Literal["auto"]
OF_PARALLEL = "Most slots in which each frame is rendered at a time, as parts (ranges of its samples); auto: all slots."


class Sent(BaseModel):
    """Base of requests: unknown members are refused, not ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)


class SceneReference(Sent):
    id: str = Field(pattern=r"^sha256:[0-9a-f]{64}$", description="The id in the answer to POST /v1/scenes.")
    entry: str | None = Field(None, max_length=1024, description="Root layer to render, if the package has several.")


class SceneOfRequest(Sent):
    """An uploaded scene by its `id`, or a stage on the service's shared storage."""

    id: str | None = Field(None, pattern=r"^sha256:[0-9a-f]{64}$", description="The id in the answer to POST /v1/scenes.")
    shared: str | None = Field(
        None, max_length=4096, description="NAME/path.usda: a stage in the shared root NAME, instead of `id`."
    )
    entry: str | None = Field(None, max_length=1024, description="Root layer to render, if the package has several.")


class FileSettings(Sent):
    """Display transform and storage of the job's files."""

    view: str | None = Field(None, max_length=256, description="OCIO view of PNG, JPEG and TIFF; null: the display's default.")
    display: str | None = Field(None, max_length=256, description="OCIO display; null: the configuration's default.")
    look: str | None = Field(None, max_length=256, description="OCIO look that replaces the view's.")
    exposure: Annotated[float, Field(ge=-30, le=30)] | Literal["auto"] | None = Field(
        None,
        description="Exposure in stops, of PNG, JPEG and TIFF; auto: chosen for the view, for each frame; null: the product's.",
    )
    half: list[Annotated[str, Field(max_length=280)]] = Field(
        default=[],
        max_length=64,
        description="Channels, layers or parts of the EXR stored as half floats (R, stderr, rgba), or all, or none.",
    )
    compression: str | None = Field(
        None, max_length=32, description="EXR compression, NAME or NAME:LEVEL, such as dwaa:45; null: the product's, else zip."
    )


def members_of(place: str, of: type = RenderSettings) -> dict[str, tuple[Any, Any]]:
    """Return the members that settings have at a place, "" or "stop", each with its type and its field, by name."""
    members = [(row, row.member, (row.member.name or row.name).rpartition(".")) for row in rows(of) if row.member is not None]
    return {name: _member(row, member) for row, member, (at, _, name) in members if at == place and member.is_derived}


def _member(row: Row, member: Member) -> tuple[Any, Any]:
    at_least, at_most = member.items
    bounds: dict[str, Any] = {"max_length": at_most or member.chars, "min_length": at_least or None, **member.bounds}
    form: Any = form_of(row)
    if isinstance(row.read, choice):
        form = Literal[tuple(kind.value for kind in form)]
    elif form == list[str]:
        form = list[Literal[member.choices] if member.choices else Annotated[str, Field(max_length=member.chars)]]  # type: ignore[misc]
    is_null = row.default is None or member.is_open
    default = None if is_null else as_json(row.default)
    return form | None if is_null else form, Field(default, description=member.help or None, **bounds)


def _in_order(members: Mapping[str, tuple[Any, Any]], first: Sequence[str]) -> dict[str, tuple[Any, Any]]:
    return {name: members[name] for name in (*first, *(name for name in members if name not in first))}


# The order in which the API's document lists the members that it has had for long; others follow them.
_STOP_ORDER = ("target_error", "metric", "max_samples", "max_seconds")
_ORDER = (
    *("camera", "auto_camera", "render_settings", "render_pass", "products", "aovs", "aov_errors", "frames", "resolution"),
    *("stop", "seed", "max_depth", "clamp_indirect", "caustics", "adaptive", "filter", "filter_width", "default_light"),
    *("studio_light", "ground", "dome", "dome_rotation", "dome_visible", "background", "default_wrap", "denoise", "stop_at"),
    *("render_context", "translated_shaders", "purposes", "strict", "fail_on", "allow", "dicing_rate", "motion_blur"),
    *("shutter", "motion_error", "diffusion", "diffusion_glare", "diffusion_bloom_width", "diffusion_starburst"),
    *("diffusion_starburst_width", "eye", "lens_flaws", "region", "variants", "load", "mask"),
)


if TYPE_CHECKING:

    class _Members(Sent):
        def __init__(self, **members: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

    class StopRules(_Members): ...

    class Settings(_Members, FileSettings):
        def __init__(self, **members: Any) -> None: ...

else:
    StopRules = create_model(
        "StopRules",
        __base__=Sent,
        __module__=__name__,
        __doc__="Stop rules: a frame ends when the first one is reached. Without any, the stage's render settings decide, "
        "else 64 samples\nper pixel; parallel jobs always use the latter.",
        **_in_order(members_of("stop"), _STOP_ORDER),
    )
    _OTHERS = {
        "products": (
            list[Annotated[str, Field(max_length=256)]],
            Field(
                default=["beauty"],
                min_length=1,
                max_length=64,
                description='["beauty"]: the first product of the render settings; ["*"]: all of them, each in a file '
                "named after it; or paths of RenderProducts, or unique names; several products are written to files named "
                "after them.",
            ),
        ),
        "frames": (
            str | None,
            Field(
                None, max_length=4096, description='Frames: "1", "1:10", "1-10x2", "1-10:2" or "1,5"; null: the default time.'
            ),
        ),
        "stop": (StopRules, StopRules()),
    }
    Settings = create_model(
        "Settings",
        __base__=FileSettings,
        __module__=__name__,
        __doc__="Render settings, with the meanings of the library's RenderSettings and the flags of `primray render`.",
        **_in_order(members_of("") | _OTHERS, _ORDER),
    )


class Webhook(Sent):
    url: str = Field(max_length=2048)
    events: list[Literal["started", "frame.completed", "completed"]] = Field(default=["completed"], min_length=1, max_length=3)
    secret: str | None = Field(
        None, pattern=r"^whsec_[A-Za-z0-9+/]{32,88}={0,2}$", description="Signing secret; null: one is made, and shown once."
    )


class JobRequest(Sent):
    scene: SceneOfRequest
    settings: Settings = Settings()
    name: Name | None = Field(None, description="Display name; null: made from the scene, its camera and frames.")
    parallel: Parallel | None = Field(None, description=OF_PARALLEL)
    priority: int = Field(50, ge=0, le=100, description="Higher goes first.")
    labels: dict[str, str] = Field(default={}, description="Labels to find jobs by.")
    ttl_s: float | None = Field(
        None,
        gt=0,
        description="Seconds to keep it after its end; if it has not ended this long after its creation, it expires.",
    )
    webhook: Webhook | None = None


class SceneOfForm(Sent):
    """Options of the form's file as a scene."""

    entry: str | None = Field(None, max_length=1024, description="Root layer to render, if the package has several.")


class FormJob(Sent):
    """A JobRequest for a file in the same form."""

    scene: SceneOfForm = SceneOfForm()
    settings: Settings = Settings()
    name: Name | None = Field(None, description="Display name; null: made from the scene, its camera and frames.")
    parallel: Parallel | None = Field(None, description=OF_PARALLEL)
    priority: int = Field(50, ge=0, le=100, description="Higher goes first.")
    labels: dict[str, str] = Field(default={}, description="Labels to find jobs by.")
    ttl_s: float | None = Field(None, gt=0, description="See JobRequest.")
    webhook: Webhook | None = None

    def with_scene(self, scene_id: str) -> JobRequest:
        return JobRequest(
            scene=SceneOfRequest(id=scene_id, entry=self.scene.entry),
            settings=self.settings,
            name=self.name,
            parallel=self.parallel,
            priority=self.priority,
            labels=self.labels,
            ttl_s=self.ttl_s,
            webhook=self.webhook,
        )


class JobPatch(Sent):
    """Changes of a job: omitted members stay as they are."""

    name: Name = Field("", description="Replaces the name.")
    priority: int = Field(50, ge=0, le=100)
    labels: dict[str, str] = Field(default={}, description="Replaces all labels.")
    ttl_s: float | None = Field(None, gt=0, description="null: this server's default.")


class ContinuedRules(Sent):
    """Stop rules of the next attempt: omitted members stay as they were; null removes one."""

    target_error: float | None = Field(None, gt=0)
    metric: Literal["relmse", "rmse", "display"] = "relmse"
    max_samples: int | None = Field(None, ge=1, description="Total, including those of earlier attempts.")
    max_seconds: float | None = Field(None, gt=0, description="Total, including those of earlier attempts.")


class ContinueRequest(Sent):
    """A succeeded job needs rules that go further; a canceled, failed or expired one may continue unchanged."""

    stop: ContinuedRules = ContinuedRules()


class PixelRequest(Sent):
    """A pixel of the picture (of a region: from the region's corner), from 0, from the top left."""

    x: int = Field(ge=0, lt=2**31, description="Column.")
    y: int = Field(ge=0, lt=2**31, description="Row.")


class SessionRequest(Sent):
    key: str = Field(max_length=256, description="An API key.")
