"""Brightness of a picture in a view: detection of nearly white or black results, and automatic exposure.

Only pixels with coverage or light are considered, and a regular subset of them in large pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles, Floats
from ..color import ocio as color
from ..color.color_space import LUMINANCE_WEIGHTS, REC709, ColorSpace
from ..diagnostic_codes import CODES
from ..diagnostics import Diagnostic
from ..settings import MAX_STOPS

AUTO = "auto"
CODE, ASSUMED = "view-exposure", "view-space-assumed"
WEAK = " If the stage's lights are too weak, --studio-light on adds one."
MOST_PIXELS = 1 << 14
# Display values, nominally 0 to 1, of a pixel's darkest (or brightest) channel.
WHITE, BLACK = 0.95, 0.05
ALMOST = 0.8  # share of the visible pixels
# Automatic exposure shows the brightest twentieth at BRIGHT, with the median at most DARKEST_STOPS below mid-grey.
BRIGHT, BRIGHTEST_SHARE = 0.82, 0.95
GREY, DARKEST_STOPS = 0.35, 1.0
SAME_STOPS = 0.05  # advice is rounded to tenths of stops
BLOCK = 8  # pixels across; a block in which no sample of the record has light is black


@dataclass(frozen=True)
class View:
    """How a picture is converted for display; None selects OpenColorIO's default."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    space: ColorSpace = REC709  # colour space of the pixels

    def shown(self, rgb: Floats, exposure: float = 0.0) -> Floats:
        """Return display values, nominally 0 to 1, of scene-linear (H, W, 3); `exposure` in stops."""
        return color.to_display(rgb, self.view, self.display, exposure, look=self.look, space=self.space)

    def check(self) -> None:
        """Raise SettingsError if the OpenColorIO configuration cannot make the view. Called before sampling."""
        color.check_display(self.view, self.display, self.look, self.space)

    def assumption(self) -> Diagnostic | None:
        """Return a diagnostic if the view rests on an assumption about the configuration, else None."""
        assumed = color.assumed_space(self.space)
        return None if assumed is None else Diagnostic(CODES[ASSUMED].severity, ASSUMED, "", assumed)


def as_viewed(pixels: Floats, *, keep_alpha: bool | None = None) -> tuple[Floats, Floats | None]:
    """Return the colours (H, W, 3) that a view converts and the alpha (H, W, 1) beside them, from (H, W, 4) premultiplied.

    Without alpha (None) the picture is over black. `keep_alpha=None` is for pixels of unknown origin: they have alpha unless
    everything is covered, or there is light without coverage.
    """
    finite = np.where(np.isfinite(pixels), pixels, np.float32(0))
    rgb, alpha = finite[..., :3], np.clip(finite[..., 3:], 0, 1)
    if not (needs_alpha(finite) if keep_alpha is None else keep_alpha):
        return rgb, None
    return np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0), alpha


def needs_alpha(pixels: Floats) -> bool:
    """Return whether (H, W, 4) finite premultiplied pixels look as if their alpha were for compositing."""
    alpha = np.clip(pixels[..., 3], 0, 1)
    background_shines = bool(np.any(pixels[alpha == 0, :3] > 0))
    return not background_shines and not bool(np.all(alpha == 1))


def view_fault(
    pixels: Floats, view: View, exposure: float = 0.0, *, is_auto: bool = False, lacks_textures: bool = False
) -> Diagnostic | None:
    """Return a diagnostic if the view shows (H, W, 4) premultiplied pixels as almost only white or black, else None.

    `is_auto`: the exposure was chosen for this picture, or for the first of its sequence.
    """
    seen = _seen(pixels)
    if not len(seen) or not seen.any():
        return None
    shown = view.shown(seen[None], exposure)[0]
    white, black = np.mean(shown.min(axis=1) >= WHITE), np.mean(shown.max(axis=1) <= BLACK)
    if max(white, black) < ALMOST:
        return None
    stops = exposure_that_serves(pixels, view)
    what = "white" if white > black else "black"
    advice = f"try --exposure {stops:.1f}" + ("" if is_auto else ", or --exposure auto")
    if abs(stops - exposure) < SAME_STOPS:
        advice = "no other exposure would show more"
    if lacks_textures and black >= white:
        advice = f"missing textures are black, so provide them first; otherwise {advice}"
    message = f"{max(white, black):.0%} of the visible picture is almost {what}: {advice}."
    if what == "black" and not lacks_textures:
        message += WEAK
    return Diagnostic(CODES[CODE].severity, CODE, "", message)


def exposure_that_serves(pixels: Floats, view: View) -> float:
    """Return the automatic exposure in stops, to a hundredth.

    The brightest parts are near the top of the view's range, unless the rest would be too dark.
    """
    seen = _seen(pixels)
    level: Doubles = seen.astype(np.float64) @ np.array(LUMINANCE_WEIGHTS)
    level = level[level > 0]
    if not len(level):
        return 0.0
    bright, grey = _levels_shown_as(view, (BRIGHT, GREY))
    fit = np.log2(bright / np.quantile(level, BRIGHTEST_SHARE))
    least = np.log2(grey / np.median(level)) - DARKEST_STOPS
    return round(float(np.clip(max(fit, least), -MAX_STOPS, MAX_STOPS)), 2)


def where_lit(pixels: Floats, record: Floats) -> Floats:
    """Return a denoised picture (H, W, 4), made black in blocks where its record has no light at all.

    A denoiser leaves about a millionth there, which would count as visible.
    """
    height, width = record.shape[:2]
    lit = np.zeros((-(-height // BLOCK) * BLOCK, -(-width // BLOCK) * BLOCK), bool)
    lit[:height, :width] = (record[..., :3] > 0).any(axis=2)
    blocks = lit.reshape(lit.shape[0] // BLOCK, BLOCK, -1, BLOCK).any(axis=(1, 3))
    if blocks.all():
        return pixels
    whole = np.repeat(np.repeat(blocks, BLOCK, axis=0), BLOCK, axis=1)[:height, :width]
    return np.concatenate([pixels[..., :3] * whole[..., None], pixels[..., 3:]], axis=2)


def _seen(pixels: Floats) -> Floats:
    """Return the straight colours (N, 3) of pixels that have light or coverage."""
    flat = pixels.reshape(-1, pixels.shape[-1])
    rgb = np.where(np.isfinite(flat[:, :3]), flat[:, :3], np.float32(0))
    alpha = flat[:, 3:] if flat.shape[1] > 3 else np.ones((len(flat), 1), np.float32)
    there = np.flatnonzero((alpha[:, 0] > 0) | (rgb > 0).any(axis=1))
    there = there[:: max(1, len(there) // MOST_PIXELS)]
    rgb, alpha = rgb[there], np.clip(alpha[there], 0, 1)
    return np.divide(rgb, alpha, out=rgb.copy(), where=alpha > 0)


def _levels_shown_as(view: View, wanted: tuple[float, ...]) -> Doubles:
    """Return the grey levels that the view shows as the `wanted` values, by a table; views increase from black to white."""
    levels = np.exp2(np.linspace(-14, 10, 193))
    shown = view.shown(np.repeat(levels[:, None], 3, axis=1)[None].astype(np.float32))[0].mean(axis=1)
    rising = np.maximum.accumulate(np.nan_to_num(shown).astype(np.float64))
    found: Doubles = np.exp2(np.interp(wanted, rising, np.log2(levels)))
    return found
