"""What clients send and get: the API's JSON as pydantic models, from which the OpenAPI document is made."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Fraction = Annotated[float, Field(ge=0, le=1)]
Name = Annotated[str, Field(min_length=1, max_length=255, pattern=r"^[^\x00-\x1f\x7f]+$")]


Parallel = Annotated[int, Field(ge=1, le=1024)] | Literal["auto"]
OF_PARALLEL = "The most places that each frame is rendered in at a time, by ranges of its samples; auto: all there are."


class Sent(BaseModel):
    """Members that are not known are refused, not ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)


class SceneReference(Sent):
    id: str = Field(pattern=r"^sha256:[0-9a-f]{64}$", description="What POST /v1/scenes answered.")
    entry: str | None = Field(None, max_length=1024, description="The root layer in a package that has several.")


class SceneOfRequest(Sent):
    """A scene that was uploaded, by its `id`, or a stage on the service's shared storage."""

    id: str | None = Field(None, pattern=r"^sha256:[0-9a-f]{64}$", description="What POST /v1/scenes answered.")
    shared: str | None = Field(
        None, max_length=4096, description="NAME/path.usda: a stage in the shared root NAME, in the place of `id`."
    )
    entry: str | None = Field(None, max_length=1024, description="The root layer in a package that has several.")


class StopRules(Sent):
    """A frame ends when the first of these is reached; none given: what the stage's render settings ask for, else 64 samples a
    pixel, as frames of parallel jobs always do."""

    target_error: float | None = Field(None, gt=0, description="Stop when the estimate of the error is not above this.")
    metric: Literal["relmse", "rmse", "display"] | None = Field(None, description="null: the stage's, else relmse.")
    max_samples: int | None = Field(None, ge=1, description="Samples a pixel.")
    max_seconds: float | None = Field(None, gt=0, description="Seconds of sampling, a frame.")


class FileSettings(Sent):
    """How the job's files store and show the picture."""

    view: str | None = Field(None, max_length=256, description="OCIO view of PNG, JPEG and TIFF; null: the display's default.")
    display: str | None = Field(None, max_length=256, description="OCIO display of these; null: the configuration's default.")
    look: str | None = Field(None, max_length=256, description="OCIO look in place of the view's.")
    exposure: Annotated[float, Field(ge=-30, le=30)] | Literal["auto"] | None = Field(
        None,
        description="In stops, of PNG, JPEG and TIFF; auto: what the view needs, for each frame; null: as the product asks.",
    )
    half: list[Annotated[str, Field(max_length=280)]] = Field(
        default=[],
        max_length=64,
        description="Channels, layers or parts of the EXR stored as halves (R, stderr, rgba), or all, or none.",
    )
    compression: str | None = Field(
        None, max_length=32, description="NAME or NAME:LEVEL of the EXR, such as dwaa:45; null: the product's, else zip."
    )


class Settings(FileSettings):
    """As RenderSettings of the library and the flags of `primray render`."""

    camera: str | None = Field(None, max_length=1024, description="A prim path, or a name that only one camera has.")
    auto_camera: Literal["three-quarter", "usdrecord"] = Field(
        "three-quarter", description="The view of a stage without cameras: a quarter from above, or usdrecord's."
    )
    render_settings: str | None = Field(
        None, max_length=1024, description="Path of a RenderSettings prim; not given: the stage's own."
    )
    render_pass: str | None = Field(None, max_length=1024, description="Path of the RenderPass prim to render; null: none.")
    products: list[Annotated[str, Field(max_length=256)]] = Field(
        default=["beauty"],
        min_length=1,
        max_length=64,
        description='["beauty"]: the first product of the render settings; ["*"]: all of them, each in a file of its own name; '
        "or paths of RenderProducts, or names that only one has; several of them are files of their own names.",
    )
    aovs: list[Annotated[str, Field(max_length=280)]] | None = Field(
        None, max_length=64, description="Parts of the EXR beside the picture, by name; null: what the stage's product orders."
    )
    aov_errors: bool = Field(False, description="Standard errors of those that are means of samples, in their parts.")
    frames: str | None = Field(
        None, max_length=4096, description='"1", "1:10", "1-10x2", "1-10:2" or "1,5"; not given: the default time.'
    )
    resolution: tuple[int, int] | None = Field(None, description="Width and height; one of them 0: by the camera's aspect.")
    stop: StopRules = StopRules()
    seed: int = Field(0, ge=0, lt=2**32)
    max_depth: int | None = Field(
        None, ge=1, le=2**20, description="Scatterings; 1: direct light only; null: the stage's, else no limit."
    )
    clamp_indirect: float | None = Field(
        None,
        gt=0,
        le=1e30,
        description="A stated bias: most that a sample brings over two scatterings and more; null: no clamp.",
    )
    caustics: bool = Field(True, description="false: light over specular surfaces to diffuse ones is left out, a stated bias.")
    adaptive: bool | None = None
    filter: Literal["box", "gaussian", "blackman-harris"] | None = Field(None, description="null: the stage's, else box.")
    filter_width: float | None = Field(None, gt=0, le=64)
    default_light: bool = True
    studio_light: Literal["auto", "on", "off"] = Field(
        "auto",
        description="auto: where the stage has no light, not even a weak one, and what glows lights less than 35 % of what is "
        "seen; on: beside its lights.",
    )
    ground: Literal["shadow", "plane"] | None = Field(
        None, description="Below all that is drawn: only its shadow, or a grey plane; null: none."
    )
    dome: str | None = Field(
        None, max_length=1024, description="A lat-long image of the package that lights the stage in place of its own domes."
    )
    dome_rotation: float = Field(
        0.0,
        ge=-36000,
        le=36000,
        description="Degrees that the dome, or the stage's own domes where none is given, are turned about the up axis.",
    )
    dome_visible: bool = Field(True, description="To the camera; false hides the stage's own domes where no dome is given.")
    background: str | None = Field(
        None,
        max_length=1024,
        description="Behind all that is drawn: #rrggbb, r,g,b as displayed, transparent, or an image of the package.",
    )
    default_wrap: Literal["black", "clamp", "repeat", "mirror"] = Field(
        "black", description="Outside of textures whose wrap neither the stage nor the file names."
    )
    denoise: bool | None = Field(
        None,
        description="A denoised picture beside the record, with its error; outputs' previews show it; null: as the stage asks.",
    )
    stop_at: Literal["picture", "denoised"] = Field(
        "picture", description="Whose error stop.target_error is of; a denoised picture's is measured as relmse or rmse."
    )
    render_context: Literal["mtlx", "universal"] = Field(
        "mtlx", description="Of a material that has both, the surface output that counts."
    )
    translated_shaders: bool = Field(
        True, description="false: materials that carry only other renderers' shaders show displayColor."
    )
    purposes: list[Literal["default", "render", "proxy", "guide"]] | None = Field(None, min_length=1, max_length=4)
    strict: bool = Field(False, description="Refuse a scene with warnings.")
    fail_on: list[Annotated[str, Field(max_length=64)]] = Field(
        default=[], max_length=128, description="Refuse a scene with diagnostics of these codes; `missing`: files not there."
    )
    allow: list[Annotated[str, Field(max_length=64)]] = Field(
        default=[], max_length=128, description="Codes that pass strict and fail_on."
    )
    dicing_rate: float | None = Field(None, gt=0, le=1e6)
    motion_blur: bool = Field(True, description="false: a still of the frame, whatever the camera's shutter.")
    shutter: tuple[float, float] | None = Field(
        None, description="Opens and closes, in time codes from the frame on; null: as the camera says."
    )
    motion_error: float | None = Field(
        None, gt=0, le=1e6, description="Pixels that the path of anything may be off; null: the stage's, else 0.02."
    )
    diffusion: float | None = Field(
        None, ge=0, le=1, description="Of all light, what the lens diffuses: a part of the EXR; null: as the camera says."
    )
    diffusion_glare: float | None = Field(None, ge=0, le=1, description="Of what is diffused, the veil's share.")
    diffusion_bloom_width: float | None = Field(None, gt=0, le=1, description="Of the picture's height.")
    diffusion_starburst: float | None = Field(None, ge=0, le=1, description="Of what is diffused, the star's share.")
    diffusion_starburst_width: float | None = Field(None, gt=0, le=1, description="Of the picture's height.")
    eye: Literal["left", "right"] | None = Field(None, description="Of the stereo pair that the camera is of.")
    lens_flaws: list[Annotated[str, Field(max_length=256)]] = Field(
        default=[],
        max_length=16,
        description="Of the camera's lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, "
        "lateral-chromatic=R,G,B, longitudinal-chromatic=R,G,B.",
    )
    region: tuple[float, float, float, float] | None = Field(
        None, description="Only this part of the picture: left, bottom, right, top in 0 to 1; null: as the stage says."
    )
    variants: list[Annotated[str, Field(max_length=1024)]] = Field(default=[], max_length=64)
    load: list[Annotated[str, Field(max_length=1024)]] | None = Field(None, max_length=256)
    mask: list[Annotated[str, Field(max_length=1024)]] | None = Field(None, max_length=256)


class Webhook(Sent):
    url: str = Field(max_length=2048)
    events: list[Literal["started", "frame.completed", "completed"]] = Field(default=["completed"], min_length=1, max_length=3)
    secret: str | None = Field(
        None, pattern=r"^whsec_[A-Za-z0-9+/]{32,88}={0,2}$", description="Not given: made, and shown once."
    )


class JobRequest(Sent):
    scene: SceneOfRequest
    settings: Settings = Settings()
    name: Name | None = Field(None, description="To recognise it by; not given: the scene's, its camera and frames.")
    parallel: Parallel | None = Field(None, description=OF_PARALLEL)
    priority: int = Field(50, ge=0, le=100, description="Larger goes first.")
    labels: dict[str, str] = Field(default={}, description="To find jobs by.")
    ttl_s: float | None = Field(
        None, gt=0, description="Kept so long after its end; expired if not finished so long after it was made."
    )
    webhook: Webhook | None = None


class SceneOfForm(Sent):
    """The scene is the form's file."""

    entry: str | None = Field(None, max_length=1024, description="The root layer in a package that has several.")


class FormJob(Sent):
    """As JobRequest, for a file that comes in the same form."""

    scene: SceneOfForm = SceneOfForm()
    settings: Settings = Settings()
    name: Name | None = Field(None, description="To recognise it by; not given: the scene's, its camera and frames.")
    parallel: Parallel | None = Field(None, description=OF_PARALLEL)
    priority: int = Field(50, ge=0, le=100, description="Larger goes first.")
    labels: dict[str, str] = Field(default={}, description="To find jobs by.")
    ttl_s: float | None = Field(None, gt=0, description="As in JobRequest.")
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
    """Only what is to change."""

    name: Name = Field("", description="Instead of the one that there was.")
    priority: int = Field(50, ge=0, le=100)
    labels: dict[str, str] = Field(default={}, description="Instead of all labels that there were.")
    ttl_s: float | None = Field(None, gt=0, description="null: this server's default.")


class ContinuedRules(Sent):
    """Members that are left out stay as they were; null removes one."""

    target_error: float | None = Field(None, gt=0)
    metric: Literal["relmse", "rmse", "display"] = "relmse"
    max_samples: int | None = Field(None, ge=1, description="In all, those of earlier attempts with them.")
    max_seconds: float | None = Field(None, gt=0, description="In all, those of earlier attempts with them.")


class ContinueRequest(Sent):
    """A job that succeeded needs rules that go further; one that was canceled, failed or expired may go on as it was."""

    stop: ContinuedRules = ContinuedRules()


class SessionRequest(Sent):
    key: str = Field(max_length=256, description="An API key.")
