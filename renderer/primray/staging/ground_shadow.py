"""The shadow that a ground receives, as an opacity: one minus its direct light with what is drawn over that without.

The picture itself hides the ground from the camera, so that its colours, coverage and errors are those of what is drawn. The
ground is seen in two small renders of direct light. They take the same samples: where nothing is in the way of the light their
ratio is 1, and the ground has no edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import core
from ..arrays import Floats
from ..color.color_space import LUMINANCE_WEIGHTS
from ..description import Placed, SceneDescription, TextureFile
from ..description.shading import CameraSight
from ..settings import RenderSettings
from ..textures.texture import Texture
from .additions import GROUND

LEAST = 0.002  # opacities below it, half a step of 8 bits, are rounding of places on a large ground
LEAST_SAMPLES, MOST_SAMPLES = 16, 256  # a pixel


@dataclass(frozen=True, eq=False)
class GroundShadow:
    """What is needed to find the shadow of a diced scene after its picture is made."""

    description: SceneDescription
    textures: dict[TextureFile, list[tuple[int, Texture]]]
    settings: RenderSettings

    @cached_property
    def opacity(self) -> Floats:
        """Return (H, W) in 0 to 1: how much of what is behind the picture the shadow hides."""
        asked = self._settings()
        shadowed, bare = (self._seen(description, asked) for description in (self._shadowed(), self._bare()))
        weights = np.array(LUMINANCE_WEIGHTS, np.float64)
        light, most = shadowed[..., :3] @ weights, bare[..., :3] @ weights
        ratio = np.divide(light, most, out=np.ones_like(most), where=most > 0)
        opacity = np.clip(1 - ratio, 0, 1) * np.clip(bare[..., 3], 0, 1)
        return np.where(opacity < LEAST, 0, opacity).astype(np.float32)

    def _settings(self) -> RenderSettings:
        given = self.settings
        samples = min(max(given.spp or MOST_SAMPLES, LEAST_SAMPLES), MOST_SAMPLES)
        return RenderSettings(
            spp=samples,
            max_depth=1,
            filter=given.filter,
            filter_width=given.filter_width,
            seed=given.seed,
            threads=given.threads,
        )

    def _seen(self, description: SceneDescription, settings: RenderSettings) -> Floats:
        scene = core.build(replace(description, aovs=()), dict(self.textures), settings)
        return core.render(scene, settings).image()[0]

    def _shadowed(self) -> SceneDescription:
        """The ground alone is seen; the rest casts its shadow."""
        surfaces = tuple(
            replace(surface, camera=CameraSight.SEEN if surface.path == GROUND else CameraSight.HIDDEN)
            for surface in self.description.surfaces
        )
        return replace(self.description, surfaces=surfaces)

    def _bare(self) -> SceneDescription:
        shown = self._shadowed()
        (placed,) = (p for p in shown.static if shown.shapes[p.shape].path == GROUND)
        alone = (Placed(0, placed.matrix),)
        return replace(shown, shapes=(shown.shapes[placed.shape],), static=alone, prototypes=(), placements=())
