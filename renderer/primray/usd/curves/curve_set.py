"""Many curves as cubic Bezier segments: how values on their vertices, segments and curves come to the seam's Curves.

A curve of n segments has 3 n + 1 control points and n + 1 ends of segments (description.Curves). Curves that cannot be drawn
are left out, so arrays of what is drawn may be shorter than those of what is authored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..shapes.primvars import Sizes

Ints = npt.NDArray[np.integer[Any]]

# Control points of a segment whose value goes evenly from its first end to its last.
EVENLY = np.array([[1.0, 0.0], [2 / 3, 1 / 3], [1 / 3, 2 / 3], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class CurveSet:
    """C curves that are drawn, of S segments in all."""

    sizes: Sizes  # of what is authored: faces are curves, varying ones ends of segments
    drawn: Ints  # (C,) number of each among those authored
    segments: Ints  # (C,) at least 1
    corners: Ints  # (S, k) vertices of each, counted over `extended`
    to_bezier: Doubles  # (4, k), or (S, 4, k): a segment's control points of its vertices
    ends: Ints  # (S + C,) which of the authored ends of segments each is
    closed: bool = False
    joined: bool = True
    within: Doubles | None = None  # (S + C,) how far each end is on the way to the next authored one
    pinned: tuple[Ints, Ints] | None = None  # by phantom point: the vertex that it is beyond, and the one before that

    @property
    def first_segments(self) -> Ints:
        """(C,) the number of each curve's first segment."""
        return np.asarray(np.cumsum(self.segments) - self.segments)

    def extended(self, values: Floats) -> Floats:
        """Vertices' values with those of phantom points after them."""
        if self.pinned is None:
            return values
        at, before = self.pinned
        return np.concatenate([values, 2 * values[at] - values[before]])

    def controls(self, values: Floats) -> Floats:
        """(3 S + C, k) from (V, k): values at the control points, of those at vertices."""
        extended = self.extended(values.astype(np.float64, copy=False))
        return self.laid_out(np.matmul(self.to_bezier, extended[self.corners]))

    def at_ends(self, values: Floats) -> Floats:
        """(S + C, k) at the ends of segments, of those that are authored."""
        found = values[self.ends]
        if self.within is None:
            return found
        after = values[np.minimum(self.ends + 1, len(values) - 1)]
        return np.asarray(found + (after - found) * self.within[:, None].astype(np.float32))

    def controls_of_ends(self, ends: Floats) -> Floats:
        """(3 S + C, k) from (S + C, k): linear from end to end."""
        first = np.arange(int(self.segments.sum())) + np.repeat(np.arange(len(self.segments)), self.segments)
        both = np.stack([ends[first], ends[first + 1]], axis=1).astype(np.float64)
        return self.laid_out(np.matmul(EVENLY, both))

    def laid_out(self, controls: Doubles) -> Floats:
        """(3 S + C, k) from four of each segment (S, 4, k), of which neighbours share one."""
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
        """(3 S + C, k) from (C, k)."""
        return np.repeat(of_curves, 3 * self.segments + 1, axis=0)


def run_lengths(counts: Ints) -> tuple[Ints, Ints]:
    """For each of sum(counts) elements: its run, and its number within that."""
    runs = np.repeat(np.arange(len(counts)), counts)
    return runs, np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def ends_of(segments: Ints, authored_segments: Ints, drawn: Ints, *, closed: bool) -> Ints:
    """(S + C,) which of the authored ends of segments each end of a drawn curve is: closed ones end where they begin."""
    per_curve = authored_segments + (0 if closed else 1)
    first = (np.cumsum(per_curve) - per_curve)[drawn]
    run, within = run_lengths(segments + 1)
    if closed:
        within = within % segments[run]
    return np.asarray(first[run] + within)
