"""Deep pictures: samples of each pixel by depth, so that other pictures can be composited between them.

A sample has a depth Z along the camera's axis, as the depth AOV has it, in scene units; ZBack, which is Z for surfaces and
greater for volumes; and premultiplied R, G, B and A of its own, in front of what is behind. "Over" of a pixel's samples is the
picture. Light that covers nothing has A = 0: flames at their depth, the sky behind everything at FAR.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Floats

if TYPE_CHECKING:
    from ..core import Film

CHANNELS = ("Z", "ZBack", "R", "G", "B", "A")  # columns of a deep picture's values
FAR = 1e30  # depth of light from behind everything; infinity would become NaN in filters
_END = re.compile(r"(?P<frame>\.\d+)?\.[^.]+$")


@dataclass(frozen=True, eq=False, repr=False)
class DeepPicture:
    """The samples of a deep picture, pixel by pixel in rows from the top, front to back.

    >>> image = primray.render("shot.usda", aovs=["deep"], resolution=(32, 18), spp=4)
    >>> image.deep.counts.shape, image.deep.values.shape[1]
    ((18, 32), 6)
    >>> bool(abs(image.deep.flattened() - image.pixels).max() < 1e-4)
    True
    """

    counts: npt.NDArray[np.uint32]  # (H, W) samples in each pixel
    values: Floats  # (N, 6): CHANNELS of all samples
    tolerance: float  # relative size of the depths that share a sample
    most: int  # samples that a pixel was allowed to have
    memory_bytes: int = 0  # of the sums in the core

    def __post_init__(self) -> None:
        if self.values.shape != (int(self.counts.sum()), len(CHANNELS)):
            raise ValueError(f"values of shape {self.values.shape} are not those of {int(self.counts.sum())} samples")
        for array in (self.counts, self.values):
            array.flags.writeable = False

    def flattened(self) -> npt.NDArray[np.float64]:
        """Return the composite of all samples, (H, W, 4): R, G, B, A."""
        counts = self.counts.ravel()
        first = np.concatenate([[0], np.cumsum(counts[:-1], dtype=np.int64)]) if counts.size else np.zeros(0, np.int64)
        flat = np.zeros((counts.size, 4))
        for number in range(int(counts.max(initial=0))):
            held = np.flatnonzero(counts > number)
            flat[held] += (1 - flat[held, 3:]) * self.values[first[held] + number, 2:]
        return flat.reshape(*self.counts.shape, 4)

    def as_json(self) -> dict[str, Any]:
        """Return the report's facts."""
        total, pixels = int(self.counts.sum()), max(self.counts.size, 1)
        return {
            "samples": total,
            "samples_per_pixel": {"mean": total / pixels, "most": int(self.counts.max(initial=0)), "limit": self.most},
            "tolerance": self.tolerance,
            "memory_bytes": self.memory_bytes,
        }


def deep_of_film(film: Film) -> DeepPicture:
    """Return the deep picture of a film that has one."""
    counts, values = film.deep_samples()
    return DeepPicture(counts, values, film.deep_tolerance, film.most_deep_samples, film.deep_memory_bytes)


def beside(path: str | os.PathLike[str]) -> Path:
    """Return the name of the deep picture beside a picture: shot.deep.exr, shot.deep.0001.exr."""
    path = Path(path)
    return path.with_name(_END.sub(lambda end: f".deep{end[0]}", path.name, count=1))
