"""What a user asks of a render: the settings, what they may be, and how they are read. Names are imported from here."""

from .choices import (
    DEFAULT_FILTER_WIDTH,
    AutoCamera,
    DefaultWrap,
    Eye,
    Filter,
    Ground,
    Metric,
    RenderContext,
    StopAt,
    StudioLight,
)
from .from_json import settings_of_json
from .limits import (
    DEFAULT_DICING_RATE,
    DEFAULT_MOTION_ERROR,
    DEFAULT_SPP,
    MAX_PIXELS,
    MAX_RESOLUTION,
    MAX_SPP,
    MAX_THREADS,
    QUICK_LOOK,
    SAMPLE_BLOCK,
    limit_pixels,
)
from .render_settings import PURPOSES, RenderSettings, with_values
from .written import BIAS, DIFFUSION, SELDOM, STAGING, SettingsValues

__all__ = [
    "BIAS",
    "DEFAULT_DICING_RATE",
    "DEFAULT_FILTER_WIDTH",
    "DEFAULT_MOTION_ERROR",
    "DEFAULT_SPP",
    "DIFFUSION",
    "MAX_PIXELS",
    "MAX_RESOLUTION",
    "MAX_SPP",
    "MAX_THREADS",
    "PURPOSES",
    "QUICK_LOOK",
    "SAMPLE_BLOCK",
    "SELDOM",
    "STAGING",
    "AutoCamera",
    "DefaultWrap",
    "Eye",
    "Filter",
    "Ground",
    "Metric",
    "RenderContext",
    "RenderSettings",
    "SettingsValues",
    "StopAt",
    "StudioLight",
    "limit_pixels",
    "settings_of_json",
    "with_values",
]
