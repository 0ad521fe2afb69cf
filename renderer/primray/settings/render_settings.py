"""RenderSettings: everything that a user requests of a render, validated on construction.

Values that the scene decides are None here and are resolved by translation. `settings_of_json` reads the settings that are
stored in reports and checkpoints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeVar, Unpack

from ..aovs import check_names, light_paths_of, requests_of
from ..camera_choice import Matrix
from ..composition import Composition
from ..diagnostics import Refusal, check_codes
from ..errors import SettingsError, did_you_mean
from ..lens.diffusion import fault_of
from .choices import (
    DEFAULT_DICING_RATE,
    DEFAULT_MOTION_ERROR,
    DEFAULT_SPP,
    MAX_RESOLUTION,
    MAX_SPP,
    MAX_THREADS,
    QUICK_LOOK,
    SAMPLE_BLOCK,
    AutoCamera,
    DefaultWrap,
    Eye,
    Filter,
    Ground,
    Metric,
    RenderContext,
    StopAt,
    StudioLight,
    limit,
    limit_pixels,
    require,
)
from .readers import DIFFUSION, READERS, SettingsValues

if TYPE_CHECKING:
    from ..camera import Camera


SHADOW_SHARE = 0.3  # share of a time limit for the shadow on a ground
PURPOSES = ("default", "render", "proxy", "guide")  # UsdGeomImageable's


@dataclass(frozen=True)
class RenderSettings:
    """Settings of a render. Enums may be given as strings and tuples as lists; they are stored with the types below.

    Raises SettingsError, with the field's name as `where`, or LimitError for values that no render could follow.

    >>> settings = primray.RenderSettings(resolution=[640, 0], filter="gaussian", spp=16)
    >>> settings.resolution, settings.filter
    ((640, 0), <Filter.GAUSSIAN: 'gaussian'>)
    >>> primray.RenderSettings(resolution=640)
    Traceback (most recent call last):
    primray.errors.SettingsError: settings-error: resolution must be a list of two whole numbers, not 640 [resolution]

    `camera` may be a `Camera`, or a matrix (4, 4): world_from_camera, rigid, for points as column vectors; it looks along -Z
    of its frame, +Y up, through UsdGeomCamera's default lens: 50 mm on a film of 20.955 x 15.2908 mm, a pinhole that clips
    nothing.

    >>> primray.RenderSettings(camera=[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]).camera[2]
    (0.0, 0.0, 1.0, 5.0)
    """

    # Prim path, or the name of a camera if only one has it; a Camera; or a matrix. None: the stage's, else one that frames all.
    camera: str | Camera | Matrix | None = None
    # The camera of a stage that has none. usdrecord: its first camera or framing, whatever viewport the layer stores.
    auto_camera: AutoCamera = AutoCamera.THREE_QUARTER
    render_settings: str | None = None  # prim path; None: the prim that the stage's metadata name, else its only RenderSettings
    render_pass: str | None = None  # path of a RenderPass, which edits the scene and names the render settings
    product: str | None = None  # path or name of one of the render settings' products; None: the first
    joint_products: tuple[str, ...] | None = None  # paths of further products whose outputs the same render makes
    resolution: tuple[int, int] | None = None  # width, height; a 0 is computed from the camera's aspect ratio
    resolution_scale: float = 1.0  # factor on the resolution, whoever chose it
    time_code: float | None = None  # None: the stage's default time
    # Most samples per pixel; None: the stage's number, else 64, or no limit if there is a target error or a time limit.
    spp: int | None = None
    # Stop when the estimated error is at most target_error, or after time_limit_s of sampling, whichever comes first.
    target_error: float | None = None
    error_metric: Metric | None = None  # None: the stage's, else relmse
    time_limit_s: float | None = None
    denoise: bool | None = None  # add a denoised picture, with its error; None: as the stage requests, else no
    stop_at: StopAt = StopAt.PICTURE  # the picture whose error meets the target; DENOISED implies denoising
    adaptive: bool | None = None  # more samples where the error is large; None: if there is a target error
    sample_range: tuple[int, int] | None = None  # render only these samples of each pixel, to be merged with others
    max_depth: int | None = None  # most scatterings at surfaces; 1: direct light only; None: no limit
    # Clamp (biased): each sample's light after two or more scatterings is scaled so that its largest channel is at most this,
    # in the picture's values.
    clamp_indirect: float | None = None
    caustics: bool = True  # False (biased): light that reaches a diffuse surface by specular paths is left out
    filter: Filter | None = None  # None: the stage's, else box
    filter_width: float | None = None
    threads: int | None = None  # None: all cores available to the process
    seed: int = 0
    default_light: bool = True  # False: the same as studio_light off
    # A light that the camera does not see. auto: if nothing in the stage lights most of what is visible; on: with its lights.
    studio_light: StudioLight = StudioLight.AUTO
    # A lat-long image that lights the stage in place of its own domes. The next two apply to that dome, or to the stage's if
    # there is none: its rotation about the up axis in degrees, and whether the camera sees it.
    dome: str | None = None
    dome_rotation: float = 0.0
    dome_visible: bool = True  # to the camera
    ground: Ground | None = None  # below the scene
    background: str | None = None  # transparent, a colour (#rrggbb or r,g,b as displayed), or an image file
    orbit_deg: float = 0.0  # rotation of the camera around the scene's centre, about the up axis
    default_wrap: DefaultWrap = DefaultWrap.BLACK
    render_context: RenderContext = RenderContext.MTLX  # the preferred output of materials
    translated_shaders: bool = True  # False: materials that carry only other renderers' shaders show displayColor
    rendering_color_space: str | None = None  # a linear RGB space; None: RenderSettings' renderingColorSpace, else Rec.709
    purposes: tuple[str, ...] | None = None  # None: RenderSettings' includedPurposes, else default and render
    aovs: tuple[str, ...] | None = None  # names or sources (aov_names.AOVS); None: those of the stage's product
    aov_errors: bool = False  # add standard errors of AOVs that are means of samples
    # Diagnostics that fail the render, as in Refusal: all that change the picture, or some codes; `allow` exempts codes.
    strict: bool = False
    fail_on: tuple[str, ...] = ()
    allow: tuple[str, ...] = ()
    max_memory_bytes: int | None = None
    dicing_rate: float = DEFAULT_DICING_RATE  # longest edge of diced surfaces, in pixels
    motion_blur: bool = True  # False: ignore the shutter and render the scene at the frame's time
    shutter: tuple[float, float] | None = None  # open and close, in time codes relative to the frame; None: the camera's
    # Largest error of motion paths between time samples, in pixels; None: as the stage requests, else 0.02.
    motion_error: float | None = None
    # Diffusion of the lens, as in Diffusion; None: the camera's value. A diffusion of 0 is off.
    diffusion: float | None = None
    diffusion_glare: float | None = None
    diffusion_bloom_width: float | None = None
    diffusion_starburst: float | None = None
    diffusion_starburst_width: float | None = None
    eye: Eye | None = None  # one camera of the chosen camera's stereo pair; None: the camera itself
    # Imperfections of the lens, in place of the camera's: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS,
    # lateral-chromatic=R,G,B and longitudinal-chromatic=R,G,B; see Camera.
    lens_flaws: tuple[str, ...] = ()
    # Rendered part of the picture: left, bottom, right, top in 0 to 1, like dataWindowNDC, which it overrides.
    region: tuple[float, float, float, float] | None = None
    # Composition of the stage, as in Composition. All frames of one command share it.
    variants: tuple[str, ...] = ()
    load: tuple[str, ...] | None = None
    mask: tuple[str, ...] | None = None
    session_layer: str | None = None

    if TYPE_CHECKING:

        def __init__(self, **values: Unpack[SettingsValues]) -> None: ...

    @property
    def most_samples(self) -> int:
        """Samples per pixel at the end, if nothing stops the render earlier."""
        if self.sample_range is not None:
            return self.sample_range[1]
        if self.spp is not None:
            return self.spp
        return MAX_SPP if self.stops_early else DEFAULT_SPP

    @property
    def is_quick_look(self) -> bool:
        """Whether so few samples are requested that a pilot cannot pay off: no splitting and no path guiding."""
        return self.sample_range is None and not self.stops_early and self.most_samples < QUICK_LOOK

    @property
    def screen_block(self) -> int:
        """Samples of each replicate and pixel in a quick look's screen-space sequence; 0: each pixel has its own sequence.

        One sequence over the whole screen makes errors of neighbouring pixels cancel, but fixes the number of samples.
        """
        return (0, 1, 1, 2)[self.most_samples] if self.is_quick_look else 0

    @property
    def stops_early(self) -> bool:
        return self.target_error is not None or self.time_limit_s is not None

    @property
    def sampling_time_s(self) -> float | None:
        """Seconds of the time limit for the picture itself."""
        return None if self.time_limit_s is None else self.time_limit_s - (self.shadow_time_s or 0.0)

    @property
    def shadow_time_s(self) -> float | None:
        """Seconds of the time limit for the shadow on a ground; None: no limit, or no such shadow."""
        if self.time_limit_s is None or self.ground is not Ground.SHADOW:
            return None
        return self.time_limit_s * SHADOW_SHARE

    @property
    def adapts(self) -> bool:
        if self.adaptive is not None:
            return self.adaptive
        return self.target_error is not None and self.sample_range is None and self.stop_at is StopAt.PICTURE

    @property
    def denoises(self) -> bool:
        return self.denoise is True or self.stop_at is StopAt.DENOISED

    @property
    def metric(self) -> Metric:
        """The metric of the error, requested or default."""
        return self.error_metric or Metric.RELMSE

    @property
    def pixel_filter(self) -> Filter:
        """The pixel filter, requested or default."""
        return self.filter or Filter.BOX

    @property
    def most_motion_error(self) -> float:
        """Largest error of motion paths in pixels, requested or default."""
        return DEFAULT_MOTION_ERROR if self.motion_error is None else self.motion_error

    @property
    def refusal(self) -> Refusal:
        return Refusal(self.strict, self.fail_on, self.allow)

    @property
    def studio(self) -> StudioLight:
        """When to add the studio light, from both settings that control it."""
        return self.studio_light if self.default_light else StudioLight.OFF

    @property
    def composition(self) -> Composition:
        """Composition of the stage; prims that settings name by path are added to the population mask."""
        mask = self.mask
        if mask:
            asked = (self.camera, self.render_settings, self.render_pass, self.product, *(self.joint_products or ()))
            mask = (*mask, *(path for path in asked if isinstance(path, str) and path.startswith("/")))
        return Composition(self.variants, self.load, mask, self.session_layer)

    def __post_init__(self) -> None:
        """Raise SettingsError or LimitError if no render could follow these settings."""
        for name, read in READERS.items():
            object.__setattr__(self, name, read(name, getattr(self, name)))
        if self.resolution is not None:
            _check_resolution(*self.resolution)
        scale = self.resolution_scale
        require(0 < scale <= MAX_RESOLUTION, f"the resolution's scale must be above 0, not {scale}", "resolution_scale")
        self._check_sampling()
        self._check_sizes()
        self._check_staging()
        unknown = sorted(set(self.purposes or ()) - set(PURPOSES))
        require(not unknown, f"unknown purpose {', '.join(unknown)}; the purposes are {', '.join(PURPOSES)}", "purposes")
        require(self.purposes != (), "at least one purpose must be rendered", "purposes")
        check_codes(self.fail_on, "fail_on")
        check_codes(self.allow, "allow")
        if self.aovs is not None:
            check_names(self.aovs)
            _check_light_paths(self.aovs)
        self.composition  # noqa: B018 - checks itself

    def _check_sizes(self) -> None:
        depth, width, threads, seed = self.max_depth, self.filter_width, self.threads, self.seed
        require(depth is None or depth >= 1, f"the depth must be 1 (direct light only) or more, not {depth}", "max_depth")
        usable = width is None or (math.isfinite(width) and width > 0)
        require(usable, f"the filter's width must be a number of pixels above 0, not {width}", "filter_width")
        clamp = self.clamp_indirect
        usable = clamp is None or (math.isfinite(clamp) and clamp > 0)
        require(usable, f"the clamp of indirect light must be above 0, not {clamp}", "clamp_indirect")
        require(threads is None or threads >= 1, f"the threads must be 1 or more, not {threads}", "threads")
        allowed = threads is None or threads <= MAX_THREADS
        limit(allowed, f"{threads} threads are more than the {MAX_THREADS} allowed", "threads")
        require(0 <= seed < 2**32, f"the seed must be from 0 to 2^32 - 1, not {seed}", "seed")
        time_code, memory, rate = self.time_code, self.max_memory_bytes, self.dicing_rate
        finite = time_code is None or math.isfinite(time_code)
        require(finite, f"the time code must be a number, not {time_code}", "time_code")
        require(memory is None or memory > 0, f"the memory limit must be above 0 bytes, not {memory}", "max_memory_bytes")
        usable = math.isfinite(rate) and rate > 0
        require(usable, f"the dicing rate must be a number of pixels above 0, not {rate}", "dicing_rate")
        self._check_motion()
        self._check_diffusion()
        self._check_region()

    def _check_staging(self) -> None:
        contradicts = not self.default_light and self.studio_light is StudioLight.ON
        require(not contradicts, "default_light is off and studio_light is on; set one of them only", "studio_light")
        for name in ("dome_rotation", "orbit_deg"):
            degrees = getattr(self, name)
            require(math.isfinite(degrees), f"{name} must be a number of degrees, not {degrees}", name)
        whole = self.sample_range is None or (self.ground is not Ground.SHADOW and self.background is None)
        sentence = "a shadow on the ground and a background need a complete picture, not a range of samples"
        require(whole, sentence, "sample_range")
        for name in ("dome", "background"):
            require(getattr(self, name) != "", f"{name} must not be empty", name)

    def _check_region(self) -> None:
        if self.region is None:
            return
        left, bottom, right, top = self.region
        inside = 0 <= left < right <= 1 and 0 <= bottom < top <= 1
        sentence = f"a region must be left, bottom, right and top of a part of the picture, in 0 to 1, not {self.region}"
        require(inside, sentence, "region")

    def _check_motion(self) -> None:
        error = self.motion_error
        usable = error is None or (math.isfinite(error) and error > 0)
        require(usable, f"the error of motion must be a number of pixels above 0, not {error}", "motion_error")
        finite = self.shutter is None or all(map(math.isfinite, self.shutter))
        require(finite, f"the shutter must be two finite time codes relative to the frame, not {self.shutter}", "shutter")

    def _check_diffusion(self) -> None:
        for name, member in DIFFUSION.items():
            value = getattr(self, name)
            fault = "" if value is None else fault_of(member, value)
            require(not fault, fault, name)
        glare, starburst = self.diffusion_glare or 0.0, self.diffusion_starburst or 0.0
        sentence = f"glare {glare:g} and starburst {starburst:g} together must be at most 1"
        require(glare + starburst <= 1, sentence, "diffusion_starburst")

    def _check_sampling(self) -> None:
        spp, target, seconds = self.spp, self.target_error, self.time_limit_s
        require(spp is None or spp >= 1, f"samples per pixel must be a whole number from 1, not {spp}", "spp")
        fits = spp is None or spp <= MAX_SPP
        limit(fits, f"{spp} samples per pixel are more than the {MAX_SPP} that a pixel's sequence holds", "spp")
        usable = target is None or (math.isfinite(target) and target > 0)
        require(usable, f"the target error must be above 0, not {target}", "target_error")
        usable = seconds is None or (math.isfinite(seconds) and seconds > 0)
        require(usable, f"the time limit must be above 0 seconds, not {seconds}", "time_limit_s")
        if self.stop_at is StopAt.DENOISED:
            known = self.error_metric is not Metric.DISPLAY
            require(known, "the error of a denoised picture is measured as relmse or rmse, not on a display", "stop_at")
        if self.sample_range is not None:
            self._check_range(*self.sample_range)

    def _check_range(self, first: int, end: int) -> None:
        require(
            0 <= first < end and first % SAMPLE_BLOCK == 0 and end % SAMPLE_BLOCK == 0,
            f"a sample range must begin and end at multiples of the sample block, which is {SAMPLE_BLOCK}, and not be empty; "
            f"{first}:{end} does not",
            "sample_range",
        )
        limit(end <= MAX_SPP, f"sample {end} is beyond the {MAX_SPP} that a pixel's sequence holds", "sample_range")
        require(
            self.spp is None and not self.stops_early and not self.adaptive,
            "a sample range cannot be combined with spp, a target error, a time limit or adaptive sampling",
            "sample_range",
        )


def _check_light_paths(names: tuple[str, ...]) -> None:
    if expressions := light_paths_of(requests_of(names)):
        from ..lpe.automaton import check_expressions

        check_expressions(expressions)


_SIZE = "use resolution=(width, height) for the size in pixels"
_SAMPLES = "use spp for samples per pixel"
_FILE = "a render returns an image, and image.save(path) writes it"
# Names from other renderers and libraries whose spelling is too different for a suggestion, with the setting to use instead.
CALLED_OTHERWISE = {
    **dict.fromkeys(("width", "height", "size", "image_size", "imageWidth", "res"), _SIZE),
    **dict.fromkeys(("samples", "num_samples", "sample_count", "samples_per_pixel", "spp_max"), _SAMPLES),
    **dict.fromkeys(("output", "outputs", "file", "filename", "path", "output_path"), _FILE),
    **dict.fromkeys(("quality", "noise", "noise_threshold"), "use target_error or spp for the picture's quality"),
    **dict.fromkeys(("frame", "time", "frames"), "use time_code for one frame, or render_frames for several"),
    **dict.fromkeys(("exposure", "view", "look", "display"), "pass view options to image.save(path, ...)"),
    **dict.fromkeys(("timeout", "time_limit"), "use time_limit_s for seconds of sampling"),
    **dict.fromkeys(("depth", "bounces", "max_bounces"), "use max_depth for the longest paths"),
}


def with_values(settings: object, values: Mapping[str, Any]) -> RenderSettings:
    """Return the settings with some fields replaced; SettingsError for unknown names."""
    if not isinstance(settings, RenderSettings):
        hint = "pass fields by name: render(stage, spp=64)"
        raise SettingsError(f"settings must be primray.RenderSettings, not {type(settings).__name__}; {hint}", where="settings")
    names = [field.name for field in fields(RenderSettings)]
    for name in values:
        if name not in names:
            hint = CALLED_OTHERWISE.get(name) or did_you_mean(name, names, f"the settings are {', '.join(names)}")
            raise SettingsError(f"unknown setting {name}; {hint}", where=name, code="unknown-setting")
    return replace(settings, **values) if values else settings


def _check_resolution(width: int, height: int) -> None:
    sentence = f"the resolution must be whole pixels above 0 (a single 0 follows from the aspect ratio), not {width} x {height}"
    require(min(width, height) >= 0 and max(width, height) > 0, sentence, "resolution")
    limit_pixels(width, height, "resolution")


Choice = TypeVar("Choice", bound=Enum)


def _optional(kind: type[Choice], value: object) -> Choice | None:
    return None if value is None else kind(value)


def settings_of_json(values: Mapping[str, Any]) -> RenderSettings:
    """Return the settings that report.settings_as_json wrote; TypeError or ValueError for unknown names or choices."""
    pairs = ("resolution", "sample_range", "shutter", "region")
    names = (*pairs, "joint_products", "purposes", "aovs", "lens_flaws", "variants", "load", "mask")
    tuples = {name: tuple(values[name]) for name in names if values.get(name) is not None}
    chosen: dict[str, Any] = {"filter": _optional(Filter, values.get("filter"))}
    chosen["error_metric"] = _optional(Metric, values.get("error_metric"))
    chosen["auto_camera"] = AutoCamera(values.get("auto_camera", AutoCamera.THREE_QUARTER))
    chosen["stop_at"] = StopAt(values.get("stop_at", StopAt.PICTURE))
    chosen["default_wrap"] = DefaultWrap(values.get("default_wrap", DefaultWrap.BLACK))
    chosen["render_context"] = RenderContext(values.get("render_context", RenderContext.MTLX))
    chosen["eye"] = None if values.get("eye") is None else Eye(values["eye"])
    chosen["studio_light"] = StudioLight(values.get("studio_light", StudioLight.AUTO))
    chosen["ground"] = None if values.get("ground") is None else Ground(values["ground"])
    if isinstance(values.get("camera"), Mapping):
        from ..camera import camera_of

        chosen["camera"] = camera_of(values["camera"])
    return RenderSettings(**{**values, **tuples, **chosen})
