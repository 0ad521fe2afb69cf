"""Parts of a picture to single precision, so that they still add up to it.

Sums of the film are exact: what expressions take apart adds up to the picture's own sums, to the last digit. Single precision
rounds each to its own last place, though, and the rounded ones need not add up to the rounded picture. Wherever expressions
that exclude each other are all of a pixel, the largest of them is rounded so that they do: added in double precision, they
round to the picture's value to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats


def groups_apart(members: Sequence[int], count: int) -> list[tuple[int, ...]]:
    """Groups of expressions, as large as they can be from each on, of which no two match the same light."""
    meets = [0] * count
    for mask in members:
        for e in range(count):
            if mask >> e & 1:
                meets[e] |= mask
    found = []
    for first in range(count):
        group = [first]
        for e in [*range(first + 1, count), *range(first)]:
            if not any(meets[e] >> other & 1 for other in group):
                group.append(e)
        found.append(tuple(sorted(group)))
    return [group for group in dict.fromkeys(found) if len(group) > 1]


def rounded(means: Doubles, picture: Floats, groups: Sequence[tuple[int, ...]]) -> Floats:
    """`means` (E, H, W, 3) to single precision, so that groups that are all of the picture add up to it."""
    values = means.astype(np.float32)
    settled = np.zeros(values.shape, bool)
    for group in groups:
        members = list(group)
        total = means[members].sum(axis=0)
        whole = (np.abs(total - picture.astype(np.float64)) <= 2.0**-23 * np.abs(picture)) & (total > 0)
        _settle(values, settled, members, picture, whole)
        settled[members] |= whole
    return values


def _settle(
    values: Floats, settled: npt.NDArray[np.bool_], members: list[int], picture: Floats, whole: npt.NDArray[np.bool_]
) -> None:
    """Changes the largest of the members that no group has settled, where they are the whole."""
    own = values[members]
    free = ~settled[members] & whole
    largest = np.where(free, own, -1).argmax(axis=0)
    places = np.nonzero(free.any(axis=0))
    parts = own[:, places[0], places[1], places[2]].astype(np.float64)  # (M, N)
    wanted, at = picture[places], largest[places]
    columns = np.arange(parts.shape[1])
    others = parts.sum(axis=0) - parts[at, columns]
    chosen = (wanted.astype(np.float64) - others).astype(np.float32)
    for way in (None, np.float32(np.inf), np.float32(-np.inf)):
        tried = chosen if way is None else np.nextafter(chosen, way)
        fits = (others + tried).astype(np.float32) == wanted
        parts[at[fits], columns[fits]] = tried[fits]
        chosen = np.where(fits, tried, chosen)
    _break_ties(parts, at, free[:, places[0], places[1], places[2]], wanted)
    result = own.copy()
    result[:, places[0], places[1], places[2]] = parts.astype(np.float32)
    values[members] = result


def _break_ties(parts: Doubles, at: npt.NDArray[np.intp], free: npt.NDArray[np.bool_], wanted: Floats) -> None:
    """Where the others lie half-way between two places of the whole: the smallest of them gives way by its own last place."""
    columns = np.flatnonzero(parts.sum(axis=0).astype(np.float32) != wanted)
    for column in columns.tolist():
        own, largest = parts[:, column], at[column]
        small = np.where(free[:, column] & (own > 0), own, np.inf)
        small[largest] = np.inf
        least = int(small.argmin())
        if not np.isfinite(small[least]):
            continue
        own[least] = np.nextafter(np.float32(own[least]), np.float32(np.inf))
        own[largest] = np.float32(float(wanted[column]) - (own.sum() - own[largest]))
