"""Shutter and camera before skeletons pose the stage, to choose how finely poses are sampled."""

from __future__ import annotations

from dataclasses import replace

from pxr import Usd

from ...diagnostics import Diagnostics
from ..adapters.cameras.camera import camera as read_camera
from ..adapters.cameras.shutter import Shutter
from ..adapters.rendering.render_product import ProductSettings
from ..moving.foreseen import Foreseen
from ..moving.pixels import pixels_of
from ..scene.context import Context
from .camera_path import camera_when
from .shutter import shutter_of, timing_of
from .view import select_camera, view_without_things


def foreseen(ctx: Context, product: ProductSettings, cameras: list[Usd.Prim]) -> Foreseen:
    """Return the shutter and camera of the render.

    Diagnostics here are discarded (`ctx` has its own list); they are reported when the posed stage is translated.
    """
    prim = select_camera(ctx.stage, ctx, product, cameras)
    shutter = shutter_of(prim, ctx, product)
    return as_seen(prim, shutter, replace(ctx, timing=timing_of(shutter, False, ctx)), product)


def as_seen(prim: Usd.Prim | None, shutter: Shutter, ctx: Context, product: ProductSettings) -> Foreseen:
    """Return the same for a camera's prim (None: without one) and shutter, at `ctx.timing`."""
    timing, ctx = ctx.timing, replace(ctx, diagnostics=Diagnostics())
    if timing.is_frame:
        return Foreseen(timing)
    camera, frame = view_without_things(prim, ctx, product, shutter)
    most, side = ctx.settings.most_motion_error, max(frame.resolution)
    if camera is None:
        return Foreseen(timing, most, None, side)
    seen = [camera]
    if prim is not None:
        for offset in (timing.opens, 0.5 * (timing.opens + timing.closes), timing.closes):
            then = camera_when(prim, ctx, offset)
            seen.append(read_camera(prim, ctx.when, frame.resolution, product, shutter, Diagnostics(), then))
    return Foreseen(timing, most, pixels_of(seen, frame.resolution), side)
