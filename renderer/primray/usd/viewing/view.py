"""Choice of the camera and of the image's resolution.

The camera is the user's choice, else the stage's, else the view that the authoring tool's viewport showed last, else an
automatic one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from pxr import Sdf, Usd

from ...camera_choice import Matrix, flaws_of
from ...description import Camera, Frame
from ...description.frame import pixels_within
from ...diagnostics import Diagnostics
from ...errors import InvalidSceneError, LimitError, SettingsError
from ...settings import MAX_RESOLUTION, AutoCamera, limit_pixels
from ..adapters.cameras.camera import Aperture, camera, note_one_eye, pixel_aspect_ratio, read_aperture
from ..adapters.cameras.flaws import with_flaws
from ..adapters.cameras.shutter import Shutter
from ..adapters.rendering.render_product import ProductSettings
from ..scene.bounds import Bounds
from ..scene.context import Context
from ..stage.metadata import up_axis
from ..stage.reads import type_name
from .asked_camera import aperture_of, conformed, with_shutter
from .camera_path import camera_when
from .drawn import Drawn
from .framing import APERTURE, framing_camera
from .stereo import eye_of_pair
from .three_quarter import three_quarter_camera
from .viewport_camera import bound_camera, viewport_camera

DEFAULT_WIDTH = 960  # usdrecord's default
NAMED = 5  # prims named in a message among those outside of the automatic camera's frame


def select_camera(stage: Usd.Stage, ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Usd.Prim | None:
    """Return the prim of the camera, or of the requested eye of its stereo pair; None if no camera of the stage is to be used.

    SettingsError if the camera asked for does not exist.
    """
    eye = ctx.settings.eye
    if eye is None:
        return _chosen(stage, ctx, product, cameras)
    if ctx.settings.camera is not None and not isinstance(ctx.settings.camera, str):
        raise SettingsError(
            "a camera that is not a prim has no stereo pair: render each eye with its own camera",
            where="eye",
            code="stereo-pair",
        )
    is_named = ctx.settings.camera is not None or product.camera is not None
    chosen = _chosen(stage, ctx, product, cameras) if is_named else bound_camera(ctx)
    return eye_of_pair(chosen, cameras, eye, ctx.when)


def _chosen(stage: Usd.Stage, ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Usd.Prim | None:
    asked = ctx.settings.camera
    if asked is not None:
        return _asked_for(stage, asked, cameras) if isinstance(asked, str) else None
    if product.camera is not None:
        prim = stage.GetPrimAtPath(product.camera)
        if prim and type_name(prim) == "Camera":
            return prim
        ctx.warn("render-settings-input", product.camera, "The camera that RenderSettings names does not exist.")
    if ctx.settings.auto_camera is not AutoCamera.USDRECORD and (bound := bound_camera(ctx)) is not None:
        return bound
    if len(cameras) > 1:
        others = ", ".join(str(c.GetPath()) for c in cameras[1:6])
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), f"The first of {len(cameras)} cameras is used; others: {others}.")
    elif cameras:
        ctx.warn("camera-chosen", str(cameras[0].GetPath()), "The stage's only camera is used.")
    return cameras[0] if cameras else None


def view_through(
    prim: Usd.Prim | None,
    ctx: Context,
    product: ProductSettings,
    shutter: Shutter,
    bounds: Callable[[], Bounds],
    drawn: Callable[[], Drawn],
) -> tuple[Camera, Frame]:
    """Return the camera, conformed to the image, and the image's frame.

    The scene's `bounds` (as usdrecord computes them) or objects (`drawn`) are only needed to make an automatic camera.
    """
    found, frame = view_without_things(prim, ctx, product, shutter)
    if found is not None:
        if prim is not None and ctx.settings.eye is None:
            note_one_eye(prim, ctx.when, ctx.diagnostics)
        return _with_flaws(found, prim, ctx), frame
    resolution = frame.resolution
    z_up = up_axis(ctx.stage) == "Z"
    if ctx.settings.auto_camera is AutoCamera.USDRECORD:
        ctx.warn("camera-automatic", "", "The stage has no camera: usdrecord's framing is used.")
        return _with_flaws(with_shutter(framing_camera(bounds(), z_up, resolution, product), shutter), None, ctx), frame
    has_ground = ctx.settings.ground is not None
    made, left_out = three_quarter_camera(drawn(), z_up, resolution, product, has_ground=has_ground)
    ctx.warn(
        "camera-automatic",
        "",
        f"The stage has no camera: an automatic three-quarter view from above is used{_without(left_out)}.",
    )
    return _with_flaws(with_shutter(made, shutter), None, ctx), frame


def _with_flaws(found: Camera, prim: Usd.Prim | None, ctx: Context) -> Camera:
    return with_flaws(found, prim if found.path else None, flaws_of(ctx.settings.lens_flaws), ctx.when, ctx.diagnostics)


def view_without_things(
    prim: Usd.Prim | None, ctx: Context, product: ProductSettings, shutter: Shutter
) -> tuple[Camera | None, Frame]:
    """Return the camera and frame without looking at the scene; None for the camera if an automatic one has to be made."""
    asked = _camera_without_prim(prim, ctx)
    if asked is not None:
        aperture = aperture_of(asked)
    else:
        aperture = read_aperture(prim, ctx.when, ctx.diagnostics) if prim is not None else APERTURE
    resolution = _scaled(_resolution(ctx.settings.resolution, product, aperture), ctx.settings.resolution_scale)
    if ctx.settings.region is not None:
        product = replace(product, data_window=ctx.settings.region)
    frame = _frame(resolution, product, pixel_aspect_ratio(aperture, resolution, product))
    if asked is not None:
        return conformed(asked, aperture, resolution, product, shutter), frame
    if prim is not None:
        still = camera_when(prim, ctx, ctx.timing.opens) if not ctx.timing.is_open else None
        return camera(prim, ctx.when, resolution, product, shutter, ctx.diagnostics, still), frame
    return None, frame


def lines_of(prim: Usd.Prim | None, ctx: Context, product: ProductSettings) -> tuple[int, int]:
    """Return columns and rows of the image through a camera of the stage."""
    aperture = read_aperture(prim, ctx.when, Diagnostics()) if prim is not None else APERTURE
    return _scaled(_resolution(ctx.settings.resolution, product, aperture), ctx.settings.resolution_scale)


def _camera_without_prim(prim: Usd.Prim | None, ctx: Context) -> Camera | Matrix | None:
    """Return the user's camera without a prim or, if there is no camera at all, the one of the author's viewport."""
    asked = ctx.settings.camera
    if asked is not None and not isinstance(asked, str):
        return asked
    return viewport_camera(ctx) if prim is None and ctx.settings.auto_camera is not AutoCamera.USDRECORD else None


def _without(left_out: list[str]) -> str:
    if not left_out:
        return ""
    more = f" and {len(left_out) - NAMED} more" if len(left_out) > NAMED else ""
    return f"; left out of the framing, far larger or farther than the rest: {', '.join(left_out[:NAMED])}{more}"


def _asked_for(stage: Usd.Stage, asked: str, cameras: list[Usd.Prim]) -> Usd.Prim:
    """Return the camera of this path or, if only one has it, of this name; SettingsError otherwise."""
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
    """Return the resolution; a width or height of 0 follows from the other by the camera's aspect ratio."""
    width, height = asked or product.resolution or (DEFAULT_WIDTH, 0)
    # If the policy adjusts the pixel aspect ratio, a free side is chosen for square pixels.
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
    """Return the scaled resolution, at least 1 x 1; LimitError if it is too large."""
    width, height = (max(1, round(side * scale)) for side in resolution)
    limit_pixels(width, height)
    return width, height


def _frame(resolution: tuple[int, int], product: ProductSettings, aspect_ratio: float) -> Frame:
    """Return the frame with the pixels of the data window; InvalidSceneError or LimitError if they cannot be rendered."""
    where = product.path or product.settings_path
    if max(abs(side) for side in product.data_window) * max(resolution) > MAX_RESOLUTION:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        raise LimitError(f"dataWindowNDC = ({sides}) lies more than {MAX_RESOLUTION} pixels outside", where=where)
    pixels = pixels_within(product.data_window, resolution)
    if pixels.width == 0 or pixels.height == 0:
        sides = ", ".join(f"{side:g}" for side in product.data_window)
        message = f"dataWindowNDC = ({sides}) contains no pixel centre: there is nothing to render"
        raise InvalidSceneError(message, where=where, code="empty-data-window")
    limit_pixels(pixels.width, pixels.height, where)
    return Frame(resolution, pixels, aspect_ratio)
