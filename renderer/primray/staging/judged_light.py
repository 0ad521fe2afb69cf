"""The studio light of a stage that glows but has no lights: a small picture without it says whether it is needed.

An estimate from powers and areas would know neither what hides what glows nor what its textures show. The picture takes a few
thousand samples of a scene that is built at its size; only stages with emission and without lights pay for it. Its seed, size
and samples are fixed, so that every part and machine decides alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..description import SceneDescription, Surface
from ..diagnostics import Diagnostics
from ..settings import RenderSettings, StudioLight
from ..usd.lights.default_light import default_lights

if TYPE_CHECKING:
    from ..core import CoreScene

WIDE = 96  # pixels of the larger side
BLOCK = 4  # pixels: each block's mean is judged
SAMPLES = 3  # a pixel; a quick look, which no pilot comes before
# A block is dark below this radiance, after the camera's exposure: the default view shows it as 2 of 255.
DARK = 0.01
LEAST_LIT = 0.35  # of what is seen: with less, most of the picture would be black


def with_studio_where_dark(
    description: SceneDescription,
    settings: RenderSettings,
    diagnostics: Diagnostics,
    build: Callable[[SceneDescription, RenderSettings], CoreScene],
) -> SceneDescription:
    """Return the description with a studio light where what glows lights too little of what is seen."""
    if not _is_in_question(description, settings):
        return description
    share = _lit_share(description, settings, build)
    if share is None or share >= LEAST_LIT:
        return description
    diagnostics.add(
        "default-light",
        "",
        f"There is no light, and what glows lights {share:.0%} of what is seen: a studio light is added, which the camera does "
        "not see.",
    )
    return replace(description, lights=default_lights(description.camera, description.up_axis == "Z"))


def _is_in_question(description: SceneDescription, settings: RenderSettings) -> bool:
    """Lights that emit nothing are not in a description: translation adds the studio light where nothing glows."""
    if settings.studio is not StudioLight.AUTO or description.lights or not description.may_need_light:
        return False
    return any(map(_glows, description.surfaces))


def _glows(surface: Surface) -> bool:
    return any(value > 0 for value in surface.emissive_color) or "emissive_color" in surface.varying


def _lit_share(
    description: SceneDescription, settings: RenderSettings, build: Callable[[SceneDescription, RenderSettings], CoreScene]
) -> float | None:
    """Return how much of what the camera sees is not dark; None where it sees nothing."""
    from .. import core

    width, height = description.resolution
    scale = min(1.0, WIDE / max(width, height))
    small = (max(1, round(width * scale)), max(1, round(height * scale)))
    quick = RenderSettings(
        spp=SAMPLES, max_depth=settings.max_depth, threads=settings.threads, dicing_rate=settings.dicing_rate
    )
    scene = build(replace(description, resolution=small, pixels=None, aovs=()), quick)
    pixels, _ = core.render(scene, quick).image()
    return lit_share(pixels)


def lit_share(pixels: Floats) -> float | None:
    """Return, of (H, W, 4) premultiplied, the share of the coverage in blocks whose mean colour is not dark."""
    height, width = pixels.shape[:2]
    padded = np.zeros((-(-height // BLOCK) * BLOCK, -(-width // BLOCK) * BLOCK, 4))
    padded[:height, :width] = np.where(np.isfinite(pixels), pixels, 0)
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK, 4).sum(axis=(1, 3))
    covered = blocks[..., 3]
    if not covered.any():
        return None
    is_lit = blocks[..., :3].max(axis=-1) >= DARK * covered
    return float(covered[is_lit & (covered > 0)].sum() / covered.sum())
