"""Which paths rule an error that is hardly known: their light, the prims that they meet, and what an error takes without them.

Some pixels are drawn by their share of the error, and all of their samples are rendered once more, with a log of their paths
(integrator/path_log.hpp): the same samples, so that the paths which made the picture's bright pixels are found themselves.

Paths are told apart by their light and their light path expression, in which vertices of one kind in a row are one:
"C<.S>+<.D>+L". A kind of path has that share of a pixel's error which the squares of its contributions have among all there.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Doubles
from ..color.color_space import luminance_weights
from .logged_paths import Event, ShapeNames, Vertex, paths_of

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..sampling.sampling import Sampling


MOST_PIXELS, FEWEST_PIXELS, MOST_SAMPLES = 64, 4, 8192
BRIGHTEST = 16  # samples of a pixel whose paths are told apart
MOST_EVENTS = 100_000  # after which no more pixels are drawn: paths in media have thousands
GOLDEN = 0.5 * (math.sqrt(5) - 1)
LARGE = 0.1  # share of the error from which a kind of path is told
MOST_TOLD = 3
SAME = 1e-3  # relative difference of a pixel's mean and that of the logged samples up to which these are the pixel's

Kind = tuple[str, str]  # a light path expression, the light's path


@dataclass(frozen=True)
class RarePath:
    """A kind of path, with its share of the error."""

    expression: str
    light: str
    share: float
    prims: tuple[str, ...]  # that its brightest path meets, from the camera on
    seen: str  # its brightest path in words

    def as_json(self) -> dict[str, Any]:
        return {"path": self.expression, "light": self.light, "share": self.share, "prims": list(self.prims)}


@dataclass(frozen=True)
class RarePaths:
    """The kinds of path that rule an error, the largest share first."""

    paths: tuple[RarePath, ...]
    without: float  # ratio of the error without all of them to the error


def find_rare_paths(scene: CoreScene, sampling: Sampling, part: Doubles) -> RarePaths | None:
    """Return the kinds of path that rule the error, of which each pixel has a `part` (H, W); None where no kind is large, or
    paths are so long that too few pixels could be looked at."""
    shares: defaultdict[Kind, float] = defaultdict(float)
    brightest: dict[Kind, tuple[float, Sequence[Vertex]]] = {}
    pixels = list(_pixels(scene, sampling, part))
    if len(pixels) < FEWEST_PIXELS:
        return None
    for pixel in pixels:
        squares = {kind: float((values**2).sum()) for kind, values in pixel.kinds.items()}
        total = sum(squares.values()) + float((pixel.rest**2).sum())
        for kind, square in squares.items():
            shares[kind] += square / total / len(pixels) if total > 0 else 0.0
            if square > 0 and pixel.brightest[kind][0] > brightest.get(kind, (0.0, ()))[0]:
                brightest[kind] = pixel.brightest[kind]
    largest = sorted((kind for kind in shares if shares[kind] >= LARGE), key=lambda kind: -shares[kind])[:MOST_TOLD]
    if not largest:
        return None
    without = float(np.mean([pixel.without(largest) for pixel in pixels]))
    told = (_told(kind, shares[kind], brightest[kind][1]) for kind in largest)
    return RarePaths(tuple(told), without)


def _pixels(scene: CoreScene, sampling: Sampling, part: Doubles) -> Iterator[_Pixel]:
    """Yield drawn pixels, each as often as it is drawn."""
    events, known = 0, dict[tuple[int, int], _Pixel | None]()
    for place in _drawn(sampling, part):
        if place not in known:
            if events > MOST_EVENTS:
                return
            pixel = known[place] = _Pixel.log(scene, sampling, *place)
            events += 0 if pixel is None else pixel.events
        if (pixel := known[place]) is not None:
            yield pixel


def _drawn(sampling: Sampling, part: Doubles) -> Iterator[tuple[int, int]]:
    """Yield pixels (x, y), each drawn by its part of the error, evenly so by every first few of them."""
    samples = max(sampling.film.samples / part.size, 1.0)
    count = min(max(int(MOST_SAMPLES / samples), FEWEST_PIXELS), MOST_PIXELS)
    order = np.argsort(-part, axis=None, kind="stable")
    sums = np.cumsum(part.ravel()[order])
    even = (0.5 + GOLDEN * np.arange(count)) % 1
    for at in np.searchsorted(sums, even * sums[-1]).tolist():
        y, x = divmod(int(order[min(at, part.size - 1)]), part.shape[1])
        yield x, y


@dataclass
class _Pixel:
    """What each kind of path adds to the N samples of a pixel, in luminance."""

    replicates: npt.NDArray[np.int64]  # (N,) of the samples
    rest: Doubles  # (N,) of samples whose paths are not told apart
    events: int  # that were logged
    kinds: dict[Kind, Doubles] = field(default_factory=dict)  # (N,)
    brightest: dict[Kind, tuple[float, Sequence[Vertex]]] = field(default_factory=dict)

    @classmethod
    def log(cls, scene: CoreScene, sampling: Sampling, x: int, y: int) -> _Pixel | None:
        """Return the pixel at column `x` and row `y`; None where its samples can't be repeated."""
        film = sampling.film
        counts = film.counts[:, y, x].astype(int)
        ends = film.next[:, y // core.TILE * film.tiles[0] + x // core.TILE].astype(int)
        spans = tuple((int(end - count), int(end)) for end, count in zip(ends, counts, strict=True))
        events = core.log_pixel(scene, x, y, spans, sampling.splits, sampling.settings, BRIGHTEST)
        by_sample: defaultdict[int, list[Event]] = defaultdict(list)
        for event in events:
            by_sample[event["sample"]].append(event)
        samples = [by_sample[number] for number in sorted(by_sample)]
        mean = np.mean([sample[-1]["value"] for sample in samples], axis=0) if samples else np.zeros(3)
        kept = film.replicates[:, y, x, :3].sum(axis=0) / max(int(counts.sum()), 1)
        if not np.allclose(mean, kept, rtol=SAME, atol=1e-12) or len(samples) != counts.sum():
            return None
        names = ShapeNames(scene)
        weights = np.array(luminance_weights(scene.rendering_space)) * scene.exposure_scale
        cameras = [next(event for event in sample if event["kind"] == "camera") for sample in samples]
        pixel = cls(np.array([camera["replicate"] for camera in cameras], np.int64), np.zeros(len(samples)), len(events))
        for number, sample in enumerate(samples):
            if len(sample) == 2:  # the camera ray and the value alone
                pixel.rest[number] = float(np.dot(weights, sample[-1]["value"]))
            for path in paths_of(names, sample):
                kind, value = (path.expression, path.light), float(np.dot(weights, path.adds))
                pixel.kinds.setdefault(kind, np.zeros(len(samples)))[number] += value
                if value > pixel.brightest.get(kind, (-math.inf, ()))[0]:
                    pixel.brightest[kind] = value, path.way.vertices
        return pixel

    def without(self, kinds: Iterable[Kind]) -> float:
        """Return the ratio of the squared difference of the replicates without paths of some kinds to that with them."""
        every = sum(self.kinds.values(), self.rest)
        left = every - sum(self.kinds.get(kind, np.zeros(len(every))) for kind in kinds)
        squares = [self._difference(values) ** 2 for values in (left, every)]
        return min(squares[0] / squares[1], 1.0) if squares[1] > 0 else 1.0

    def _difference(self, values: Doubles) -> float:
        return float(values[self.replicates == 0].mean() - values[self.replicates == 1].mean())


def _told(kind: Kind, share: float, vertices: Sequence[Vertex]) -> RarePath:
    expression, light = kind
    prims = tuple(dict.fromkeys(vertex.prim for vertex in vertices if vertex.prim))
    return RarePath(expression, light, share, prims, in_words(light or "a surface", vertices))


def in_words(light: str, vertices: Sequence[Vertex]) -> str:
    """Return a path in words, from its light to the camera."""
    rough = [k for k, vertex in enumerate(vertices) if vertex.letter != "S"]
    if not vertices:
        return f"{light}, seen as it is"
    if not rough:
        return f"{light}, seen {_through(vertices)}"
    first, last = rough[0], rough[-1]
    bending = vertices[last + 1 :]
    bends = "" if not bending else f" that {_names(bending)} {_does(bending)}"
    between = vertices[first + 1 : last + 1]
    text = f"light of {light}{bends}, on {_name(vertices[first])}"
    text += f" by way of {_names(reversed(between))}" if between else ""
    return text + (f", seen {_through(vertices[:first])}" if first else "")


def _does(bending: Sequence[Vertex]) -> str:
    verb = "bend" if any(vertex.transmits for vertex in bending) else "mirror"
    return verb if len({_name(vertex) for vertex in bending}) > 1 else f"{verb}s"


def _through(vertices: Sequence[Vertex]) -> str:
    return f"{'through' if any(vertex.transmits for vertex in vertices) else 'in'} {_names(vertices)}"


def _names(vertices: Iterable[Vertex]) -> str:
    names = list(dict.fromkeys(_name(vertex) for vertex in vertices))
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _name(vertex: Vertex) -> str:
    return vertex.prim or ("the air" if vertex.letter == "V" else "a surface")
