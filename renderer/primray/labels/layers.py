"""Which labelled things rays pass, and which of them they hit first: the counts that visibility is made of."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Floats
from .things import Hierarchy

if TYPE_CHECKING:
    from ..core import CoreScene, compiled
    from ..settings import RenderSettings
    from ..usd import LabelledPrims

Numbers = npt.NDArray[np.int64]
BAND = 1 << 18  # rays at a time
MOST_KEYS = 1 << 22  # of parts, in a table that has a place for each


class PartNames:
    """Numbers for parts of the scene (shape, instance and outer instance as the core numbers them), with their names."""

    def __init__(self, scene: CoreScene) -> None:
        self._scene = scene
        self._numbers: dict[tuple[int, int, int], int] = {}
        self._by_name: dict[tuple[str, str], int] = {}
        self.names: list[tuple[str, str]] = []  # path of the shape, and name of the instance; "": none

    def parts(self) -> npt.NDArray[np.int32]:
        """Return the parts (N, 3) that have been numbered."""
        return np.array(list(self._numbers), np.int32).reshape(-1, 3)

    def number(self, what: npt.NDArray[np.int32]) -> Numbers:
        """Return numbers (M) of parts (M, 3), the same for parts of one name."""
        return self.number_columns(what[:, 0], what[:, 1], what[:, 2])

    def number_columns(self, *columns: npt.NDArray[np.int32]) -> Numbers:
        """Return numbers (M) of parts, given by shape, instance and outer instance, (M) each."""
        if not len(columns[0]):
            return np.zeros(0, np.int64)
        low = [int(column.min()) for column in columns]
        size = [int(column.max()) - least + 1 for column, least in zip(columns, low, strict=True)]
        keys = np.zeros(len(columns[0]), np.int64)
        for column, least, count in zip(columns, low, size, strict=True):
            keys = keys * count + (column - np.int64(least))
        if math.prod(size) > MOST_KEYS:
            own, keys = np.unique(keys, return_inverse=True)
            there = np.arange(len(own))
        else:  # without sorting the parts of all pixels
            is_there = np.zeros(math.prod(size), bool)
            is_there[keys] = True
            own = there = np.flatnonzero(is_there)
        parts = np.stack(np.unravel_index(own, size), axis=1) + low
        found = np.zeros(int(there[-1]) + 1, np.int64)
        found[there] = [self._number(*part) for part in parts.tolist()]
        return np.asarray(found[keys.ravel()])

    def _number(self, shape: int, instance: int, outer: int) -> int:
        part = shape, instance, outer
        if part not in self._numbers:
            name = self._scene.name_of_part(*part)
            if name not in self._by_name:
                self._by_name[name] = len(self.names)
                self.names.append(name)
            self._numbers[part] = self._by_name[name]
        return self._numbers[part]


class TaxonomyThings:
    """The things of a taxonomy by the parts that they consist of."""

    def __init__(self, taxonomy: str, labelled: LabelledPrims, parts: PartNames) -> None:
        self.hierarchy = Hierarchy(taxonomy)
        self._labelled = labelled
        self._parts = parts
        self._places: list[int] = []

    def places(self) -> Numbers:
        """Return the place in the hierarchy of the innermost thing of each part, -1: none."""
        names = self._parts.names
        for prim, instance in names[len(self._places) :]:
            holding = self._labelled.holding(prim, instance, self.hierarchy.taxonomy)
            self._places.append(self.hierarchy.innermost(holding))
        return np.array(self._places, np.int64)


@dataclass(frozen=True)
class Counts:
    """Numbers of rays by thing: that pass it, and that hit it first."""

    passing: Numbers
    first: Numbers

    def __add__(self, other: Counts) -> Counts:
        size = max(len(self.passing), len(other.passing))
        a, b = self.sized(size), other.sized(size)
        return Counts(a.passing + b.passing, a.first + b.first)

    def sized(self, size: int) -> Counts:
        """Return the counts of at least `size` things."""
        more = max(size - len(self.passing), 0)
        return Counts(np.append(self.passing, np.zeros(more, np.int64)), np.append(self.first, np.zeros(more, np.int64)))


NO_COUNTS = Counts(np.zeros(0, np.int64), np.zeros(0, np.int64))


class Passed:
    """What rays pass: the number (K) of each part, and of each ray (N) the first part and its depth."""

    def __init__(self, layers: compiled.NumberedLayers, parts: PartNames) -> None:
        self._layers = layers
        self.parts = parts.number(layers.parts())
        self.first = np.append(self.parts, -1)[layers.first()]  # -1: nothing is hit
        self.depth: Floats = layers.depth()  # infinite where nothing is hit

    def counts(self, things: TaxonomyThings) -> Counts:
        """Return how many of the rays pass each thing and hit it first, with the things that it holds."""
        return Counts(*self._layers.count_rays(*self._places(things)))

    def rays(self, things: TaxonomyThings) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return things and rays (N), each ray with each thing that it passes, by thing, and of one thing in their order."""
        thing, ray = self._layers.rays_passing(*self._places(things)).T
        order = np.argsort(thing, kind="stable")
        return thing[order], ray[order]

    def _places(self, things: TaxonomyThings) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return the thing of each part, and what holds each thing."""
        places = things.places()[self.parts] if len(self.parts) else np.zeros(0, np.int64)
        return places.astype(np.int32), np.array(things.hierarchy.parents, np.int32)


def passed_by(
    scene: CoreScene, points: npt.ArrayLike, parts: PartNames, settings: RenderSettings, *, first_only: bool = False
) -> Iterator[Passed]:
    """Yield what rays through points (N, 2) of the frame pass, or only the first of it, in bands of the points."""
    for band in in_bands(np.asarray(points, np.float32).reshape(-1, 2)):
        yield Passed(core.numbered_layers(scene, band, settings, first_only=first_only), parts)


def in_bands(points: npt.NDArray[Any]) -> Iterator[npt.NDArray[Any]]:
    """Yield points (N, 2) in the bands that `passed_by` makes of them."""
    for begin in range(0, len(points), BAND):
        yield points[begin : begin + BAND]


def wilson_interval(hits: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share.

    Wilson 1927, "Probable Inference, the Law of Succession, and Statistical Inference".
    """
    z = 1.959963984540054
    share = hits / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * np.sqrt(share * (1 - share) / of + z * z / (4 * of * of))
    return float(middle - half) if hits else 0.0, float(middle + half) if hits < of else 1.0
