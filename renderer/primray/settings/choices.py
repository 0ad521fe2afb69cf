"""Enumerations of settings, their defaults and limits, and the refusal of requests beyond them."""

from __future__ import annotations

import math
from enum import Enum

from ..errors import LimitError, SettingsError


class Filter(Enum):
    """The pixel filter, which weights samples.

    >>> primray.RenderSettings(filter="gaussian").filter
    <Filter.GAUSSIAN: 'gaussian'>
    """

    BOX = "box"
    GAUSSIAN = "gaussian"
    BLACKMAN_HARRIS = "blackman-harris"


class Metric(Enum):
    """Measures of a picture's error; docs/error.md defines them.

    >>> primray.RenderSettings(target_error=0.01, error_metric="display").error_metric
    <Metric.DISPLAY: 'display'>
    """

    RELMSE = "relmse"
    RMSE = "rmse"
    DISPLAY = "display"


class StopAt(Enum):
    """Which error a target applies to: the picture's, the denoised picture's, or that of mixes of its lights.

    >>> primray.RenderSettings(target_error=0.01, stop_at="denoised").denoises
    True
    """

    PICTURE = "picture"
    DENOISED = "denoised"
    MIX = "mix"


class DefaultWrap(Enum):
    """Wrap mode of textures for which neither stage nor file names one (UsdUVTexture's specification: black).

    >>> primray.RenderSettings(default_wrap="repeat").default_wrap
    <DefaultWrap.REPEAT: 'repeat'>
    """

    BLACK = "black"
    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


class RenderContext(Enum):
    """Which of a material's outputs is preferred: MaterialX's, or the universal one. Others are used if it is missing.

    >>> primray.RenderSettings(render_context="universal").render_context
    <RenderContext.UNIVERSAL: 'universal'>
    """

    MTLX = "mtlx"
    UNIVERSAL = "universal"


class Eye(Enum):
    """An eye of a stereo pair of cameras, which UsdGeomCamera's stereoRole names.

    >>> primray.RenderSettings(eye="left").eye
    <Eye.LEFT: 'left'>
    """

    LEFT = "left"
    RIGHT = "right"


class Panorama(Enum):
    """A picture of all that is around the camera, or of the half in front of it (180): equirectangular, of one eye or two, or a
    cube's faces in columns.

    >>> primray.RenderSettings(panorama="cube").panorama
    <Panorama.CUBE: 'cube'>
    """

    LAT_LONG = "lat-long"
    LAT_LONG_180 = "lat-long-180"
    STEREO = "stereo"
    STEREO_180 = "stereo-180"
    STEREO_SIDE_BY_SIDE = "stereo-side-by-side"
    STEREO_180_SIDE_BY_SIDE = "stereo-180-side-by-side"
    CUBE = "cube"
    CUBE_2 = "cube-2"
    CUBE_3 = "cube-3"
    CUBE_6 = "cube-6"


class AutoCamera(Enum):
    """The automatic view of a stage without a camera: three-quarter from above, or usdrecord's, from the front.

    >>> primray.RenderSettings(auto_camera="usdrecord").auto_camera
    <AutoCamera.USDRECORD: 'usdrecord'>
    """

    THREE_QUARTER = "three-quarter"
    USDRECORD = "usdrecord"


class StudioLight(Enum):
    """When to add the studio light. auto: the stage has no light, and emission lights less than 35 % of what is visible.

    >>> primray.RenderSettings(studio_light="on").studio
    <StudioLight.ON: 'on'>
    """

    AUTO = "auto"
    ON = "on"
    OFF = "off"


class Ground(Enum):
    """A ground under the scene: only the shadow that it receives, or a grey plane.

    >>> primray.RenderSettings(ground="shadow").ground
    <Ground.SHADOW: 'shadow'>
    """

    SHADOW = "shadow"
    PLANE = "plane"


# Full widths in pixels: the box is the exact pixel average; the others have widths at which they look alike.
DEFAULT_FILTER_WIDTH = {Filter.BOX: 1.0, Filter.GAUSSIAN: 3.0, Filter.BLACKMAN_HARRIS: 3.0}


# Longest edge of diced subdivision surfaces, in pixels.
DEFAULT_DICING_RATE = 4.0
# Largest error of motion paths between time samples, in pixels.
DEFAULT_MOTION_ERROR = 0.02

# Requests beyond these limits are taken for mistakes or attacks.
MAX_RESOLUTION = 2**17  # per side: beyond, floats resolve less than 1 / 128 of a pixel
MAX_PIXELS = 2**28
MAX_SPP = 2**24
DEFAULT_SPP = 64
WHOLE = (0.0, 0.0, 1.0, 1.0)  # region of the whole frame, whatever part of it the stage orders
QUICK_LOOK = 4  # samples; renders of fewer skip the pilot
# Samples per pixel in a block, one for each replicate. Ranges of samples begin and end between blocks.
SAMPLE_BLOCK = 2
MAX_THREADS = 1024
MAX_STOPS = 100.0  # of exposure, up or down: beyond, floats overflow


def limit_pixels(width: int, height: int, where: str = "") -> None:
    """Raise LimitError if an image of this size is too large; `where`: the setting that requests it."""
    fits = max(width, height) <= MAX_RESOLUTION and width * height <= MAX_PIXELS
    limit(fits, f"{width} x {height} pixels are too many: at most {MAX_RESOLUTION} a side and {MAX_PIXELS} in all", where)


def check_stops(stops: float | str, where: str) -> float:
    """Return the exposure in stops; SettingsError if it is not a number within the limits."""
    try:
        number = float(stops)
    except (TypeError, ValueError):
        number = math.nan
    if not abs(number) <= MAX_STOPS:
        sentence = f"the exposure must be a number of stops from -{MAX_STOPS:g} to {MAX_STOPS:g}, or auto, not {stops}"
        raise SettingsError(sentence, where=where)
    return number


def require(holds: bool, sentence: str, name: str) -> None:
    if not holds:
        raise SettingsError(sentence, where=name)


def limit(holds: bool, sentence: str, where: str = "") -> None:
    if not holds:
        raise LimitError(sentence, where=where)
