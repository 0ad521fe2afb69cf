"""The paths that make a pixel's noise: which samples differ most from the mean, and the paths that made them.

A sample's share of the noise is the square of its difference from the mean, over the sum of these squares; it is divided among
the sample's paths by what each adds. The paths with the largest shares are kept, and some of the others at random, marked so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..report.logged_paths import LightPath, Vector
from ..report.rare_paths import in_words
from .parts import Color, color_of
from .pixel import AIR, PixelRender, Sample

MOST_BY_NOISE, MOST_AT_RANDOM = 32, 32
FAR = 0.5  # how far rays from infinity are drawn, in diagonals of the scene


@dataclass(frozen=True)
class NoisePath:
    """A path from the camera to a light: `points` in the world, `adds` to the pixel (R, G, B), its `share` of the noise."""

    points: tuple[Vector, ...]
    light: str
    prims: tuple[str, ...]  # of its vertices, from the camera on
    expression: str
    replicate: int
    sample: int  # index in its replicate
    adds: Color
    share: float
    is_random: bool  # drawn at random, not for its share
    words: str  # the path in words, from its light to the camera

    def as_json(self) -> dict[str, Any]:
        return {
            "light": self.light,
            "prims": list(self.prims),
            "expression": self.expression,
            "replicate": self.replicate,
            "sample": self.sample,
            "adds": list(self.adds),
            "share": self.share,
            "random": self.is_random,
            "words": self.words,
            "points": [list(point) for point in self.points],
        }


def noise_paths(render: PixelRender, samples: Sequence[Sample]) -> tuple[NoisePath, ...]:
    """Return paths of a pixel's samples: those with the largest shares of the noise first, then those drawn at random."""
    bright = np.array([np.dot(render.weights, sample.value) for sample in samples])
    squares = (bright - bright.mean()) ** 2 if len(bright) else bright
    total = float(squares.sum())
    found: list[tuple[float, Sample, LightPath]] = []
    for sample, square in zip(samples, squares.tolist(), strict=True):
        adds = np.array([abs(float(np.dot(render.weights, path.adds))) for path in sample.paths])
        of_sample = float(adds.sum())
        if total > 0 and of_sample > 0:
            shares = adds / of_sample * (square / total)
            found += [(share, sample, path) for share, path in zip(shares.tolist(), sample.paths, strict=True)]
    found.sort(key=lambda one: -one[0])
    rest = found[MOST_BY_NOISE:]
    drawn = np.random.default_rng(0).permutation(len(rest))[:MOST_AT_RANDOM].tolist()
    chosen = [(one, False) for one in found[:MOST_BY_NOISE]] + [(rest[k], True) for k in sorted(drawn)]
    reach = _reach(render)
    scale = render.scale / max(len(samples), 1)
    return tuple(
        NoisePath(
            points=tuple(_points(path, reach)),
            light=path.light or AIR,
            prims=tuple(vertex.prim or AIR for vertex in path.way.vertices),
            expression=path.expression,
            replicate=sample.replicate,
            sample=sample.index,
            adds=color_of(np.array(path.adds) * scale),
            share=share,
            is_random=is_random,
            words=in_words(path.light or AIR, path.way.vertices),
        )
        for (share, sample, path), is_random in chosen
    )


def _points(path: LightPath, reach: float) -> Iterator[Vector]:
    yield path.camera
    last = path.camera
    for vertex in path.way.vertices:
        last = vertex.point
        yield last
    if path.end is not None:
        yield path.end
    elif any(path.direction):
        ahead: Doubles = np.array(last) + reach * np.array(path.direction)
        x, y, z = ahead.tolist()
        yield x, y, z


def _reach(render: PixelRender) -> float:
    bounds = render.prepared.scene.bounds
    diagonal = 0.0 if bounds is None else float(np.linalg.norm(bounds[1] - bounds[0]))
    return FAR * diagonal if diagonal > 0 else 1.0
