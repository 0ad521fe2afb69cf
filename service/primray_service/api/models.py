"""Requests of the API as pydantic models, from which the OpenAPI document is made."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

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


class StopRules(Sent):
    """Stop rules: a frame ends when the first one is reached. Without any, the stage's render settings decide, else 64 samples
    per pixel; parallel jobs always use the latter."""

    target_error: float | None = Field(None, gt=0, description="Stop when the estimated error is at most this.")
    metric: Literal["relmse", "rmse", "display"] | None = Field(None, description="Metric; null: the stage's, else relmse.")
    max_samples: int | None = Field(None, ge=1, description="Most samples per pixel.")
    max_seconds: float | None = Field(None, gt=0, description="Most seconds of sampling per frame.")


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


class Settings(FileSettings):
    """Render settings, with the meanings of the library's RenderSettings and the flags of `primray render`."""

    camera: str | None = Field(None, max_length=1024, description="A camera's prim path, or its name if unique.")
    auto_camera: Literal["three-quarter", "usdrecord"] = Field(
        "three-quarter", description="Camera for stages without one: a three-quarter view from above, or usdrecord's."
    )
    render_settings: str | None = Field(
        None, max_length=1024, description="Path of a RenderSettings prim; null: the one that the stage names."
    )
    render_pass: str | None = Field(None, max_length=1024, description="Path of the RenderPass prim to render; null: none.")
    products: list[Annotated[str, Field(max_length=256)]] = Field(
        default=["beauty"],
        min_length=1,
        max_length=64,
        description='["beauty"]: the first product of the render settings; ["*"]: all of them, each in a file named after it; '
        "or paths of RenderProducts, or unique names; several products are written to files named after them.",
    )
    aovs: list[Annotated[str, Field(max_length=280)]] | None = Field(
        None, max_length=64, description="AOVs, as parts of the EXR beside the picture; null: the stage's product's."
    )
    aov_errors: bool = Field(False, description="Add the standard errors of AOVs that are means of samples to their parts.")
    frames: str | None = Field(
        None, max_length=4096, description='Frames: "1", "1:10", "1-10x2", "1-10:2" or "1,5"; null: the default time.'
    )
    resolution: tuple[int, int] | None = Field(
        None, description="Width and height in pixels; one may be 0: by the camera's aspect."
    )
    stop: StopRules = StopRules()
    seed: int = Field(0, ge=0, lt=2**32)
    max_depth: int | None = Field(
        None, ge=1, le=2**20, description="Most scattering events; 1: direct light only; null: the stage's, else no limit."
    )
    clamp_indirect: float | None = Field(
        None,
        gt=0,
        le=1e30,
        description="Largest contribution of a sample after two or more scattering events; biased; null: no clamp.",
    )
    caustics: bool = Field(True, description="false: omit caustics (light over specular surfaces to diffuse ones); biased.")
    adaptive: bool | None = None
    filter: Literal["box", "gaussian", "blackman-harris"] | None = Field(None, description="null: the stage's, else box.")
    filter_width: float | None = Field(None, gt=0, le=64)
    default_light: bool = True
    studio_light: Literal["auto", "on", "off"] = Field(
        "auto",
        description="auto: if the stage has no light at all, and emissive surfaces light less than 35 % of the picture; "
        "on: in addition to its lights.",
    )
    ground: Literal["shadow", "plane"] | None = Field(
        None, description="Ground below the scene: a shadow catcher, or a grey plane; null: none."
    )
    dome: str | None = Field(
        None, max_length=1024, description="A lat-long image in the package that lights the stage instead of its own domes."
    )
    dome_rotation: float = Field(
        0.0,
        ge=-36000,
        le=36000,
        description="Rotation in degrees about the up axis of the dome, or of the stage's own domes if none is given.",
    )
    dome_visible: bool = Field(True, description="Visible to the camera; false hides the stage's domes if no dome is given.")
    background: str | None = Field(
        None,
        max_length=1024,
        description="Background: #rrggbb, r,g,b as displayed, transparent, or an image in the package.",
    )
    default_wrap: Literal["black", "clamp", "repeat", "mirror"] = Field(
        "black", description="Wrap mode of textures for which neither the stage nor the file names one."
    )
    denoise: bool | None = Field(
        None,
        description="Add a denoised picture with its error, which previews of finished jobs show; null: the stage's choice.",
    )
    stop_at: Literal["picture", "denoised"] = Field(
        "picture", description="The picture that stop.target_error applies to; a denoised one's metric is relmse or rmse."
    )
    render_context: Literal["mtlx", "universal"] = Field(
        "mtlx", description="The surface output to use for a material that has both."
    )
    translated_shaders: bool = Field(
        True, description="false: materials that have only other renderers' shaders show displayColor."
    )
    purposes: list[Literal["default", "render", "proxy", "guide"]] | None = Field(None, min_length=1, max_length=4)
    strict: bool = Field(False, description="Refuse a scene with warnings.")
    fail_on: list[Annotated[str, Field(max_length=64)]] = Field(
        default=[], max_length=128, description="Refuse a scene with diagnostics of these codes; `missing`: of missing files."
    )
    allow: list[Annotated[str, Field(max_length=64)]] = Field(
        default=[], max_length=128, description="Codes that strict and fail_on accept."
    )
    dicing_rate: float | None = Field(None, gt=0, le=1e6)
    motion_blur: bool = Field(True, description="false: render the frame's instant, whatever the camera's shutter.")
    shutter: tuple[float, float] | None = Field(
        None, description="Shutter open and close, in time codes relative to the frame; null: the camera's."
    )
    motion_error: float | None = Field(
        None, gt=0, le=1e6, description="Maximum motion-path error in pixels; null: the stage's, else 0.02."
    )
    diffusion: float | None = Field(
        None, ge=0, le=1, description="Fraction of all light that the lens diffuses, in a part of the EXR; null: the camera's."
    )
    diffusion_glare: float | None = Field(None, ge=0, le=1, description="Fraction of the diffused light in the veiling glare.")
    diffusion_bloom_width: float | None = Field(None, gt=0, le=1, description="Bloom width as a fraction of the height.")
    diffusion_starburst: float | None = Field(None, ge=0, le=1, description="Fraction of the diffused light in the starburst.")
    diffusion_starburst_width: float | None = Field(
        None, gt=0, le=1, description="Starburst width as a fraction of the picture's height."
    )
    eye: Literal["left", "right"] | None = Field(None, description="Eye of the camera's stereo pair.")
    lens_flaws: list[Annotated[str, Field(max_length=256)]] = Field(
        default=[],
        max_length=16,
        description="Imperfections of the camera's lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, "
        "lateral-chromatic=R,G,B, longitudinal-chromatic=R,G,B.",
    )
    region: tuple[float, float, float, float] | None = Field(
        None, description="Render only this part of the picture: left, bottom, right, top from 0 to 1; null: the stage's."
    )
    variants: list[Annotated[str, Field(max_length=1024)]] = Field(default=[], max_length=64)
    load: list[Annotated[str, Field(max_length=1024)]] | None = Field(None, max_length=256)
    mask: list[Annotated[str, Field(max_length=1024)]] | None = Field(None, max_length=256)


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


class SessionRequest(Sent):
    key: str = Field(max_length=256, description="An API key.")
