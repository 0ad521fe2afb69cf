"""Which camera looks and how many pixels it fills: the user's choice, else the stage's, else what usdrecord would do."""

from __future__ import annotations

from collections.abc import Callable

from pxr import Sdf, Usd

from ...description import Camera, Frame
from ...description.frame import pixels_within
from ...errors import InvalidSceneError, LimitError, SettingsError
from ...settings import MAX_RESOLUTION, limit_pixels
from ..adapters.cameras.camera import Aperture, camera, pixel_aspect_ratio, read_aperture
from ..adapters.rendering.render_product import ProductSettings
from ..opening.stage_metadata import up_axis
from ..querying.guarded import type_name
from ..resolving.context import Context
from ..resolving.stage_bounds import Bounds
from .asked_camera import aperture_of, conformed
from .framing import APERTURE, framing_camera

DEFAULT_WIDTH = 960  # usdrecord's


def select_camera(stage: Usd.Stage, ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Usd.Prim | None:
    """The camera's prim; None where none of the stage's is to look. SettingsError when the one asked for does not exist."""
    asked = ctx.settings.camera
    if asked is not None:
        return _asked_for(stage, asked, cameras) if isinstance(asked, str) else None
    if product.camera is not None:
        prim = stage.GetPrimAtPath(product.camera)
        if prim and type_name(prim) == "Camera":
            return prim
        ctx.warn("render-settings-input", product.camera, "The camera that RenderSettings names does not exist.")
    if len(cameras) > 1:
        others = ", ".join(str(c.GetPath()) for c in cameras[1:6])
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), f"The first of {len(cameras)} cameras is used; others: {others}.")
    elif cameras:
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), "The stage's only camera is used.")
    return cameras[0] if cameras else None


def view_through(
    prim: Usd.Prim | None, ctx: Context, product: ProductSettings, bounds: Callable[[], Bounds]
) -> tuple[Camera, Frame]:
    """The camera, conformed to the image, and the image's frame; `bounds` of the world are asked for only without a camera."""
    asked = ctx.settings.camera
    if asked is not None and not isinstance(asked, str):
        aperture = aperture_of(asked)
    else:
        aperture = read_aperture(prim, ctx.when, ctx.diagnostics) if prim is not None else APERTURE
    resolution = _scaled(_resolution(ctx.settings.resolution, product, aperture), ctx.settings.resolution_scale)
    frame = _frame(resolution, product, pixel_aspect_ratio(aperture, resolution, product))
    if asked is not None and not isinstance(asked, str):
        return conformed(asked, aperture, resolution, product), frame
    if prim is not None:
        return camera(prim, ctx.when, resolution, product, ctx.diagnostics), frame
    ctx.warn("camera-automatic", "", "The stage has no camera: it is framed as usdrecord would.")
    z_up = up_axis(ctx.stage) == "Z"
    return framing_camera(bounds(), z_up, resolution, product), frame


def _asked_for(stage: Usd.Stage, asked: str, cameras: list[Usd.Prim]) -> Usd.Prim:
    """The camera of this path or, if only one has it, of this name."""
    if Sdf.Path.IsValidPathString(asked) and Sdf.Path(asked).IsAbsolutePath():
        prim = stage.GetPrimAtPath(asked)
        if prim and type_name(prim) == "Camera":
            return prim
    named = [c for c in cameras if c.GetName() == asked]
    if len(named) == 1:
        return named[0]
    listed = ", ".join(str(c.GetPath()) for c in (named or cameras)[:20]) or "none"
    problem = f"Several cameras are called {asked}" if named else f"There is no camera {asked}"
    raise SettingsError(f"{problem}; the stage's cameras: {listed}.", where=asked, code="unknown-camera")


def _resolution(asked: tuple[int, int] | None, product: ProductSettings, aperture: Aperture) -> tuple[int, int]:
    """A width or height of 0 follows from the other by the camera's aspect."""
    width, height = asked or product.resolution or (DEFAULT_WIDTH, 0)
    # Where pixels may take any shape, they are square.
    square = product.conform_policy == "adjustPixelAspectRatio"
    aspect = aperture.aspect / (1.0 if square else product.pixel_aspect_ratio)
    if width < 0 or height < 0 or (width == 0 and height == 0):
        raise SettingsError(f"An image of {width} x {height} pixels cannot be made.", code="resolution")
    if height == 0:
        height = max(1, round(width / aspect))
    elif width == 0:
        width = max(1, round(height * aspect))
    return width, height


def _scaled(resolution: tuple[int, int], scale: float) -> tuple[int, int]:
    """LimitError if that is too large."""
    width, height = (max(1, round(side * scale)) for side in resolution)
    limit_pixels(width, height)
    return width, height


def _frame(resolution: tuple[int, int], product: ProductSettings, aspect_ratio: float) -> Frame:
    """The part of it that the data window asks for; SceneError or LimitError where that cannot be rendered."""
    where = product.path or product.settings_path
    if max(abs(side) for side in product.data_window) * max(resolution) > MAX_RESOLUTION:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        raise LimitError(f"dataWindowNDC = ({sides}) lies more than {MAX_RESOLUTION} pixels outside", where=where)
    pixels = pixels_within(product.data_window, resolution)
    if pixels.width == 0 or pixels.height == 0:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        message = f"dataWindowNDC = ({sides}) holds no pixel's centre: there is nothing to render"
        raise InvalidSceneError(message, where=where, code="empty-data-window")
    limit_pixels(pixels.width, pixels.height, where)
    return Frame(resolution, pixels, aspect_ratio)
