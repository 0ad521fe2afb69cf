"""Instances in a scene description: placements of prototypes, as data that yields matrices in chunks, and the names of
instances.

Millions of instances stay in USD's form (positions, quaternions and scales in single precision, nested ones as a product of
levels); double matrices of all of them never exist at once.

A name is the path of a native instance, or INSTANCER[n] of a point instancer's; names of nested instances are concatenated.
They are kept only if an AOV shows instances. Names of a level are relative to its parent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Numbers, chosen_rows, extremes
from .geometry import Interpolation, Primvar

CHUNK = 1 << 14  # matrices at a time: 1.5 MB
IDENTITY: Doubles = np.eye(4)[:3]

Box = tuple[Doubles, Doubles]


@dataclass(frozen=True, eq=False)
class MatrixInstances:
    """Instances given by their matrices."""

    matrices: Doubles  # (K, 3, 4), without the last row
    primvars: tuple[Primvar, ...] = ()  # INSTANCE, K rows
    names: Names | None = None  # if an AOV shows instances

    def __len__(self) -> int:
        return len(self.matrices)

    def rows(self, start: int, stop: int) -> Doubles:
        """Return the matrices (stop - start, 3, 4)."""
        return self.matrices[start:stop]

    def take(self, chosen: npt.NDArray[Any]) -> MatrixInstances:
        """Return the instances chosen by a mask or an array of indices."""
        return MatrixInstances(
            chosen_rows(self.matrices, chosen), _take(self.primvars, chosen), _take_names(self.names, chosen)
        )

    def placed(self, outer: Doubles, name: str = "") -> MatrixInstances:
        """Return the instances transformed by a further matrix (3, 4), below an instance called `name`."""
        return replace(self, matrices=compose(outer[None], self.matrices), names=_below(self.names, name))


@dataclass(frozen=True, eq=False)
class PointInstances:
    """Instances as in a point instancer: `outer` * translation * rotation * scale, composed in double precision."""

    outer: Doubles  # (3, 4)
    positions: Numbers  # (K, 3)
    orientations: Numbers | None = None  # (K, 4): x, y, z, w, of any length; half, float or double
    scales: Numbers | None = None  # (K, 3)
    primvars: tuple[Primvar, ...] = ()  # INSTANCE, K rows
    names: Names | None = None  # if an AOV shows instances

    def __len__(self) -> int:
        return len(self.positions)

    def rows(self, start: int, stop: int) -> Doubles:
        """Return the matrices (stop - start, 3, 4)."""
        local = np.zeros((stop - start, 3, 4))
        if self.orientations is None:
            local[:, [0, 1, 2], [0, 1, 2]] = 1.0
        else:
            _rotate(local, self.orientations[start:stop])
        if self.scales is not None:
            local[:, :, :3] *= self.scales[start:stop, None, :]
        local[:, :, 3] = self.positions[start:stop]
        return local if np.array_equal(self.outer, IDENTITY) else compose(self.outer[None], local)

    def take(self, chosen: npt.NDArray[Any]) -> PointInstances:
        """Return the instances chosen by a mask or an array of indices."""
        orientations = None if self.orientations is None else chosen_rows(self.orientations, chosen)
        scales = None if self.scales is None else chosen_rows(self.scales, chosen)
        primvars, names = _take(self.primvars, chosen), _take_names(self.names, chosen)
        return PointInstances(
            outer=self.outer,
            positions=chosen_rows(self.positions, chosen),
            orientations=orientations,
            scales=scales,
            primvars=primvars,
            names=names,
        )

    def placed(self, outer: Doubles, name: str = "") -> PointInstances:
        """Return the instances transformed by a further matrix (3, 4), below an instance called `name`."""
        return replace(self, outer=compose(outer[None], self.outer[None])[0], names=_below(self.names, name))


@dataclass(frozen=True, eq=False)
class MovingInstances:
    """Moving instances, the only level of their placement; motion.py defines the interpolation between times."""

    times: Doubles  # (S + 1,) fractions of the exposure's span
    matrices: Doubles  # (S + 1, K, 3, 4)
    frame: Doubles  # (K, 3, 4), at the frame
    turns: bool = False
    primvars: tuple[Primvar, ...] = ()  # INSTANCE, K rows
    names: Names | None = None  # if an AOV shows instances

    def __len__(self) -> int:
        return len(self.frame)

    def rows(self, start: int, stop: int) -> Doubles:
        """Return the matrices (stop - start, 3, 4) at the frame."""
        return self.frame[start:stop]

    def take(self, chosen: npt.NDArray[Any]) -> MovingInstances:
        """Return the instances chosen by a mask or an array of indices."""
        primvars, names = _take(self.primvars, chosen), _take_names(self.names, chosen)
        return replace(self, matrices=self.matrices[:, chosen], frame=self.frame[chosen], primvars=primvars, names=names)

    def placed(self, outer: Doubles, name: str = "") -> MovingInstances:
        """Return the instances transformed by a further matrix (3, 4), below an instance called `name`."""
        moved = np.stack([compose(outer[None], step) for step in self.matrices])
        return replace(self, matrices=moved, frame=compose(outer[None], self.frame), names=_below(self.names, name))


Instances = MatrixInstances | PointInstances | MovingInstances


@dataclass(frozen=True, eq=False)
class Placement:
    """Instances of a prototype: one for every combination of one instance from each level, the last level varying fastest."""

    prototype: int
    levels: tuple[Instances, ...]  # outermost first
    primvars: tuple[Primvar, ...] = ()  # INSTANCE, one row per instance

    def __len__(self) -> int:
        return math.prod(len(level) for level in self.levels)

    def chunks(self) -> Iterator[Doubles]:
        """Yield world_from_prototype (n, 3, 4) of all instances in order, at most CHUNK at a time."""
        return chunks(self.levels)

    @property
    def nbytes(self) -> int:
        return sum(a.nbytes for level in self.levels for a in vars(level).values() if isinstance(a, np.ndarray))


def chunks(levels: Sequence[Instances], size: int = CHUNK) -> Iterator[Doubles]:
    """Yield the products (n, 3, 4) of the levels' matrices, n <= `size`, the last level varying fastest."""
    if not levels:
        yield IDENTITY[None]
        return
    *outer, last = levels
    count = len(last)
    if not outer or count == 0:
        yield from (last.rows(start, min(start + size, count)) for start in range(0, count, size))
    elif count > size:
        for one in (row[None] for block in chunks(outer, size) for row in block):
            yield from (compose(one, inner) for inner in chunks([last], size))
    else:
        inner = last.rows(0, count)
        yield from (compose(block, inner) for block in chunks(outer, size // count))


def compose(outer: Doubles, inner: Doubles) -> Doubles:
    """Return the products (N * K, 3, 4) of every outer (N, 3, 4) and every inner (K, 3, 4) matrix, the inner one varying
    fastest."""
    n, k = len(outer), len(inner)
    columns = inner.transpose(1, 0, 2).reshape(3, k * 4)
    product = (outer[:, :, :3].reshape(-1, 3) @ columns).reshape(n, 3, k, 4)
    result = np.ascontiguousarray(product.transpose(0, 2, 1, 3))
    result[..., 3] += outer[:, None, :, 3]
    return result.reshape(n * k, 3, 4)


def placed_box(levels: Sequence[Instances], box: Box) -> Box:
    """Return a box around all images of a box; not the tightest one for several levels, or for rotated and scaled instances."""
    for level in reversed(levels):
        box = _level_box(level, box)
    return box


def transformed_box(m: Doubles, box: Box) -> Box:
    """Return the box around the image of a box (Arvo 1990, "Transforming Axis-Aligned Bounding Boxes")."""
    center, half = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
    c, h = m[..., :3, :3] @ center + m[..., :3, 3], np.abs(m[..., :3, :3]) @ half
    return c - h, c + h


def transformed_boxes(m: Doubles, low: Doubles, high: Doubles) -> Box:
    """Return the boxes around the images of boxes (N, 3), each under its own matrix (N, 4, 4)."""
    center, half = ((low + high) / 2)[..., None], ((high - low) / 2)[..., None]
    c, h = (m[:, :3, :3] @ center)[..., 0] + m[:, :3, 3], (np.abs(m[:, :3, :3]) @ half)[..., 0]
    return c - h, c + h


def _level_box(level: Instances, box: Box) -> Box:
    if isinstance(level, PointInstances):
        return transformed_box(level.outer, _points_box(level, box))
    matrices = level.matrices.reshape(-1, 3, 4)
    with np.errstate(invalid="ignore", over="ignore"):
        low, high = transformed_box(matrices, box)
        finite = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
    return (low[finite].min(axis=0), high[finite].max(axis=0)) if finite.any() else (np.zeros(3), np.zeros(3))


def _points_box(level: PointInstances, box: Box) -> Box:
    low, high = (corner.astype(np.float64) for corner in extremes(level.positions))
    sizes = np.ones(3)
    if level.scales is not None:
        least, most = extremes(level.scales)
        sizes = np.maximum(np.abs(least), np.abs(most)).astype(np.float64)
    far = np.maximum(np.abs(box[0]), np.abs(box[1])) * sizes
    if level.orientations is not None:
        far = np.full(3, np.linalg.norm(far))
    elif level.scales is None:
        return low + box[0], high + box[1]
    return low - far, high + far


def _take(primvars: tuple[Primvar, ...], chosen: npt.NDArray[Any]) -> tuple[Primvar, ...]:
    return tuple(replace(p, values=chosen_rows(p.values, chosen)) for p in primvars)


def _take_names(names: Names | None, chosen: npt.NDArray[Any]) -> Names | None:
    return None if names is None else names.take(chosen)


def _below(names: Names | None, outer: str) -> Names | None:
    return None if names is None else names.below(outer)


def named_levels(levels: Sequence[Instances]) -> Levels:
    """Return the number of instances and names of each level."""
    return tuple((len(level), level.names) for level in levels)


def rows_of_levels(levels: Sequence[Instances]) -> tuple[Primvar, ...]:
    """Return the primvars of a placement of these levels, one row per instance; of equal names the innermost level's is
    used."""
    found: dict[str, Primvar] = {}
    counts = [len(level) for level in levels]
    for i, level in enumerate(levels):
        before, after = math.prod(counts[:i]), math.prod(counts[i + 1 :])
        for p in level.primvars:
            values = p.values if before == after == 1 else np.tile(np.repeat(p.values, after, axis=0), (before, 1))
            found[p.name] = Primvar(p.name, Interpolation.INSTANCE, values)
    return tuple(found.values())


def put_rotations(out: Doubles, quaternions: Doubles, scales: Doubles | float) -> None:
    """Write the rotation matrices of quaternions (K, 4) x, y, z, w into out (K, 3, :3); `scales` are 2 over their squared
    lengths."""
    x, y, z, w = quaternions.T
    xs, ys, zs = x * scales, y * scales, z * scales
    out[:, 0, 0], out[:, 0, 1], out[:, 0, 2] = 1 - (y * ys + z * zs), x * ys - w * zs, x * zs + w * ys
    out[:, 1, 0], out[:, 1, 1], out[:, 1, 2] = x * ys + w * zs, 1 - (x * xs + z * zs), y * zs - w * xs
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = x * zs - w * ys, y * zs + w * xs, 1 - (x * xs + y * ys)


def _rotate(out: Doubles, quaternions: Numbers) -> None:
    """Write the rotation matrices of quaternions of any length; those of length 0 give the identity."""
    q = quaternions.astype(np.float64)
    x, y, z, w = q.T
    square = x * x + y * y + z * z + w * w
    put_rotations(out, q, np.divide(2.0, square, out=np.zeros_like(square), where=square > 0))


@dataclass(frozen=True, eq=False)
class Names:
    """Names that consist of `prefix` and a text or a bracketed number per instance."""

    prefix: str
    texts: npt.NDArray[np.object_] | None = None
    numbers: npt.NDArray[np.integer[Any]] | None = None

    def of(self, i: int) -> str:
        if self.texts is not None:
            return self.prefix + str(self.texts[i])
        return self.prefix if self.numbers is None else f"{self.prefix}[{int(self.numbers[i])}]"

    def take(self, chosen: npt.NDArray[Any]) -> Names:
        return Names(
            self.prefix,
            None if self.texts is None else self.texts[chosen],
            None if self.numbers is None else self.numbers[chosen],
        )

    def below(self, outer: str) -> Names:
        return Names(outer + self.prefix, self.texts, self.numbers)


def texts(names: Sequence[str]) -> Names:
    return Names("", np.array(names, dtype=object))


# Number of instances and their names for each level of a placement, outermost first.
Levels = Sequence[tuple[int, Names | None]]


def instance_name(levels: Levels, row: int) -> str:
    """Return the name of one instance (row) of a placement; the last level varies fastest."""
    parts = []
    for count, names in reversed(levels):
        row, own = divmod(row, count)
        parts.append("" if names is None else names.of(own))
    return "".join(reversed(parts))


def all_names(levels: Levels) -> Names | None:
    """Return the names of all instances, in order; None if none has a name."""
    if all(names is None for _, names in levels):
        return None
    return texts([instance_name(levels, row) for row in range(math.prod(count for count, _ in levels))])
