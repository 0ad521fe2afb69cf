"""Shadow on an invisible ground (a shadow catcher), as an opacity: 1 - direct light with the scene / direct light without.

The image itself hides the ground from the camera, so that its colours, coverage and errors are those of the scene. The ground
is visible in two small renders of direct light with the same samples: where nothing blocks the light their ratio is exactly 1,
and the ground has no visible edge. Tiles without a shadow, and those that the image covers, are dropped early; the others are
sampled until the shadow has the samples of the image or has cost as much. The cost is measured in rays, so that the same
render has the same shadow; only a time limit depends on the clock.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Floats
from ..color.color_space import LUMINANCE_WEIGHTS
from ..description import Placed, SceneDescription, TextureFile
from ..description.shading import CameraSight
from ..settings import SAMPLE_BLOCK, RenderSettings
from ..textures.texture import Texture
from .additions import GROUND

LEAST = 0.002  # smaller opacities (half a step of 8 bits) are rounding errors of positions on a large ground
LEAST_SAMPLES, MOST_SAMPLES = 16, 256  # per pixel
JUDGED_AT = 8  # samples per pixel after which tiles without a shadow, in them or a neighbour, are dropped


@dataclass(frozen=True)
class Spent:
    """Cost of an image: average samples per pixel, and rays."""

    samples: float
    rays: int


@dataclass(frozen=True, eq=False)
class GroundShadow:
    """Inputs to compute the shadow of a diced scene after its image is rendered."""

    description: SceneDescription
    textures: dict[TextureFile, list[tuple[int, Texture]]]
    settings: RenderSettings

    def opacity(self, coverage: Floats, spent: Spent) -> Floats:
        """Return the shadow's opacity (H, W), 0 to 1; `coverage` (H, W) and `spent` are the image's."""
        start = time.perf_counter()
        views = _Views(self._shadowed(), self._bare(), self.textures, self._settings(spent))
        is_open = _tiles(coverage < 1, views.tiles)
        limit_s = self.settings.shadow_time_s
        samples = SAMPLE_BLOCK
        while True:
            views.take(samples, is_open)
            if samples >= JUDGED_AT:
                is_open &= _with_neighbours(_tiles(views.opacity() > 0, views.tiles), views.tiles)
            if samples >= views.settings.most_samples or not is_open.any():
                break
            if limit_s is None:
                if samples >= LEAST_SAMPLES and spent.rays < 2 * views.rays:
                    break
            elif 2 * (time.perf_counter() - start) > limit_s:
                break
            samples = min(2 * samples, views.settings.most_samples)
        return views.opacity()

    def _settings(self, spent: Spent) -> RenderSettings:
        given = self.settings
        samples = int(min(max(spent.samples, LEAST_SAMPLES), MOST_SAMPLES))
        return RenderSettings(
            spp=-(-samples // SAMPLE_BLOCK) * SAMPLE_BLOCK,
            max_depth=1,
            filter=given.filter,
            filter_width=given.filter_width,
            seed=given.seed,
            threads=given.threads,
        )

    def _shadowed(self) -> SceneDescription:
        """Return the scene with only the ground visible to the camera; the rest casts its shadow."""
        surfaces = tuple(
            replace(surface, camera=CameraSight.SEEN if surface.path == GROUND else CameraSight.HIDDEN)
            for surface in self.description.surfaces
        )
        return replace(self.description, surfaces=surfaces)

    def _bare(self) -> SceneDescription:
        """Return the scene with the ground alone."""
        shown = self._shadowed()
        (placed,) = (p for p in shown.static if shown.shapes[p.shape].path == GROUND)
        alone = (Placed(0, placed.matrix),)
        return replace(shown, shapes=(shown.shapes[placed.shape],), static=alone, prototypes=(), placements=())


class _Views:
    """The two renders of the ground, with the same samples."""

    def __init__(
        self,
        shadowed: SceneDescription,
        bare: SceneDescription,
        textures: dict[TextureFile, list[tuple[int, Texture]]],
        settings: RenderSettings,
    ) -> None:
        self.settings = settings
        self._scenes = [core.build(replace(view, aovs=()), dict(textures), settings) for view in (shadowed, bare)]
        self._films = [core.Film(scene, settings=settings) for scene in self._scenes]
        self._splits = core.choose_splits(self._scenes[0], settings)

    @property
    def tiles(self) -> tuple[int, int]:
        return self._films[0].tiles

    @property
    def rays(self) -> int:
        return sum(int(film.rays) for film in self._films)

    def take(self, samples: int, is_open: npt.NDArray[np.bool_]) -> None:
        """Render the open tiles up to `samples` samples per pixel."""
        for scene, film in zip(self._scenes, self._films, strict=True):
            ends = np.where(is_open[None], core.uniform_ends(film, samples), film.next)
            core.render_pass(scene, film, ends, self._splits, self.settings)

    def opacity(self) -> Floats:
        shadowed, bare = (film.image()[0] for film in self._films)
        weights = np.array(LUMINANCE_WEIGHTS, np.float64)
        light, most = shadowed[..., :3] @ weights, bare[..., :3] @ weights
        ratio = np.divide(light, most, out=np.ones_like(most), where=most > 0)
        opacity = np.clip(1 - ratio, 0, 1) * np.clip(bare[..., 3], 0, 1)
        return np.where(opacity < LEAST, 0, opacity).astype(np.float32)


def _tiles(pixels: npt.NDArray[np.bool_], tiles: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return whether any pixel of each tile is set, (tiles,), rows of tiles from the top."""
    columns, rows = tiles
    whole = np.zeros((rows * core.TILE, columns * core.TILE), bool)
    whole[: pixels.shape[0], : pixels.shape[1]] = pixels
    found: npt.NDArray[np.bool_] = whole.reshape(rows, core.TILE, columns, core.TILE).any(axis=(1, 3)).ravel()
    return found


def _with_neighbours(chosen: npt.NDArray[np.bool_], tiles: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return the chosen tiles and the eight around each, (tiles,)."""
    columns, rows = tiles
    grid = np.pad(chosen.reshape(rows, columns), 1)
    found = np.zeros((rows, columns), bool)
    for y in range(3):
        for x in range(3):
            found |= grid[y : y + rows, x : x + columns]
    return found.ravel()
