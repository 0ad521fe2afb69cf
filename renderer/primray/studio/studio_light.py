"""Studio light for a stage with emissive surfaces but no lights: a small test render decides whether it is needed.

An estimate from powers and areas would miss occlusion and textures of the emission. The test render takes a few thousand
samples of a scene built at its size; only stages with emission and without lights pay for it. Its seed, size and samples are
fixed, so that all processes and machines decide alike.
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

TEST_WIDTH = 96  # pixels of the test render's longer side
BLOCK = 4  # pixels per side of a block, whose mean is tested
SAMPLES = 3  # per pixel, without any pilot pass
# Radiance, after exposure, below which a block is dark: the default view shows it as 2 of 255.
DARK_RADIANCE = 0.01
LEAST_LIT = 0.35  # share of the coverage: with less, most of the image would be black


def with_studio_where_dark(
    description: SceneDescription,
    settings: RenderSettings,
    diagnostics: Diagnostics,
    build: Callable[[SceneDescription, RenderSettings], CoreScene],
) -> SceneDescription:
    """Return the description, with a studio light if its emissive surfaces light too little of the image."""
    if not _needs_test_render(description, settings):
        return description
    share = _lit_share(description, settings, build)
    if share is None or share >= LEAST_LIT:
        return description
    diagnostics.add(
        "default-light",
        "",
        f"The stage has no light, and its emissive surfaces light {share:.0%} of what is visible: a studio light is added, "
        "which the camera does not see.",
    )
    return replace(description, lights=default_lights(description.camera, description.up_axis == "Z"))


def _needs_test_render(description: SceneDescription, settings: RenderSettings) -> bool:
    """Return whether a test render has to decide; translation already adds the studio light to stages without emission."""
    if settings.studio is not StudioLight.AUTO or description.lights or not description.may_need_light:
        return False
    return any(map(_is_emissive, description.surfaces))


def _is_emissive(surface: Surface) -> bool:
    return any(value > 0 for value in surface.emissive_color) or "emissive_color" in surface.varying


def _lit_share(
    description: SceneDescription, settings: RenderSettings, build: Callable[[SceneDescription, RenderSettings], CoreScene]
) -> float | None:
    """Return the share of the visible scene that is not dark in a test render; None if nothing is visible."""
    from .. import core

    width, height = description.resolution
    scale = min(1.0, TEST_WIDTH / max(width, height))
    small = (max(1, round(width * scale)), max(1, round(height * scale)))
    quick = RenderSettings(
        spp=SAMPLES, max_depth=settings.max_depth, threads=settings.threads, dicing_rate=settings.dicing_rate
    )
    scene = build(replace(description, resolution=small, pixels=None, aovs=()), quick)
    pixels, _ = core.render(scene, quick).image()
    return lit_share(pixels)


def lit_share(pixels: Floats) -> float | None:
    """Return the share of coverage in blocks whose mean colour is not dark, of premultiplied pixels (H, W, 4)."""
    height, width = pixels.shape[:2]
    padded = np.zeros((-(-height // BLOCK) * BLOCK, -(-width // BLOCK) * BLOCK, 4))
    padded[:height, :width] = np.where(np.isfinite(pixels), pixels, 0)
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK, 4).sum(axis=(1, 3))
    covered = blocks[..., 3]
    if not covered.any():
        return None
    is_lit = blocks[..., :3].max(axis=-1) >= DARK_RADIANCE * covered
    return float(covered[is_lit & (covered > 0)].sum() / covered.sum())
