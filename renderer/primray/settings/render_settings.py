"""RenderSettings: everything that a user requests of a render, validated on construction.

Values that the scene decides are None here and are resolved by translation. `settings_of_json` reads the settings that are
stored in reports and checkpoints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Unpack

from ..aovs import check_names, light_paths_of, requests_of
from ..composition import Composition
from ..diagnostics import Refusal, check_codes
from ..errors import SettingsError, did_you_mean
from ..lens.diffusion import fault_of
from .camera_choice import Matrix, camera_choice, camera_itself, read_lens_flaws
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
    Panorama,
    RenderContext,
    StopAt,
    StudioLight,
    limit,
    limit_pixels,
    require,
)
from .light_mixes import check_mixes
from .setting import (
    DRAWING,
    LARGEST_NUMBER,
    OPENING,
    PICTURES,
    RENDERING,
    Counts,
    Flag,
    Member,
    OnOff,
    choice,
    file,
    four_numbers,
    is_moderate,
    is_natural,
    is_positive,
    must,
    not_empty,
    number,
    pair,
    rows,
    setting,
    text,
    texts,
    two_numbers,
    whole,
    yes_or_no,
)

if TYPE_CHECKING:
    from ..camera import Camera
    from .written import SettingsValues


LEAST_TEXTURE_BYTES = 4 * 2**20  # some tiles for each thread
DEFAULT_CACHE_BYTES = 50 * 2**30
SHADOW_SHARE = 0.3  # share of a time limit for the shadow on a ground
PURPOSES = ("default", "render", "proxy", "guide")  # UsdGeomImageable's
# Settings of the lens's diffusion, with the fields of Diffusion that they set.
DIFFUSION = {
    "diffusion": "strength",
    "diffusion_glare": "glare",
    "diffusion_bloom_width": "bloom_width",
    "diffusion_starburst": "starburst",
    "diffusion_starburst_width": "starburst_width",
}


def _check_resolution(name: str, size: tuple[int, int]) -> None:
    width, height = size
    sentence = f"the resolution must be whole pixels above 0 (a single 0 follows from the aspect ratio), not {width} x {height}"
    require(min(size) >= 0 and max(size) > 0, sentence, name)
    limit_pixels(width, height, name)


def _is_scale(scale: float) -> bool:
    return 0 < scale <= MAX_RESOLUTION


def _is_pixel_size(size: float) -> bool:
    return 1 <= size <= MAX_RESOLUTION


def _check_samples(name: str, spp: int) -> None:
    require(spp >= 1, f"samples per pixel must be a whole number from 1, not {spp}", name)
    limit(spp <= MAX_SPP, f"{spp} samples per pixel are more than the {MAX_SPP} that a pixel's sequence holds", name)


def _check_threads(name: str, threads: int) -> None:
    require(threads >= 1, f"the threads must be 1 or more, not {threads}", name)
    limit(threads <= MAX_THREADS, f"{threads} threads are more than the {MAX_THREADS} allowed", name)


def _is_seed(seed: int) -> bool:
    return 0 <= seed < 2**32


def _check_purposes(name: str, purposes: tuple[str, ...]) -> None:
    unknown = sorted(set(purposes) - set(PURPOSES))
    require(not unknown, f"unknown purpose {', '.join(unknown)}; the purposes are {', '.join(PURPOSES)}", name)
    require(purposes != (), "at least one purpose must be rendered", name)


def _check_aovs(name: str, aovs: tuple[str, ...]) -> None:
    check_names(aovs)
    if expressions := light_paths_of(requests_of(aovs)):
        from ..lpe.automaton import check_expressions

        check_expressions(expressions)


def _check_codes(name: str, codes: tuple[str, ...]) -> None:
    check_codes(codes, name)


def _are_moderate(times: tuple[float, float]) -> bool:
    return all(map(is_moderate, times))


def _check_diffusion(name: str, value: float) -> None:
    fault = fault_of(DIFFUSION[name], value)
    require(not fault, fault, name)


def _is_deep_tolerance(tolerance: float) -> bool:
    return 0.001 <= tolerance <= 1


def _is_deep_count(samples: int) -> bool:
    return 4 <= samples <= 4096


def _is_texture_memory(size: int) -> bool:
    return size >= LEAST_TEXTURE_BYTES


def _is_region(region: tuple[float, float, float, float]) -> bool:
    left, bottom, right, top = region
    return 0 <= left < right <= 1 and 0 <= bottom < top <= 1


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
    camera: str | Camera | Matrix | None = setting(
        None,
        camera_choice,
        counts=Counts.SCENE,
        flag=Flag(("--camera", "-c", "-cam"), "Path or name of the camera prim.", metavar="CAMERA", shown=False),
        member=Member("A camera's prim path, or its name if unique.", chars=1024),
    )
    # The camera of a stage that has none. usdrecord: its first camera or framing, whatever viewport the layer stores.
    auto_camera: AutoCamera = setting(
        AutoCamera.THREE_QUARTER,
        choice(AutoCamera),
        counts=Counts.SCENE,
        flag=Flag(("--auto-camera",), "View of a stage without cameras: three-quarter from above, or usdrecord's."),
        member=Member("Camera for stages without one: a three-quarter view from above, or usdrecord's."),
    )
    # All around the camera, which keeps its place; None: what the camera sees. Two eyes are 64 mm apart (Camera.lat_long).
    panorama: Panorama | None = setting(
        None,
        choice(Panorama),
        counts=Counts.SCENE,
        seldom=True,
        flag=Flag(
            ("--panorama",),
            "All around the camera: equirectangular, of one eye or two (stereo: left above right), or a cube's faces.",
            shown="what the camera sees",
            commands=OPENING - {"view"},
        ),
        member=Member("A picture of all that is around the camera; null: what the camera sees."),
    )
    # Prim path; None: the prim that the stage's metadata name, else its only RenderSettings.
    render_settings: str | None = setting(
        None,
        text,
        counts=Counts.SCENE,
        flag=Flag(
            ("--render-settings", "--renderSettingsPrimPath", "-rs", "--settings", "-s"),
            "Path of the RenderSettings to use, or its name in /Render.",
            metavar="PRIM",
            shown="the stage's",
        ),
        member=Member("Path of a RenderSettings prim; null: the one that the stage names.", chars=1024),
    )
    # Path of a RenderPass, which edits the scene and names the render settings.
    render_pass: str | None = setting(
        None,
        text,
        counts=Counts.SCENE,
        flag=Flag(
            ("--render-pass", "--renderPassPrimPath", "-rp"),
            "Path of the RenderPass to render, or its name in /Render.",
            metavar="PRIM",
            shown="none",
        ),
        member=Member("Path of the RenderPass prim to render; null: none.", chars=1024),
    )
    # Path or name of one of the render settings' products; None: the first.
    product: str | None = setting(None, text, counts=Counts.SCENE, member=Member(name="products", is_derived=False))
    # Paths of further products whose outputs the same render makes.
    joint_products: tuple[str, ...] | None = setting(None, texts, seldom=True)
    # Width, height; a 0 is computed from the camera's aspect ratio.
    resolution: tuple[int, int] | None = setting(
        None,
        pair,
        check=_check_resolution,
        counts=Counts.PIXELS,
        flag=Flag(
            ("--res", "-r", "--resolution"),
            "Resolution in pixels, also as WxH; a 0 is computed from the camera's aspect ratio.",
            metavar="W H",
            shown=False,
        ),
        member=Member("Width and height in pixels; one may be 0: by the camera's aspect."),
    )
    # Factor on the resolution, whoever chose it.
    resolution_scale: float = setting(
        1.0,
        number,
        check=must(_is_scale, "the resolution's scale must be above 0"),
        flag=Flag(
            ("--res-scale", "-S"),
            "Scale of the resolution, whichever setting it comes from.",
            form=float,
            metavar="PERCENT",
            shown="100",
            commands=OPENING - {"submit"},
        ),
    )
    # None: the stage's default time.
    time_code: float | None = setting(
        None,
        number,
        check=must(is_moderate, f"the time code must be a number from -{LARGEST_NUMBER:,} to {LARGEST_NUMBER:,}"),
        counts=Counts.SCENE,
    )
    # Most samples per pixel; None: the stage's number, else 64, or no limit if there is a target error or a time limit.
    spp: int | None = setting(
        None,
        whole,
        check=_check_samples,
        sampling=True,
        flag=Flag(
            ("--spp", "--pixel-samples", "-p", "--max-samples"),
            "Samples per pixel; with a target error or time limit, the maximum on average.",
            metavar="N",
            shown="the stage's, else 64, or no cap",
            commands=RENDERING,
        ),
        member=Member("Most samples per pixel.", "stop.max_samples", bounds={"ge": 1}),
    )
    # Stop when the estimated error is at most target_error, or after time_limit_s of sampling, whichever comes first.
    target_error: float | None = setting(
        None,
        number,
        check=must(is_positive, "the target error must be above 0"),
        sampling=True,
        flag=Flag(
            ("--target-error",), "Stop when the estimated error is at most E.", metavar="E", shown=False, commands=PICTURES
        ),
        member=Member("Stop when the estimated error is at most this.", "stop.target_error", bounds={"gt": 0}),
    )
    # None: the stage's, else relmse.
    error_metric: Metric | None = setting(
        None,
        choice(Metric),
        sampling=True,
        flag=Flag(
            ("--error-metric", "--metric"),
            "relmse: mean of (I-R)^2/(R^2+0.01); rmse; display: rmse of the displayed picture, in 8-bit steps.",
            shown="the stage's, else relmse",
            commands=RENDERING - {"explain"},
        ),
        member=Member("Metric; null: the stage's, else relmse.", "stop.metric"),
    )
    time_limit_s: float | None = setting(
        None,
        number,
        check=must(is_positive, "the time limit must be above 0 seconds"),
        sampling=True,
        flag=Flag(
            ("--time-limit", "--max-seconds"),
            "Stop each frame after this many seconds of sampling (not counting set-up).",
            metavar="S",
            shown=False,
            commands=PICTURES,
        ),
        member=Member("Most seconds of sampling per frame.", "stop.max_seconds", bounds={"gt": 0}),
    )
    # Add a denoised picture, with its error; None: as the stage requests, else no.
    denoise: bool | None = setting(
        None,
        yes_or_no,
        flag=Flag(
            ("--denoise/--no-denoise",),
            "Add a denoised picture with its error; PNG and JPEG show it (needs primray[denoise]).",
            shown="the stage's, else not",
            commands=PICTURES,
        ),
        member=Member("Add a denoised picture with its error, which previews of finished jobs show; null: the stage's choice."),
    )
    # The picture whose error meets the target; DENOISED implies denoising.
    stop_at: StopAt = setting(
        StopAt.PICTURE,
        choice(StopAt),
        sampling=True,
        flag=Flag(
            ("--stop-at",),
            "Picture that --target-error applies to; denoised implies --denoise, mix needs --mix; both relmse or rmse.",
            commands=PICTURES,
        ),
        member=Member("The picture that stop.target_error applies to; of a denoised one or a mix in relmse or rmse."),
    )
    # Mixes of the lights, of which the one with the largest error meets the target; "key=0.5 fill=1,0.8,0.6".
    mixes: tuple[str, ...] = setting(
        (),
        texts,
        check=check_mixes,
        counts=Counts.PIXELS,
        seldom=True,
        sampling=True,
        flag=Flag(
            ("--mix",),
            "With --stop-at mix: weights of lights, 'key=0.5 fill=1,0.8,0.6', or the --report of `primray relight`; may be "
            "repeated: the worst counts.",
            metavar="WEIGHTS",
            shown=False,
            commands=PICTURES,
        ),
        member=Member("With stop_at mix: weights of lights, such as key=0.5 fill=1,0.8,0.6; the worst counts.", items=(0, 16)),
    )
    # More samples where the error is large; None: if there is a target error.
    adaptive: bool | None = setting(
        None,
        yes_or_no,
        sampling=True,
        flag=Flag(
            ("--adaptive/--no-adaptive",),
            "Take more samples where the error is large.",
            shown="with --target-error",
            commands=RENDERING - {"explain"},
        ),
        member=Member(),
    )
    # Render only these samples of each pixel, to be merged with others.
    sample_range: tuple[int, int] | None = setting(
        None,
        pair,
        sampling=True,
        flag=Flag(
            ("--sample-range",),
            "Render only samples A to B of each pixel, for `primray merge`; multiples of 2.",
            form=str,
            metavar="A:B",
            shown=False,
            commands=frozenset({"render"}),
        ),
    )
    # Most scatterings at surfaces; 1: direct light only; None: no limit.
    max_depth: int | None = setting(
        None,
        whole,
        check=must(is_natural, "the depth must be 1 (direct light only) or more"),
        counts=Counts.PIXELS,
        sampling=True,
        flag=Flag(
            ("--max-depth",),
            "Maximum number of surface scattering events; 1: direct light only.",
            metavar="N",
            shown="the stage's, else no limit",
            commands=OPENING - {"inspect"},
        ),
        member=Member(
            "Most scattering events; 1: direct light only; null: the stage's, else no limit.", bounds={"ge": 1, "le": 2**20}
        ),
    )
    # Clamp (biased): each sample's light after two or more scatterings is scaled so that its largest channel is at most this,
    # in the picture's values.
    clamp_indirect: float | None = setting(
        None,
        number,
        check=must(is_positive, "the clamp of indirect light must be above 0"),
        counts=Counts.BIAS,
        sampling=True,
        flag=Flag(
            ("--clamp-indirect",),
            "Clamp indirect light (two or more scattering events) of each sample to V; the report states the bias.",
            metavar="V",
            shown="no clamp",
            commands=RENDERING,
        ),
        member=Member(
            "Largest contribution of a sample after two or more scattering events; biased; null: no clamp.",
            bounds={"gt": 0, "le": 1e30},
        ),
    )
    # False (biased): light that reaches a diffuse surface by specular paths is left out.
    caustics: bool = setting(
        True,
        yes_or_no,
        counts=Counts.BIAS,
        sampling=True,
        flag=Flag(
            ("--caustics",),
            "off: leave out light that reaches diffuse surfaces via specular ones; the report states the bias.",
            form=OnOff,
            commands=RENDERING,
        ),
        member=Member("false: omit caustics (light over specular surfaces to diffuse ones); biased."),
    )
    # None: the stage's, else box.
    filter: Filter | None = setting(
        None,
        choice(Filter),
        counts=Counts.PIXELS,
        flag=Flag(("--filter",), "Pixel filter.", shown="the stage's, else box", commands=RENDERING),
        member=Member("null: the stage's, else box."),
    )
    filter_width: float | None = setting(
        None,
        number,
        check=must(is_positive, "the filter's width must be a number of pixels above 0"),
        counts=Counts.PIXELS,
        flag=Flag(
            ("--filter-width",), "Full width of the filter in pixels.", metavar="W", shown="box 1, else 3", commands=RENDERING
        ),
        member=Member(bounds={"gt": 0, "le": 64}),
    )
    # None: all cores available to the process.
    threads: int | None = setting(
        None,
        whole,
        check=_check_threads,
        sampling=True,
        flag=Flag(
            ("--threads", "-j"),
            "Number of threads; -1: all cores but one.",
            metavar="N",
            shown="all cores",
            commands=OPENING - {"inspect", "submit"},
        ),
    )
    seed: int = setting(
        0,
        whole,
        check=must(_is_seed, "the seed must be from 0 to 2^32 - 1"),
        counts=Counts.PIXELS,
        sampling=True,
        flag=Flag(("--seed", "--lock-random"), "Seed of the random numbers.", metavar="N", commands=RENDERING),
        member=Member(bounds={"ge": 0, "lt": 2**32}),
    )
    # False: the same as studio_light off.
    default_light: bool = setting(
        True,
        yes_or_no,
        counts=Counts.SCENE,
        flag=Flag(("--no-default-light", "--disableCameraLight"), "Leave a stage without lights dark."),
        member=Member(),
    )
    # A light that the camera does not see. auto: if nothing in the stage lights most of what is visible; on: with its lights.
    studio_light: StudioLight = setting(
        StudioLight.AUTO,
        choice(StudioLight),
        counts=Counts.STAGING,
        flag=Flag(
            ("--studio-light",),
            "Add a studio light. auto: if the stage has no light at all, and emissive surfaces light less than 35 % of the "
            "visible surfaces; on: in addition to the stage's lights.",
        ),
        member=Member(
            "auto: if the stage has no light at all, and emissive surfaces light less than 35 % of the picture; on: in "
            "addition to its lights."
        ),
    )
    # A lat-long image that lights the stage in place of its own domes. The next two apply to that dome, or to the stage's if
    # there is none: its rotation about the up axis in degrees, and whether the camera sees it.
    dome: str | None = setting(
        None,
        file,
        check=not_empty,
        counts=Counts.STAGING,
        flag=Flag(("--dome",), "Lat-long image for a dome light that replaces the stage's.", metavar="FILE", shown=False),
        member=Member("A lat-long image in the package that lights the stage instead of its own domes.", chars=1024),
    )
    dome_rotation: float = setting(
        0.0,
        number,
        check=must(is_moderate, f"dome_rotation must be a number of degrees, at most {LARGEST_NUMBER:,}"),
        counts=Counts.STAGING,
        flag=Flag(
            ("--dome-rotation",),
            "Rotate --dome, else the stage's domes, about the up axis, counterclockwise seen from above.",
            metavar="DEGREES",
        ),
        member=Member(
            "Rotation in degrees about the up axis of the dome, or of the stage's own domes if none is given.",
            bounds={"ge": -36000, "le": 36000},
        ),
    )
    dome_visible: bool = setting(
        True,
        yes_or_no,
        counts=Counts.STAGING,
        flag=Flag(("--dome-visible",), "Whether the camera sees --dome; off also hides the stage's own domes.", form=OnOff),
        member=Member("Visible to the camera; false hides the stage's domes if no dome is given."),
    )
    ground: Ground | None = setting(
        None,
        choice(Ground),
        counts=Counts.STAGING,
        sampling=True,
        flag=Flag(("--ground",), "Ground below the scene: a shadow catcher, or a grey plane.", shown=False),
        member=Member("Ground below the scene: a shadow catcher, or a grey plane; null: none."),
    )
    # "transparent", a colour (#rrggbb or r,g,b as displayed), or an image file.
    background: str | None = setting(
        None,
        file,
        check=not_empty,
        counts=Counts.STAGING,
        sampling=True,
        flag=Flag(
            ("--background",),
            "Background: a colour as displayed (#rrggbb, or r,g,b in 0 to 1), transparent, or a picture.",
            metavar="COLOR|transparent|FILE",
            shown=False,
            commands=PICTURES,
        ),
        member=Member("Background: #rrggbb, r,g,b as displayed, transparent, or an image in the package.", chars=1024),
    )
    # Rotation of the camera around the scene's centre, about the up axis.
    orbit_deg: float = setting(
        0.0,
        number,
        check=must(is_moderate, f"orbit_deg must be a number of degrees, at most {LARGEST_NUMBER:,}"),
        counts=Counts.STAGING,
        sampling=True,
    )
    default_wrap: DefaultWrap = setting(
        DefaultWrap.BLACK,
        choice(DefaultWrap),
        counts=Counts.SCENE,
        flag=Flag(("--default-wrap",), "Wrap mode of textures for which neither stage nor file specifies one."),
        member=Member("Wrap mode of textures for which neither the stage nor the file names one."),
    )
    # The preferred output of materials.
    render_context: RenderContext = setting(
        RenderContext.MTLX,
        choice(RenderContext),
        counts=Counts.SCENE,
        flag=Flag(("--render-context",), "Surface output to use of a material that has both."),
        member=Member("The surface output to use for a material that has both."),
    )
    # False: materials that carry only other renderers' shaders show displayColor.
    translated_shaders: bool = setting(
        True,
        yes_or_no,
        counts=Counts.SCENE,
        seldom=True,
        flag=Flag(
            ("--no-translated-shaders",),
            "Show displayColor for materials that only have shaders of Arnold, RenderMan or Houdini.",
        ),
        member=Member("false: materials that have only other renderers' shaders show displayColor."),
    )
    # A linear RGB space; None: RenderSettings' renderingColorSpace, else Rec.709.
    rendering_color_space: str | None = setting(
        None,
        text,
        counts=Counts.PIXELS,
        flag=Flag(
            ("--rendering-color-space",),
            "Linear RGB space for rendering, such as lin_ap1_scene.",
            metavar="NAME",
            shown="the stage's, else lin_rec709_scene",
            commands=OPENING - {"submit", "view"},
        ),
    )
    # None: RenderSettings' includedPurposes, else default and render.
    purposes: tuple[str, ...] | None = setting(
        None,
        texts,
        check=_check_purposes,
        counts=Counts.SCENE,
        flag=Flag(
            ("--purposes", "--purpose"),
            "Purposes to render besides default, such as render,proxy.",
            form=str,
            metavar="LIST",
            shown="the stage's",
        ),
        member=Member(items=(1, 4), choices=PURPOSES),
    )
    # Names or sources (aovs.AOVS); None: those of the stage's product.
    aovs: tuple[str, ...] | None = setting(
        None,
        texts,
        check=_check_aovs,
        flag=Flag(
            ("--aov", "--aovs"),
            "AOVs to write as parts of an EXR: names separated by commas, all, or none; deep is a file beside it, "
            "NAME.deep.exr; may be repeated.",
            metavar="NAME",
            shown="the stage's",
            commands=PICTURES,
        ),
        member=Member("AOVs, as parts of the EXR beside the picture; null: the stage's product's.", chars=280, items=(0, 64)),
    )
    # Add standard errors of AOVs that are means of samples.
    aov_errors: bool = setting(
        False,
        yes_or_no,
        flag=Flag(("--aov-errors",), "Add standard errors to AOVs that are means of samples.", commands=PICTURES),
        member=Member("Add the standard errors of AOVs that are means of samples to their parts."),
    )
    # Relative size of depths that share a sample of a deep picture, and the most samples in a pixel.
    deep_tolerance: float = setting(
        0.01,
        number,
        check=must(_is_deep_tolerance, "the tolerance of a deep picture must be from 0.001 to 1"),
        seldom=True,
        flag=Flag(
            ("--deep-tolerance",),
            "Relative size of the depths that share a sample of --aov deep and of deepRaster products.",
            metavar="T",
            commands=frozenset({"render"}),
        ),
    )
    deep_samples: int = setting(
        32,
        whole,
        check=must(_is_deep_count, "the samples of a deep picture must be from 4 to 4096 a pixel"),
        seldom=True,
        flag=Flag(
            ("--deep-samples",),
            "Most samples in a pixel of a deep picture; a pixel with more has a greater tolerance.",
            metavar="N",
            commands=frozenset({"render"}),
        ),
    )
    # Diagnostics that fail the render, as in Refusal: all that change the picture, or some codes; `allow` exempts codes.
    strict: bool = setting(
        False,
        yes_or_no,
        flag=Flag(
            ("--strict",),
            "Refuse a stage with warnings that affect the picture.",
            commands=OPENING - {"estimate", "explain", "view"},
        ),
        member=Member("Refuse a scene with warnings."),
    )
    fail_on: tuple[str, ...] = setting(
        (),
        texts,
        check=_check_codes,
        flag=Flag(
            ("--fail-on",),
            "Refuse a stage with any of these diagnostic codes, separated by commas; `missing` stands for missing files; may "
            "be repeated.",
            metavar="CODES",
            shown=False,
            commands=OPENING - {"estimate", "explain", "view"},
        ),
        member=Member("Refuse a scene with diagnostics of these codes; `missing`: of missing files.", chars=64, items=(0, 128)),
    )
    allow: tuple[str, ...] = setting(
        (),
        texts,
        check=_check_codes,
        flag=Flag(
            ("--allow",),
            "Exempt these diagnostic codes from --strict and --fail-on; may be repeated.",
            metavar="CODES",
            shown=False,
            commands=OPENING - {"estimate", "explain", "view"},
        ),
        member=Member("Codes that strict and fail_on accept.", chars=64, items=(0, 128)),
    )
    max_memory_bytes: int | None = setting(
        None,
        whole,
        check=must(is_natural, "the memory limit must be above 0 bytes"),
        flag=Flag(
            ("--max-memory",),
            "Memory limit of the process, beyond which the render fails: 4G, 500M; auto: that of the container or machine.",
            form=str,
            metavar="SIZE",
            shown="no limit",
            commands=DRAWING,
        ),
    )
    # Memory for textures, in bytes: beyond it they are read by tile from a cache on disk, with the same pixels. None: no limit.
    texture_memory_bytes: int | None = setting(
        None,
        whole,
        check=must(_is_texture_memory, "the memory for textures must be at least 4 MiB"),
        sampling=True,
        seldom=True,
        flag=Flag(
            ("--texture-memory",),
            "Memory for textures (400M, 8G), beyond which they are read from the texture cache, with the same pixels.",
            form=str,
            metavar="SIZE",
            shown="no limit",
            commands=DRAWING,
        ),
    )
    # Folder of that cache; None: primray/textures in $XDG_CACHE_HOME, or in ~/.cache.
    texture_cache: str | None = setting(
        None,
        text,
        sampling=True,
        seldom=True,
        flag=Flag(
            ("--texture-cache",),
            "Folder of the texture cache, which processes and machines may share.",
            form=str,
            metavar="DIR",
            shown="~/.cache/primray/textures",
            commands=DRAWING,
        ),
    )
    # Size of that cache in bytes, beyond which what was not used for the longest time is removed.
    texture_cache_bytes: int = setting(
        DEFAULT_CACHE_BYTES,
        whole,
        check=must(is_natural, "the size of the texture cache must be above 0 bytes"),
        sampling=True,
        seldom=True,
        flag=Flag(
            ("--texture-cache-size",),
            "Size of the texture cache, beyond which files that were not used lately are removed.",
            form=str,
            metavar="SIZE",
            shown="50G",
            commands=DRAWING,
        ),
    )
    # Longest edge of diced surfaces, in pixels.
    dicing_rate: float = setting(
        DEFAULT_DICING_RATE,
        number,
        check=must(is_positive, "the dicing rate must be a number of pixels above 0"),
        counts=Counts.PIXELS,
        sampling=True,
        flag=Flag(
            ("--dicing-rate",),
            "Longest edge of diced subdivision surfaces, in pixels.",
            metavar="PIXELS",
            commands=OPENING - {"view"},
        ),
        member=Member(bounds={"gt": 0, "le": 1e6}, is_open=True),
    )
    # Camera that surfaces are diced for, in a frame of the picture's size, and near which lengths are measured; None: the one
    # that is rendered. Of pictures with the same one, wherever they are seen from, points and triangles are the same.
    dicing_camera: Camera | None = setting(None, camera_itself, counts=Counts.PIXELS, sampling=True, seldom=True)
    # False: surfaces do not read image files; the inputs that would have their constants.
    surface_textures: bool = setting(
        True,
        yes_or_no,
        counts=Counts.PIXELS,
        sampling=True,
        seldom=True,
        flag=Flag(
            ("--surface-textures",),
            "off: surfaces do not read image files; those inputs have the constants of their shading model.",
            form=OnOff,
            commands=frozenset({"render"}),
        ),
    )
    # Width of a rendered pixel in pixels of the resolution: at 4, a sixteenth of them is rendered, and all else is that of the
    # whole picture: the view, and how finely surfaces are diced.
    pixel_size: float = setting(
        1.0,
        number,
        check=must(_is_pixel_size, f"the size of pixels must be a number from 1 to {MAX_RESOLUTION}"),
        counts=Counts.PIXELS,
        sampling=True,
        seldom=True,
        flag=Flag(
            ("--pixel-size",),
            "Render larger pixels, N times as wide as the resolution's; surfaces are diced for the whole picture.",
            metavar="N",
            commands=frozenset({"render"}),
        ),
    )
    # False: ignore the shutter and render the scene at the frame's time.
    motion_blur: bool = setting(
        True,
        yes_or_no,
        counts=Counts.SCENE,
        flag=Flag(
            ("--no-motion-blur", "--disable-motionblur"),
            "Render without motion blur, whatever the camera's shutter.",
            commands=OPENING - {"view"},
        ),
        member=Member("false: render the frame's instant, whatever the camera's shutter."),
    )
    # Open and close, in time codes relative to the frame; None: the camera's.
    shutter: tuple[float, float] | None = setting(
        None,
        two_numbers,
        check=must(_are_moderate, f"the shutter must be two time codes relative to the frame, at most {LARGEST_NUMBER:,} away"),
        counts=Counts.SCENE,
        flag=Flag(
            ("--shutter",),
            "Shutter times in time codes relative to the frame, overriding the camera's.",
            metavar="OPEN CLOSE",
            shown=False,
            commands=OPENING - {"view"},
        ),
        member=Member("Shutter open and close, in time codes relative to the frame; null: the camera's."),
    )
    # Largest error of motion paths between time samples, in pixels; None: as the stage requests, else 0.02.
    motion_error: float | None = setting(
        None,
        number,
        check=must(is_positive, "the error of motion must be a number of pixels above 0"),
        counts=Counts.SCENE,
        flag=Flag(
            ("--motion-error",),
            "Maximum error of motion paths, in pixels.",
            metavar="PIXELS",
            shown="the stage's, else 0.02",
            commands=OPENING - {"view"},
        ),
        member=Member("Maximum motion-path error in pixels; null: the stage's, else 0.02.", bounds={"gt": 0, "le": 1e6}),
    )
    # Diffusion of the lens, as in Diffusion; None: the camera's value. A diffusion of 0 is off.
    diffusion: float | None = setting(
        None,
        number,
        check=_check_diffusion,
        seldom=True,
        flag=Flag(
            ("--diffusion",),
            "Share of the light that the lens diffuses (0: none), shown by PNG and JPEG, and an additional part of an EXR.",
            metavar="SHARE",
            shown="the camera's",
            commands=PICTURES,
        ),
        member=Member(
            "Fraction of all light that the lens diffuses, in a part of the EXR; null: the camera's.", bounds={"ge": 0, "le": 1}
        ),
    )
    diffusion_glare: float | None = setting(
        None,
        number,
        check=_check_diffusion,
        seldom=True,
        flag=Flag(
            ("--diffusion-glare",),
            "Share of the diffused light in veiling glare.",
            metavar="SHARE",
            shown="the camera's, else 0.2",
            commands=PICTURES,
        ),
        member=Member("Fraction of the diffused light in the veiling glare.", bounds={"ge": 0, "le": 1}),
    )
    diffusion_bloom_width: float | None = setting(
        None,
        number,
        check=_check_diffusion,
        seldom=True,
        flag=Flag(
            ("--diffusion-bloom-width",),
            "Width of the bloom relative to the picture's height.",
            metavar="SHARE",
            shown="the camera's, else 0.005",
            commands=PICTURES,
        ),
        member=Member("Bloom width as a fraction of the height.", bounds={"gt": 0, "le": 1}),
    )
    diffusion_starburst: float | None = setting(
        None,
        number,
        check=_check_diffusion,
        seldom=True,
        flag=Flag(
            ("--diffusion-starburst",),
            "Share of the diffused light in the starburst of the aperture blades.",
            metavar="SHARE",
            shown="the camera's, else 0.3",
            commands=PICTURES,
        ),
        member=Member("Fraction of the diffused light in the starburst.", bounds={"ge": 0, "le": 1}),
    )
    diffusion_starburst_width: float | None = setting(
        None,
        number,
        check=_check_diffusion,
        seldom=True,
        flag=Flag(
            ("--diffusion-starburst-width",),
            "Wavelength over aperture diameter, relative to the picture's height.",
            metavar="SHARE",
            shown="the camera's, else 0.003",
            commands=PICTURES,
        ),
        member=Member("Starburst width as a fraction of the picture's height.", bounds={"gt": 0, "le": 1}),
    )
    # One camera of the chosen camera's stereo pair; None: the camera itself.
    eye: Eye | None = setting(
        None, choice(Eye), counts=Counts.SCENE, seldom=True, member=Member("Eye of the camera's stereo pair.")
    )
    # Imperfections of the lens, in place of the camera's: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS,
    # lateral-chromatic=R,G,B and longitudinal-chromatic=R,G,B; see Camera.
    lens_flaws: tuple[str, ...] = setting(
        (),
        read_lens_flaws,
        counts=Counts.SCENE,
        flag=Flag(
            ("--lens",),
            "Imperfection of the lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, lateral-chromatic=R,G,B "
            "or longitudinal-chromatic=R,G,B; may be repeated.",
            metavar="NAME=NUMBERS",
            shown="the camera's",
            commands=OPENING - {"view"},
        ),
        member=Member(
            "Imperfections of the camera's lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, "
            "lateral-chromatic=R,G,B, longitudinal-chromatic=R,G,B.",
            chars=256,
            items=(0, 16),
        ),
    )
    # Rendered part of the picture: left, bottom, right, top in 0 to 1, like dataWindowNDC, which it overrides.
    region: tuple[float, float, float, float] | None = setting(
        None,
        four_numbers,
        check=must(_is_region, "a region must be left, bottom, right and top of a part of the picture, in 0 to 1"),
        seldom=True,
        flag=Flag(
            ("--region",),
            "Render only this part of the picture, in 0 to 1, overriding dataWindowNDC.",
            metavar="LEFT BOTTOM RIGHT TOP",
            shown=False,
            commands=OPENING - {"explain", "view"},
        ),
        member=Member("Render only this part of the picture: left, bottom, right, top from 0 to 1; null: the stage's."),
    )
    # Composition of the stage, as in Composition. All frames of one command share it.
    variants: tuple[str, ...] = setting(
        (),
        texts,
        counts=Counts.SCENE,
        flag=Flag(("--variant", "--variants"), "Choose a variant; may be repeated.", metavar="PRIM:SET=NAME", shown=False),
        member=Member(chars=1024, items=(0, 64)),
    )
    load: tuple[str, ...] | None = setting(
        None,
        texts,
        counts=Counts.SCENE,
        flag=Flag(("--load",), "Load payloads only at and below this prim; may be repeated.", metavar="PRIM", shown="all"),
        member=Member(chars=1024, items=(0, 256)),
    )
    mask: tuple[str, ...] | None = setting(
        None,
        texts,
        counts=Counts.SCENE,
        flag=Flag(
            ("--mask",),
            "Populate only this prim, its ancestors and descendants, and the targets of its relationships; may be repeated.",
            metavar="PRIM",
            shown=False,
        ),
        member=Member(chars=1024, items=(0, 256)),
    )
    # File with the ids of label classes, which renders extend; None: ids are those of this stage.
    label_table: str | None = setting(
        None,
        file,
        seldom=True,
        flag=Flag(
            ("--label-table",),
            "JSON file that fixes the ids of label classes over a data set; written if missing, extended by new classes.",
            metavar="FILE",
            shown=False,
            commands=frozenset({"render"}),
        ),
    )
    # Whether labelled things have the mask of all of them, whatever hides it, with their other measures.
    silhouettes: bool = setting(
        False,
        yes_or_no,
        seldom=True,
        flag=Flag(
            ("--silhouettes",),
            "Measure the silhouette of each labelled thing, whatever hides it; with --aov object_instance:TAXONOMY.",
            commands=frozenset({"render", "submit"}),
        ),
        member=Member("Measure silhouettes of labelled things, whatever hides them, for the report."),
    )
    session_layer: str | None = setting(
        None,
        file,
        counts=Counts.SCENE,
        flag=Flag(
            ("--session-layer", "--sessionLayer"),
            "Layer with opinions stronger than the stage's.",
            metavar="FILE",
            shown=False,
            commands=OPENING - {"submit"},
        ),
    )

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
        return self.target_error is not None and self.sample_range is None and self.stop_at is not StopAt.DENOISED

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
        for row in rows(type(self)):
            object.__setattr__(self, row.name, row.value_of(getattr(self, row.name)))
        contradicts = not self.default_light and self.studio_light is StudioLight.ON
        require(not contradicts, "default_light is off and studio_light is on; set one of them only", "studio_light")
        glare, starburst = self.diffusion_glare or 0.0, self.diffusion_starburst or 0.0
        sentence = f"glare {glare:g} and starburst {starburst:g} together must be at most 1"
        require(glare + starburst <= 1, sentence, "diffusion_starburst")
        if self.stop_at is StopAt.DENOISED:
            known = self.error_metric is not Metric.DISPLAY
            require(known, "the error of a denoised picture is measured as relmse or rmse, not on a display", "stop_at")
        if self.stop_at is StopAt.MIX:
            known = self.error_metric is not Metric.DISPLAY
            require(known, "the error of a mix of lights is measured as relmse or rmse, not on a display", "stop_at")
            require(self.target_error is not None, "stop_at mix needs target_error, the error of the mix to stop at", "stop_at")
        sentence = "mixes and stop_at mix go together: weights of lights, and the error of the picture with them to stop at"
        require((self.stop_at is StopAt.MIX) == bool(self.mixes), sentence, "mixes")
        if self.sample_range is not None:
            self._check_range(*self.sample_range)
        self.composition  # noqa: B018 - checks itself

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
        whole = self.ground is not Ground.SHADOW and self.background is None
        require(
            whole, "a shadow on the ground and a background need a complete picture, not a range of samples", "sample_range"
        )


# Additions to the stage and settings that remove sampled light, with the values that add and remove nothing.
STAGING = {row.name: row.default for row in rows(RenderSettings) if row.counts is Counts.STAGING}
BIAS = {row.name: row.default for row in rows(RenderSettings) if row.counts is Counts.BIAS}


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


def settings_of_json(values: Mapping[str, Any], of: type[RenderSettings] = RenderSettings) -> RenderSettings:
    """Return the settings that settings_as_json wrote; TypeError or ValueError for unknown names or choices."""
    chosen = {
        row.name: row.read.kinds(values[row.name])
        for row in rows(of)
        if isinstance(row.read, choice) and values.get(row.name) is not None
    }
    for name in ("camera", "dicing_camera"):
        if isinstance(values.get(name), Mapping):
            from ..camera import camera_of

            chosen[name] = camera_of(values[name])
    return of(**{**values, **chosen})
