"""The forms that each setting may be given in, and their readers."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Literal, TypedDict

from ..camera_choice import Matrix, camera_choice, lens_flaws
from ..setting_values import Reader, choice, four_numbers, number, optional, pair, text, texts, two_numbers, whole, yes_or_no
from .choices import AutoCamera, DefaultWrap, Eye, Filter, Ground, Metric, RenderContext, StopAt, StudioLight

if TYPE_CHECKING:
    from ..camera import Camera

# Settings of the lens's diffusion, with the fields of Diffusion that they set.
DIFFUSION = {
    "diffusion": "strength",
    "diffusion_glare": "glare",
    "diffusion_bloom_width": "bloom_width",
    "diffusion_starburst": "starburst",
    "diffusion_starburst_width": "starburst_width",
}
# Settings that files and reports include only if they are set.
SELDOM = (*DIFFUSION, "eye", "region", "joint_products")


# Additions to the stage, with the values that add nothing, which files and reports leave out.
STAGING: Mapping[str, object] = {
    "studio_light": StudioLight.AUTO,
    "dome": None,
    "dome_rotation": 0.0,
    "dome_visible": True,
    "ground": None,
    "background": None,
    "orbit_deg": 0.0,
}


# Settings that remove sampled light from the picture, with the values that remove none, which files and reports leave out.
BIAS: Mapping[str, object] = {"clamp_indirect": None, "caustics": True}


class SettingsValues(TypedDict, total=False):
    """The types accepted for the fields of RenderSettings, by the same names."""

    camera: str | Camera | Matrix | Iterable[Iterable[float]] | None
    auto_camera: AutoCamera | Literal["three-quarter", "usdrecord"]
    render_settings: str | None
    render_pass: str | None
    product: str | None
    joint_products: Iterable[str] | None
    resolution: Iterable[int] | None
    resolution_scale: float
    time_code: float | None
    spp: int | None
    target_error: float | None
    error_metric: Metric | Literal["relmse", "rmse", "display"] | None
    time_limit_s: float | None
    denoise: bool | None
    stop_at: StopAt | Literal["picture", "denoised"]
    adaptive: bool | None
    sample_range: Iterable[int] | None
    max_depth: int | None
    clamp_indirect: float | None
    caustics: bool
    filter: Filter | Literal["box", "gaussian", "blackman-harris"] | None
    filter_width: float | None
    threads: int | None
    seed: int
    default_light: bool
    studio_light: StudioLight | Literal["auto", "on", "off"]
    dome: str | os.PathLike[str] | None
    dome_rotation: float
    dome_visible: bool
    ground: Ground | Literal["shadow", "plane"] | None
    background: str | os.PathLike[str] | None
    orbit_deg: float
    default_wrap: DefaultWrap | Literal["black", "clamp", "repeat", "mirror"]
    render_context: RenderContext | Literal["mtlx", "universal"]
    translated_shaders: bool
    rendering_color_space: str | None
    purposes: Iterable[str] | None
    aovs: Iterable[str] | None
    aov_errors: bool
    strict: bool
    fail_on: Iterable[str]
    allow: Iterable[str]
    max_memory_bytes: int | None
    dicing_rate: float
    motion_blur: bool
    shutter: Iterable[float] | None
    motion_error: float | None
    diffusion: float | None
    diffusion_glare: float | None
    diffusion_bloom_width: float | None
    diffusion_starburst: float | None
    diffusion_starburst_width: float | None
    eye: Eye | Literal["left", "right"] | None
    lens_flaws: Iterable[str]
    region: Iterable[float] | None
    variants: Iterable[str]
    load: Iterable[str] | None
    mask: Iterable[str] | None
    session_layer: str | os.PathLike[str] | None


_WHOLE, _NUMBER, _TEXT, _TEXTS, _PAIR = (optional(read) for read in (whole, number, text, texts, pair))
READERS: Mapping[str, Reader] = {
    "camera": optional(camera_choice),
    **dict.fromkeys(
        ("render_settings", "render_pass", "product", "rendering_color_space", "session_layer", "dome", "background"), _TEXT
    ),
    **dict.fromkeys(("resolution", "sample_range"), _PAIR),
    **dict.fromkeys(("time_code", "target_error", "time_limit_s", "filter_width", "motion_error", "clamp_indirect"), _NUMBER),
    **dict.fromkeys(("spp", "max_depth", "threads", "max_memory_bytes"), _WHOLE),
    **dict.fromkeys(("purposes", "aovs", "load", "mask", "joint_products"), _TEXTS),
    **dict.fromkeys(
        ("default_light", "dome_visible", "strict", "motion_blur", "aov_errors", "translated_shaders", "caustics"), yes_or_no
    ),
    **dict.fromkeys(DIFFUSION, _NUMBER),
    "eye": optional(choice(Eye)),
    "shutter": optional(two_numbers),
    **dict.fromkeys(("adaptive", "denoise"), optional(yes_or_no)),
    "auto_camera": choice(AutoCamera),
    "error_metric": optional(choice(Metric)),
    "stop_at": choice(StopAt),
    "filter": optional(choice(Filter)),
    "default_wrap": choice(DefaultWrap),
    "studio_light": choice(StudioLight),
    "ground": optional(choice(Ground)),
    "render_context": choice(RenderContext),
    "seed": whole,
    **dict.fromkeys(("dicing_rate", "resolution_scale", "dome_rotation", "orbit_deg"), number),
    "lens_flaws": lens_flaws,
    "region": optional(four_numbers),
    **dict.fromkeys(("variants", "fail_on", "allow"), texts),
}
