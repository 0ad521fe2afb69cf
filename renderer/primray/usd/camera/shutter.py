"""Shutter of the image, which may roll: from the user's settings, limited by render settings, else from the camera.

Times are in time codes relative to the frame. A rolling shutter is that of OmniRtxRollingShutterAPI (NVIDIA's Omniverse), else
of PrimrayLensAPI; USD need not know these schemas. Names and meanings of the former are those of the ovrtx 0.7 documentation
("Rolling Shutter"): times are fractions (numerator, denominator) of a second.
"""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from ...description import Camera
from ...diagnostics import Diagnostics
from ..motion.timing import AT_FRAME, Rolling, Timing
from ..render_settings.render_product import ProductSettings
from ..scene.context import Context
from ..scene.schemas import ROLLING_SHUTTER
from ..stage.reads import property_names
from ..stage.values import When, has_samples_or_clips, number, token, vector

INSTANT = (0.0, 0.0)
Shutter = tuple[float, float] | None  # None: it closes before it opens, so that there is no exposure
SCAN_ORDER, LINE_OFFSET, LINE_EXPOSURE = (f"{ROLLING_SHUTTER}{name}" for name in ("scanOrder", "lineOffset", "lineExposure"))
READOUT = "primray:lens:rollingShutter:readout"  # time codes from the first row to the last
# The direction (x right, y down) in which lines are exposed one after the other.
SCAN_DIRECTIONS = {"topToBottom": (0, 1), "bottomToTop": (0, -1), "leftToRight": (1, 0), "rightToLeft": (-1, 0)}


def resolve_shutter(camera: Usd.Prim | None, ctx: Context, product: ProductSettings) -> Shutter:
    """Return the shutter; disableMotionBlur makes it the frame's instant, instantaneousShutter that of its opening."""
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


def resolve_scan(camera: Usd.Prim | None, shutter: Shutter, ctx: Context, product: ProductSettings) -> Scan | None:
    """Return the camera's rolling shutter; None if the user or the render settings decide when the shutter is open."""
    said = ctx.settings.shutter is not None or not ctx.settings.motion_blur
    if camera is None or shutter is None or said or product.disable_motion_blur or product.instantaneous_shutter:
        return None
    return read_scan(camera, ctx.when, ctx.diagnostics)


def line_exposures(scan: Scan, shutter: tuple[float, float], lines: tuple[int, int], time_codes_per_second: float) -> Rolling:
    """Return when each line is exposed; `lines` are the columns and rows of the image."""
    opens, closes = shutter
    if scan.line_exposure_s is not None:
        closes = opens + scan.line_exposure_s * time_codes_per_second
    offset = scan.readout / max(lines[1] - 1, 1) if scan.readout else scan.line_offset_s * time_codes_per_second
    across, down = (side * offset for side in scan.direction)
    # The last line of the frame may be the first that is exposed.
    later = max(-across, 0.0) * (lines[0] - 1) + max(-down, 0.0) * (lines[1] - 1)
    return Rolling(opens + later, closes + later, across, down)


def whole_shutter(rolling: Rolling, lines: tuple[int, int]) -> tuple[float, float]:
    """Return the time from the opening of the first line to the closing of the last."""
    of_last = rolling.per_column * (lines[0] - 1) + rolling.per_row * (lines[1] - 1)
    return rolling.opens + min(of_last, 0.0), rolling.closes + max(of_last, 0.0)


def render_timing(
    shutter: Shutter, with_frame: bool, ctx: Context, vectors: Shutter = None, rolling: Rolling | None = None
) -> Timing:
    """Return the times of a render; a shutter that is None (a black image) has no motion.

    `with_frame`: AOVs show the frame's instant. `vectors`: the shutter for motion vectors of an image without motion blur.
    """
    if vectors is not None and not vectors[0] < vectors[1]:
        vectors = None
    if shutter is None or (shutter == INSTANT and vectors is None):
        return AT_FRAME
    is_timed = ctx.when.careful if ctx.when.is_default else has_samples_or_clips(ctx.stage)
    return Timing(*shutter, with_frame=with_frame, is_timed=is_timed, vectors=vectors, rolling=rolling)


def report_closed_shutter(shutter: Shutter, vectors: Shutter, ctx: Context) -> None:
    """Report motion vectors that are 0 because the shutter is closed, on a stage that changes over time."""
    is_open = any(each is not None and each[0] < each[1] for each in (shutter, vectors))
    if not is_open and has_samples_or_clips(ctx.stage):
        message = (
            "Motion vectors are 0 everywhere: the shutter is closed. --shutter -0.25 0.25 opens it for half a frame; with "
            "--no-motion-blur the picture stays sharp."
        )
        ctx.warn("vectors-still", "", message)


def motion_vector_shutter(camera: Usd.Prim | None, shutter: Shutter, ctx: Context) -> Shutter:
    """Return the shutter for motion vectors of an image without motion blur: the one that it would have with it."""
    if shutter is None or shutter[0] < shutter[1]:
        return None
    if ctx.settings.shutter is not None:
        return ctx.settings.shutter
    if isinstance(ctx.settings.camera, Camera):
        return ctx.settings.camera.shutter
    return None if camera is None else read_shutter(camera, ctx.when, ctx.diagnostics)


def read_shutter(prim: Usd.Prim, when: When, diagnostics: Diagnostics, *, is_instant: bool = False) -> Shutter:
    """Return when the shutter opens and closes; with `is_instant` it closes when it opens, whatever is authored."""
    opens = number(prim, "shutter:open", when, 0.0, diagnostics)
    closes = opens if is_instant else number(prim, "shutter:close", when, 0.0, diagnostics)
    if closes < opens:
        message = f"The shutter closes at {closes:g}, before it opens at {opens:g}: the picture is black."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "shutter:close")
        return None
    return opens, closes


@dataclass(frozen=True)
class Scan:
    """Scan of a rolling shutter: direction of the lines, and offset and exposure of each."""

    direction: tuple[int, int]
    line_offset_s: float
    line_exposure_s: float | None  # None: as long as the camera's shutter is open
    readout: float = 0.0  # instead of line_offset_s: time codes from the first line to the last


def read_scan(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Scan | None:
    """Return the scan; None if the whole film is exposed at once."""
    order = token(prim, SCAN_ORDER, when, "none")
    if order == "none":
        readout = number(prim, READOUT, when, 0.0, diagnostics)
        return Scan((0, -1 if readout < 0 else 1), 0.0, None, abs(readout)) if readout else None
    if order not in SCAN_DIRECTIONS:
        message = f"{SCAN_ORDER} = {order} is unknown: the whole film is exposed at once."
        diagnostics.add("camera-input", str(prim.GetPath()), message, SCAN_ORDER)
        return None
    offset = _seconds(prim, LINE_OFFSET, when, diagnostics)
    exposure = _seconds(prim, LINE_EXPOSURE, when, diagnostics) if LINE_EXPOSURE in property_names(prim) else None
    return Scan(SCAN_DIRECTIONS[order], offset, exposure)


def _seconds(prim: Usd.Prim, name: str, when: When, diagnostics: Diagnostics) -> float:
    above, below = vector(prim, name, when, (0.0, 1.0), diagnostics)
    if below > 0 and above >= 0:
        return above / below
    message = f"{name} = ({above:g}, {below:g}) is not a fraction of a second: 0 is used."
    diagnostics.add("out-of-range", str(prim.GetPath()), message, name)
    return 0.0
