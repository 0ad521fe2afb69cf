"""What may be chosen from: settings that are one of a few words."""

from __future__ import annotations

from enum import Enum


class Filter(Enum):
    """The pixel filter, by which samples are weighted.

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
    """Whose error a target is of: the picture's, or its denoised form's.

    >>> primray.RenderSettings(target_error=0.01, stop_at="denoised").denoises
    True
    """

    PICTURE = "picture"
    DENOISED = "denoised"


class DefaultWrap(Enum):
    """What textures show outside of their image where neither the stage nor the file names a wrap (UsdUVTexture's are black).

    >>> primray.RenderSettings(default_wrap="repeat").default_wrap
    <DefaultWrap.REPEAT: 'repeat'>
    """

    BLACK = "black"
    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


class RenderContext(Enum):
    """Which of a material's outputs counts where it has more than one: MaterialX's, or the universal one; then the others.

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
    """The view of a stage whose author left no camera: from three quarters, above, or usdrecord's, from the front.

    >>> primray.RenderSettings(auto_camera="usdrecord").auto_camera
    <AutoCamera.USDRECORD: 'usdrecord'>
    """

    THREE_QUARTER = "three-quarter"
    USDRECORD = "usdrecord"


class StudioLight(Enum):
    """When the studio light is there: where the stage has no light and what glows lights less than 35 % of what is seen, or
    always, or never.

    >>> primray.RenderSettings(studio_light="on").studio
    <StudioLight.ON: 'on'>
    """

    AUTO = "auto"
    ON = "on"
    OFF = "off"


class Ground(Enum):
    """A ground under all that is drawn: only the shadow that it receives, or a grey plane.

    >>> primray.RenderSettings(ground="shadow").ground
    <Ground.SHADOW: 'shadow'>
    """

    SHADOW = "shadow"
    PLANE = "plane"


# Full widths in pixels: the box that is the exact pixel average, and the widths at which the others look alike.
DEFAULT_FILTER_WIDTH = {Filter.BOX: 1.0, Filter.GAUSSIAN: 3.0, Filter.BLACKMAN_HARRIS: 3.0}
