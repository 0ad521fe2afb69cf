"""Exposure of each line of the image by a rolling shutter, which depends on the number of lines."""

from __future__ import annotations

from pxr import Usd

from ..adapters.cameras.shutter import Shutter
from ..adapters.rendering.render_product import ProductSettings
from ..moving.timing import Rolling
from ..scene.context import Context
from ..stage.metadata import time_codes_per_second
from .shutter import rolling_of, scan_of, shutter_of, whole_shutter
from .view import lines_of


def exposed(camera: Usd.Prim | None, ctx: Context, product: ProductSettings) -> tuple[Shutter, Rolling | None]:
    """Return the whole shutter interval and the rolling shutter within it, None if all lines are exposed at once."""
    shutter = shutter_of(camera, ctx, product)
    scan = scan_of(camera, shutter, ctx, product)
    if scan is None or shutter is None:
        return shutter, None
    lines = lines_of(camera, ctx, product)
    rolling = rolling_of(scan, shutter, lines, time_codes_per_second(ctx.stage))
    return whole_shutter(rolling, lines), rolling
