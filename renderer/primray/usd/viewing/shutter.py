"""When the picture's shutter is open: as the user says, as render settings limit it, or as its camera says."""

from __future__ import annotations

from pxr import Usd

from ...description import Camera
from ..adapters.cameras.shutter import INSTANT, Shutter, read_shutter
from ..adapters.rendering.render_product import ProductSettings
from ..moving.timing import AT_FRAME, Timing
from ..resolving.context import Context
from ..resolving.read import has_samples_or_clips


def shutter_of(camera: Usd.Prim | None, ctx: Context, product: ProductSettings) -> Shutter:
    """disableMotionBlur makes it that of the frame alone, instantaneousShutter close when it opens (UsdRenderSettingsBase)."""
    if not ctx.settings.motion_blur or product.disable_motion_blur:
        return INSTANT
    is_instant = product.instantaneous_shutter
    if ctx.settings.shutter is not None:
        opens, closes = ctx.settings.shutter
        if is_instant:
            return opens, opens
        if opens <= closes:
            return opens, closes
        message = f"The shutter closes at {closes:g}, before it opens at {opens:g}: the picture is black."
        ctx.warn("camera-input", "", message)
        return None
    if isinstance(ctx.settings.camera, Camera):
        opens, closes = ctx.settings.camera.shutter
        return opens, opens if is_instant else closes
    return INSTANT if camera is None else read_shutter(camera, ctx.when, ctx.diagnostics, is_instant=is_instant)


def timing_of(shutter: Shutter, with_frame: bool, ctx: Context, vectors: Shutter = None) -> Timing:
    """`with_frame`: AOVs show the frame's instant; `vectors`: the shutter that a still's motion vectors are over. Nothing moves
    in a picture that is black."""
    if vectors is not None and not vectors[0] < vectors[1]:
        vectors = None
    if shutter is None or (shutter == INSTANT and vectors is None):
        return AT_FRAME
    is_timed = ctx.when.careful if ctx.when.is_default else has_samples_or_clips(ctx.stage)
    return Timing(*shutter, with_frame=with_frame, is_timed=is_timed, vectors=vectors)


def shutter_of_vectors(camera: Usd.Prim | None, shutter: Shutter, ctx: Context) -> Shutter:
    """What a still's motion vectors are over: the shutter that it would have with motion blur, by the user or the camera."""
    if shutter is None or shutter[0] < shutter[1]:
        return None
    if ctx.settings.shutter is not None:
        return ctx.settings.shutter
    if isinstance(ctx.settings.camera, Camera):
        return ctx.settings.camera.shutter
    return None if camera is None else read_shutter(camera, ctx.when, ctx.diagnostics)
