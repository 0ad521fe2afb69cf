"""AOVs of light path expressions, rounded to single precision such that they still add up to the picture.

The film's sums are exact, so disjoint expressions that cover all paths add up to the picture's sums exactly. After rounding to
single precision they need not add up to the rounded picture. Wherever disjoint expressions account for all light of a pixel,
the largest is therefore adjusted: added in double precision, they round to the picture's value bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import AovRequest, light_path_of
from ..arrays import Doubles, Floats
from .aov import Aov, channel_names, make_aov


def light_paths_of_film(scene: core.CoreScene, requests: Sequence[AovRequest], film: core.Film) -> dict[str, Aov]:
    """Return AOVs of light path expressions by name."""
    assert scene.light_paths is not None
    return light_paths_of(requests, scene.light_paths.expressions, scene.light_paths.members, film)


def light_paths_of(
    requests: Sequence[AovRequest], expressions: Sequence[str], members: Sequence[int], film: core.Film
) -> dict[str, Aov]:
    """Return AOVs by name.

    `expressions` are in the film's order; `members` are bit sets of expressions that some path may match together.
    """
    means, differences = film.light_path_images()
    values = rounded(means, film.pixels[..., :3], groups_apart(members, len(expressions)))
    found: dict[str, Aov] = {}
    for request in requests:
        expression = light_path_of(request.source)
        assert expression is not None
        number = expressions.index(expression)
        found[request.name] = _aov(request, values[number], differences[number])
    return found


def _aov(request: AovRequest, values: Floats, differences: Floats) -> Aov:
    meaning = f"light of paths that are {light_path_of(request.source)}"
    errors = np.where(np.isnan(differences), np.float32(np.inf), np.abs(differences)) if request.errors else None
    if request.data_type:
        return replace(make_aov(request, values, errors=errors), meaning=meaning)
    name = request.name if request.prefix is None else request.prefix
    return Aov(
        values,
        channel_names(name, ("R", "G", "B")),
        request.source,
        meaning,
        metadata=dict(request.header),
        errors=errors,
        differences=differences if request.differences else None,
    )


def groups_apart(members: Sequence[int], count: int) -> list[tuple[int, ...]]:
    """Return maximal groups of expressions of which no two match the same path."""
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
    """Return `means` (E, H, W, 3) in single precision, such that groups that make up the whole picture add up to it."""
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
    """Adjust the largest member that no earlier group has adjusted, where the group is the whole picture."""
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
    """Move the smallest member by one unit in the last place where the sum of the others lies half-way between two floats."""
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
