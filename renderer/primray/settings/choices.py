"""Enumerations of settings."""

from __future__ import annotations

from enum import Enum


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
    """Which error a target applies to: the picture's, or the denoised picture's.

    >>> primray.RenderSettings(target_error=0.01, stop_at="denoised").denoises
    True
    """

    PICTURE = "picture"
    DENOISED = "denoised"


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
