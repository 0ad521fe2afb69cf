"""relMSE against a converged picture: mean over pixels and channels of (I - R)^2 / (R^2 + d), less the reference's own; d is
0.01, or the squared mean of a picture that is darker than that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

Pixels = npt.NDArray[np.float64]  # (H, W, 3)
DARK = 0.01
WORST = 0.01  # of the pixels, that are left out of a trimmed error


@dataclass(frozen=True)
class Reference:
    halves: tuple[Pixels, Pixels]  # means of independent pictures
    samples: int  # of both together
    pictures: int

    @property
    def pixels(self) -> Pixels:
        return (self.halves[0] + self.halves[1]) / 2

    @property
    def weights(self) -> Pixels:
        """By which squared differences are divided."""
        pixels = self.pixels
        return pixels**2 + min(DARK, float(pixels.mean()) ** 2)

    @property
    def noise(self) -> float:
        """Its own relMSE."""
        return float((((self.halves[0] - self.halves[1]) / 2) ** 2 / self.weights).mean())

    def with_more(self, more: Reference) -> Reference:
        share = more.samples / (self.samples + more.samples)
        halves = [a + (b - a) * share for a, b in zip(self.halves, more.halves, strict=True)]
        return Reference((halves[0], halves[1]), self.samples + more.samples, self.pictures + more.pictures)


def load(path: str | Path, part: int = 0) -> Pixels:
    image = oiio.ImageBuf(str(path), part, 0)
    pixels = image.get_pixels(oiio.FLOAT)
    if pixels is None or not pixels.size:
        raise SystemExit(f"{path}: {image.geterror()}")
    return np.asarray(pixels, np.float64)[..., :3]


def reference_of(pictures: Sequence[Pixels], samples: int) -> Reference:
    """Of independent pictures of equally many samples, two at least; an odd one out is dropped."""
    even = len(pictures) // 2 * 2
    halves = [np.mean(pictures[k:even:2], axis=0) for k in (0, 1)]
    return Reference((halves[0], halves[1]), samples * even, even)


def relmse(picture: Pixels, reference: Reference) -> float:
    """Below zero only where the picture is as good as its reference, and chance has it so."""
    error = (picture - reference.pixels) ** 2 / reference.weights
    return float(error.mean()) - reference.noise


def trimmed_relmse(picture: Pixels, reference: Reference, worst: float = WORST) -> float:
    """relMSE without the worst share of the pixels, where rare bright paths lie: what most of the picture looks like."""
    halves = (reference.halves[0] - reference.halves[1]) / 2
    kept = [_best(difference, reference, worst) for difference in (picture - reference.pixels, halves)]
    return kept[0] - kept[1]


def _best(difference: Pixels, reference: Reference, worst: float) -> float:
    errors = np.sort((difference**2 / reference.weights).mean(axis=2).ravel())
    return float(errors[: max(1, round(len(errors) * (1 - worst)))].mean())


def save(reference: Reference, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    half_written = path.with_suffix(".part.npz")
    counts = np.array([reference.samples, reference.pictures])
    np.savez(half_written, halves=np.asarray(reference.halves, np.float32), counts=counts)
    half_written.replace(path)


def saved(path: Path) -> Reference:
    with np.load(path) as found:
        one, other = found["halves"].astype(np.float64)
        return Reference((one, other), *(int(n) for n in found["counts"]))


def agreement(one: Reference, other: Reference) -> dict[str, float]:
    """How far two renderers' converged pictures are apart: of their means, and of blocks of 8 x 8 pixels, both relative."""
    height, width = (side // 8 * 8 for side in one.pixels.shape[:2])
    blocks = [r.pixels[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3)) for r in (one, other)]
    apart = float(np.abs(blocks[0] - blocks[1]).mean() / blocks[1].mean())
    return {"mean": float(one.pixels.mean() / other.pixels.mean() - 1), "blocks": apart}
