"""Silhouettes of things, gathered from the rays that pass them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .things import Silhouette

if TYPE_CHECKING:
    from ..description.scene import PixelWindow

Pixels = npt.NDArray[np.int64]


class Silhouettes:
    """Silhouettes of `count` things, of rays through the middles of pixels of a frame's canvas."""

    def __init__(self, count: int, window: PixelWindow) -> None:
        self._window = window
        self._pixels: list[list[Pixels]] = [[] for _ in range(count)]  # (N, 2) x and y in the frame, by thing

    def add(self, points: npt.NDArray[Any], things: npt.NDArray[np.int32], rays: npt.NDArray[np.int32]) -> None:
        """Add rays through points (N, 2) of the frame, with the things that they pass, sorted by these.

        Rays may be added more than once.
        """
        corner = np.array([self._window.x, self._window.y])
        pixels = np.floor(points).astype(np.int64) - corner
        ends = np.searchsorted(things, np.arange(len(self._pixels) + 1))
        for n in np.unique(things).tolist():
            self._pixels[n].append(pixels[rays[ends[n] : ends[n + 1]]])

    def of(self, thing: int) -> Silhouette | None:
        """Return the silhouette of a thing; None where no ray passes it."""
        if not self._pixels[thing]:
            return None
        width, height = self._window.width, self._window.height
        pixels = np.concatenate(self._pixels[thing])
        low, high = pixels.min(axis=0).tolist(), (pixels.max(axis=0) + 1).tolist()
        x, y = pixels[((pixels >= 0) & (pixels < [width, height])).all(axis=1)].T
        return Silhouette((*low, *high), (height, width), run_lengths(np.unique(x * height + y), width * height))


def run_lengths(places: Pixels, size: int) -> tuple[int, ...]:
    """Return the lengths of runs of 0 and 1, in turn, of a mask of `size` values that is 1 at `places`, which are sorted."""
    begins = places[np.diff(places, prepend=-2) != 1]
    ends = places[np.diff(places, append=size + 1) != 1] + 1
    bounds = np.stack([begins, ends], axis=1).ravel()
    counts = np.diff(bounds, prepend=0, append=size)
    return tuple(counts[: len(counts) - (counts[-1] == 0)].tolist())
