"""Layout of many curves as cubic Bezier segments: mapping of values on vertices, segments and curves to those of
description.Curves.

A curve of n segments has 3 n + 1 control points and n + 1 segment ends (description.Curves). Curves that cannot be drawn are
left out, so drawn arrays may be shorter than authored ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..primvars.reading import Sizes

Ints = npt.NDArray[np.integer[Any]]

# Control points of a segment along which a value varies linearly.
EVENLY = np.array([[1.0, 0.0], [2 / 3, 1 / 3], [1 / 3, 2 / 3], [0.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveSet:
    """Drawn curves (C) with their segments (S in all) and the mapping from authored values."""

    sizes: Sizes  # authored sizes: uniform per curve, varying per segment end
    drawn: Ints  # (C,) index of each among the authored curves
    segments: Ints  # (C,) at least 1
    corners: Ints  # (S, k) vertices of each segment, indices into `extended`
    to_bezier: Doubles  # (4, k) or (S, 4, k): control points of a segment from its vertices
    ends: Ints  # (S + C,) index of each drawn segment end among the authored ones
    closed: bool = False
    joined: bool = True
    within: Doubles | None = None  # (S + C,) position of each end between that authored end and the next
    pinned: tuple[Ints, Ints] | None = None  # (P,) each: vertex next to each phantom point, and the vertex before that

    @property
    def first_segments(self) -> Ints:
        """Index of each curve's first segment (C,)."""
        return np.asarray(np.cumsum(self.segments) - self.segments)

    def extended(self, values: Floats) -> Floats:
        """Return the values at vertices, followed by those at the phantom points of pinned curves."""
        if self.pinned is None:
            return values
        at, before = self.pinned
        return np.concatenate([values, 2 * values[at] - values[before]])

    def controls(self, values: Floats) -> Floats:
        """Return values at control points (3 S + C, k) from values at vertices (V, k)."""
        extended = self.extended(values.astype(np.float64, copy=False))
        return self.laid_out(np.matmul(self.to_bezier, extended[self.corners]))

    def at_ends(self, values: Floats) -> Floats:
        """Return values at segment ends (S + C, k) from authored values at segment ends."""
        found = values[self.ends]
        if self.within is None:
            return found
        after = values[np.minimum(self.ends + 1, len(values) - 1)]
        return np.asarray(found + (after - found) * self.within[:, None].astype(np.float32))

    def controls_of_ends(self, ends: Floats) -> Floats:
        """Return values at control points (3 S + C, k) that vary linearly between segment ends (S + C, k)."""
        first = np.arange(int(self.segments.sum())) + np.repeat(np.arange(len(self.segments)), self.segments)
        both = np.stack([ends[first], ends[first + 1]], axis=1).astype(np.float64)
        return self.laid_out(np.matmul(EVENLY, both))

    def laid_out(self, controls: Doubles) -> Floats:
        """Return control points (3 S + C, k) from four per segment (S, 4, k), of which adjacent segments share one."""
        count, columns = len(controls), controls.shape[2]
        out = np.empty((3 * count + len(self.segments), columns), np.float32)
        at = 3 * np.arange(count) + np.repeat(np.arange(len(self.segments)), self.segments)
        for k in range(3):
            out[at + k] = controls[:, k]
        last = np.cumsum(self.segments) - 1
        out[at[last] + 3] = controls[last, 3]
        if self.closed:
            out[at[last] + 3] = out[at[self.first_segments]]
        return out

    def per_control(self, of_curves: Floats) -> Floats:
        """Return values at control points (3 S + C, k) from values per curve (C, k)."""
        return np.repeat(of_curves, 3 * self.segments + 1, axis=0)


def run_lengths(counts: Ints) -> tuple[Ints, Ints]:
    """Return, for each of sum(counts) elements, the index of its run and its position within the run."""
    runs = np.repeat(np.arange(len(counts)), counts)
    return runs, np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def ends_of(segments: Ints, authored_segments: Ints, drawn: Ints, *, closed: bool) -> Ints:
    """Return the index (S + C,) of each drawn segment end among the authored ones; closed curves end where they begin."""
    per_curve = authored_segments + (0 if closed else 1)
    first = (np.cumsum(per_curve) - per_curve)[drawn]
    run, within = run_lengths(segments + 1)
    if closed:
        within = within % segments[run]
    return np.asarray(first[run] + within)
