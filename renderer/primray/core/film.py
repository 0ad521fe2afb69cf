"""Film: the exact sums of a render's samples, and the picture and errors computed from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..settings import BIAS, RenderSettings
from . import compiled
from .native import raise_primray_error
from .scene import CoreScene

# Settings that remove sampled light from the picture, by the film's name for the removed light (film/film.hpp, Removal).
REMOVALS = {"clamped": "clamp_indirect", "caustics": "caustics"}
TILE = 16  # pixels across; kTile in film.hpp
NO_MIX = np.zeros((0, 3))


class Film:
    """The samples of a scene accumulated so far; arrays have shape (H, W, ...), and R = 2 independent replicates."""

    def __init__(
        self,
        scene: CoreScene,
        state: Mapping[str, npt.NDArray[Any]] | None = None,
        settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    ) -> None:
        """Start an empty film for a render with these settings, or continue the film whose arrays `state` holds."""
        width, height = scene.resolution
        if state is None:
            expressions = 0 if scene.light_paths is None else len(scene.light_paths.expressions)
            removals = [getattr(settings, name) != BIAS[name] for name in REMOVALS.values()]
            removed = sum(1 << why for why, on in enumerate(removals) if on)
            tolerance, most = (settings.deep_tolerance, settings.deep_samples) if scene.is_deep else (0.0, 0)
            self._film = compiled.Film(
                width, height, expressions=expressions, removals=removed, deep_tolerance=tolerance, deep_samples=most
            )
        else:
            self._film = compiled.Film.from_state(width, height, dict(state))
        self.deep_tolerance, self.most_deep_samples = settings.deep_tolerance, settings.deep_samples
        self._exposure_scale = scene._exposure_scale
        self._image: tuple[int, tuple[Floats, Floats]] | None = None
        self._spread: tuple[int, tuple[int, int]] | None = None

    def image(self) -> tuple[Floats, Floats]:
        """Return mean R, G, B, alpha (H, W, 4) and the standard errors of R, G, B (H, W, 3); inf where there is no estimate."""
        if self._image is None or self._image[0] != self.samples:
            self._image = (self.samples, self._film.image(self._exposure_scale))
        return self._image[1]

    def light_path_images(self) -> tuple[npt.NDArray[np.float64], Floats]:
        """Return R, G, B (E, H, W, 3) of each light path expression, scaled as in `image`, and differences of replicates.

        The outputs of expressions that partition the light add up to the picture, up to rounding of doubles. Differences are
        signed, and each is distributed like its output's error: the error of a weighted sum of outputs is the weighted sum of
        their differences. NaN where there is no estimate.
        """
        return self._film.lpe_images(self._exposure_scale)

    def removed_rows(self, why: str, first: int, end: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return R, G, B of the light of these rows that was sampled and removed (a key of `REMOVALS`), and errors.

        The second array holds differences of the replicates, distributed as the errors of the first; NaN where there is no
        estimate.
        """
        return self._film.removed_rows(list(REMOVALS).index(why), self._exposure_scale, first, end)

    def deep_samples(self) -> tuple[npt.NDArray[np.uint32], Floats]:
        """Return the deep picture: samples in each pixel (H, W), and Z, ZBack, R, G, B, A of all (N, 6), as in `image`."""
        return self._film.deep_samples(self._exposure_scale)

    @property
    def deep_memory_bytes(self) -> int:
        return self._film.deep_memory_bytes

    @property
    def pixels(self) -> Floats:
        return self.image()[0]

    @property
    def replicates(self) -> npt.NDArray[np.float64]:
        """Sums (R, H, W, 4) of each independent replicate, before exposure."""
        return self._film.replicates

    @property
    def counts(self) -> npt.NDArray[np.uint32]:
        """Samples (R, H, W) in each sum."""
        return self._film.counts

    @property
    def samples_per_pixel(self) -> tuple[int, int]:
        """Fewest and most samples of any pixel.

        Cached until further samples arrive, since every measurement of the error asks for it.
        """
        if self._spread is None or self._spread[0] != self.samples:
            total = self.counts.sum(axis=0)
            self._spread = self.samples, (int(total.min()), int(total.max()))
        return self._spread[1]

    @property
    def samples(self) -> int:
        return self._film.samples

    @property
    def invalid_samples(self) -> int:
        return self._film.invalid_samples

    @property
    def rays_by_kind(self) -> dict[str, int]:
        film = self._film
        return {"camera": film.camera_rays, "scattered": film.scattered_rays, "shadow": film.shadow_rays}

    @property
    def unseen_walks(self) -> dict[int, float]:
        """Walks below surfaces that no pixel resolves: by the number of a shape that the camera sees, as the plane "prim" has
        it, the longest in widths of a pixel. Of the samples that this process rendered."""
        return self._film.unseen_walks

    @property
    def rays(self) -> int:
        return sum(self.rays_by_kind.values())

    @property
    def resolution(self) -> tuple[int, int]:
        return self._film.width, self._film.height

    @property
    def tiles(self) -> tuple[int, int]:
        """Number of tiles across and down."""
        return self._film.tiles_x, self._film.tiles_y

    @property
    def next(self) -> npt.NDArray[np.uint32]:
        """Index of each tile's next sample in each replicate, (R, tiles); tiles in rows from the top."""
        return self._film.next

    @property
    def tile_rays(self) -> npt.NDArray[np.int64]:
        return self._film.tile_rays

    def start_at(self, number: int) -> None:
        """Start the sample sequences at index `number` instead of 0."""
        self._film.start_at(number)

    @classmethod
    def begun_at(cls, scene: CoreScene, begins: npt.NDArray[np.uint32], settings: RenderSettings) -> Film:
        """Return a film without samples, whose sequences begin there: `begins` as `next` counts them."""
        return cls(scene, {**cls(scene, settings=settings).state(), "next": begins}, settings)

    def merge(self, other: Film) -> None:
        """Add the samples of another film, which are disjoint from these: the result has the bits of one film with all of
        them."""
        try:
            self._film.merge(other._film)
        except compiled.CoreError as error:
            raise_primray_error(error)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Return everything in the film as arrays, for `Film(scene, state)`."""
        return self._film.state()

    def error_sums(
        self, most_pixels: int, threads: int, mix: Doubles = NO_MIX, *, by_pixel: bool = False
    ) -> compiled.FrameErrorSums:
        """Return the sums that error estimates are made of (film/frame_error.hpp computes them, sampling/error.py uses
        them).

        `mix` (E, 3): what is added of the light of each light path expression; the error is that of the sum.
        `by_pixel`: also what each pixel adds.
        """
        weights = np.ascontiguousarray(mix, np.float64)
        return self._film.error(self._exposure_scale, most_pixels, threads, weights, by_pixel=by_pixel)

    def error_parts(self, threads: int) -> Doubles:
        """Return what each pixel adds to relMSE (H, W), by the weights of its estimate: times the number of values."""
        film, every = self._film, 1 << 62
        parts = self.error_sums(every, threads, by_pixel=True).pixels
        return parts.astype(np.float64).reshape(film.height, film.width)


def samples_of_replicates(samples: int) -> tuple[int, int]:
    """Return how many of a pixel's first `samples` belong to each replicate: the replicates take turns."""
    return (samples + 1) // 2, samples // 2


def uniform_ends(film: Film, samples: int) -> npt.NDArray[np.uint32]:
    """Return the `ends` of a pass that gives every pixel its first `samples` samples."""
    return np.repeat(np.array(samples_of_replicates(samples), np.uint32)[:, None], film.next.shape[1], axis=1)
