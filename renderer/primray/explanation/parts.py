"""Parts of a pixel that add up to it to the bit, each with its error.

The film adds samples as whole numbers (film/exact_sum.hpp). Each sample's number is divided among the categories of its paths,
and the sums of a category over the samples are its part: all parts together are the film's own number.

Errors come from further renders of the same pixel with other seeds, each with as many samples: a part's standard error is the
standard deviation of its values there, at one degree of freedom fewer than there are renders. It is of one pixel's light, so
it holds whatever the samples of a pixel have in common.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..sampling.error import student_quantile

BIN_BITS, LOWEST_BIN = 40, -4  # as in exact_sum.hpp
RARE = 16.0  # least ratio of the squared mean of all renders to its variance at which a part has an interval
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """The part of a pixel's light that one category has: R, G and B as in the picture.

    `error`: standard error of `value`; None for a single render. `interval`: 95 %; None where the paths are too rare for one
    (`is_rare`), which says that the true part may be several times larger. `difference`: of the picture's two replicates, with
    its sign: that of a sum of parts is the sum of theirs.
    """

    name: str
    value: Color
    error: Color | None
    interval: tuple[Color, Color] | None
    difference: Color
    share: float  # of the pixel's luminance
    share_error: float | None
    expression: str = ""  # light path expression whose output has this light; "": none has
    is_rare: bool = False

    def as_json(self) -> dict[str, Any]:
        found: dict[str, Any] = {
            "name": self.name,
            "value": list(self.value),
            "error": None if self.error is None else list(self.error),
            "ci95": None if self.interval is None else [list(end) for end in self.interval],
            "difference": list(self.difference),
            "share": self.share,
            "share_error": self.share_error,
            "rare": self.is_rare,
        }
        return found | ({"expression": self.expression} if self.expression else {})


@dataclass(frozen=True)
class Sums:
    """Sums of both replicates of a pixel by category: `parts` (2, 3) in the film's units, `units` (2, 3), `counts` (2,)."""

    parts: Mapping[str, list[list[int]]]
    units: tuple[tuple[float, ...], ...]
    counts: tuple[int, int]

    def totals(self) -> list[list[int]]:
        """Return the whole numbers that the film holds of the pixel, by replicate and channel."""
        return [[sum(part[r][c] for part in self.parts.values()) for c in range(3)] for r in range(2)]

    def means(self, scale: float) -> dict[str, tuple[Doubles, Doubles]]:
        """Return each category's light (3,) and the difference of the replicates (3,), as film.cpp estimates a pixel."""
        total = sum(self.counts)
        weight = self.counts[0] / total
        found = {}
        for name, sums in self.parts.items():
            a, b = (
                np.array([sums[r][c] * self.units[r][c] / max(self.counts[r], 1) * scale for c in range(3)]) for r in range(2)
            )
            found[name] = weight * a + (1 - weight) * b, math.sqrt(weight * (1 - weight)) * (a - b)
        return found


def exact_sums(samples: Sequence[tuple[int, Color, Mapping[str, Doubles]]]) -> Sums:
    """Return the sums of samples by category.

    `samples`: replicate, value as the film added it, and light (3,) by category. Categories are scaled to the value, of which
    the lens may have absorbed a part, or a clamp have taken one.
    """
    finite = [sample for sample in samples if all(map(math.isfinite, sample[1]))]
    counts = tuple(sum(replicate == r for replicate, *_ in finite) for r in range(2))
    units = tuple(
        tuple(_unit(max((abs(value[c]) for replicate, value, _ in finite if replicate == r), default=0.0)) for c in range(3))
        for r in range(2)
    )
    parts: dict[str, list[list[int]]] = {}
    for replicate, value, light in finite:
        for c in range(3):
            for name, number in _divided(value[c], {name: float(part[c]) for name, part in light.items()}, units[replicate][c]):
                parts.setdefault(name, [[0, 0, 0], [0, 0, 0]])[replicate][c] += number
    return Sums(parts, units, (counts[0], counts[1]))


UNKNOWN = "not told apart"


def _divided(value: float, light: Mapping[str, float], unit: float) -> Iterable[tuple[str, int]]:
    """Yield whole numbers of units that add up to that of `value`: what rounding leaves goes to the largest."""
    whole, total = int(value / unit), sum(light.values())
    if whole == 0 and not light:
        return
    if total == 0 or not math.isfinite(total):
        yield UNKNOWN, whole
        return
    numbers = {name: int(part * (value / total) / unit) for name, part in light.items()}
    largest = max(light, key=lambda name: abs(light[name]))
    numbers[largest] += whole - sum(numbers.values())
    yield from numbers.items()


def _unit(largest: float) -> float:
    """Return the unit of the lower one of the two bins that a sum keeps, whose largest term this is."""
    exponent = math.frexp(largest)[1] - 1 if largest >= 2.0**-126 else -127
    return math.ldexp(1.0, BIN_BITS * ((exponent - LOWEST_BIN * BIN_BITS) // BIN_BITS + LOWEST_BIN - 1))


def settled(values: Mapping[str, Doubles], pixel: npt.NDArray[np.float32]) -> dict[str, Doubles]:
    """Return the values with the largest of each channel moved by what rounding takes: their sum rounds to the pixel."""
    found = {name: value.copy() for name, value in values.items()}
    for c in range(3):
        names = list(found)
        if not names or np.float32(math.fsum(found[name][c] for name in names)) == pixel[c]:
            continue
        largest = max(names, key=lambda name: abs(found[name][c]))
        found[largest][c] = math.fsum([float(pixel[c]), *(-found[name][c] for name in names if name != largest)])
    return found


def parts_of(
    values: Mapping[str, Doubles],
    differences: Mapping[str, Doubles],
    groups: Sequence[Mapping[str, Doubles]],
    weights: Doubles,
    *,
    ratio: float = 1.0,
    expressions: Mapping[str, str] | None = None,
) -> tuple[Part, ...]:
    """Return the parts, the largest first. `groups`: values of the renders with other seeds, `ratio` of whose variance the
    picture's is; `weights` of the channels in luminance."""
    total = float(sum(np.dot(weights, value) for value in values.values()))
    zero = np.zeros(3)
    found = []
    for name in dict.fromkeys([*values, *(name for group in groups for name in group)]):
        value = values.get(name, zero)
        error = share_error = interval = None
        is_rare = False
        if len(groups) > 1:
            others = np.array([group.get(name, zero) for group in groups])
            error = others.std(axis=0, ddof=1) * math.sqrt(ratio)
            bright = others @ weights
            deviation, mean = float(bright.std(ddof=1)), float(bright.mean())
            is_rare = deviation > 0 and len(groups) * mean**2 < RARE * deviation**2
            share_error = deviation * math.sqrt(ratio) / total if total > 0 else None
            reach = student_quantile(len(groups) - 1) * error
            interval = None if is_rare else (color_of(np.minimum(value, np.maximum(value - reach, 0))), color_of(value + reach))
        found.append(
            Part(
                name,
                color_of(value),
                None if error is None else color_of(error),
                interval,
                color_of(differences.get(name, zero)),
                float(np.dot(weights, value)) / total if total > 0 else 0.0,
                share_error,
                "" if expressions is None else expressions[name],
                is_rare,
            )
        )
    return tuple(sorted((part for part in found if any(part.value) or part.is_rare), key=lambda part: -part.share))


def color_of(values: Iterable[float]) -> Color:
    r, g, b = map(float, values)
    return r, g, b
