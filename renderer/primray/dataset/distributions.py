"""What a value is drawn from: the forms that `to:` has in a config."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from .document import Entry
from .draws import Draws

MOST_TRIES = 10_000  # of a normal distribution that is cut off


class Distribution(Protocol):
    def draw(self, draws: Draws) -> Any:
        """Return the value for one sample."""


@dataclass(frozen=True)
class Constant:
    value: Any

    def draw(self, draws: Draws) -> Any:
        return self.value


@dataclass(frozen=True)
class Uniform:
    """Numbers from `low` to `high`; of vectors each component by itself. `log`: their logarithms are uniform."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    is_vector: bool
    log: bool = False

    def draw(self, draws: Draws) -> Any:
        found = [self._number(draws, *pair) for pair in zip(self.low, self.high, strict=True)]
        return found if self.is_vector else found[0]

    def _number(self, draws: Draws, low: float, high: float) -> float:
        return math.exp(draws.uniform(math.log(low), math.log(high))) if self.log else draws.uniform(low, high)


@dataclass(frozen=True)
class Normal:
    mean: float
    deviation: float
    low: float
    high: float

    def draw(self, draws: Draws) -> Any:
        for _ in range(MOST_TRIES):
            value = self.mean + self.deviation * draws.normal()
            if self.low <= value <= self.high:
                return value
        return min(max(self.mean, self.low), self.high)


@dataclass(frozen=True)
class Whole:
    low: int
    high: int

    def draw(self, draws: Draws) -> Any:
        return self.low + draws.below(self.high - self.low + 1)


@dataclass(frozen=True)
class Choice:
    values: tuple[Any, ...]
    weights: tuple[float, ...] = ()  # none: each as likely as the others

    def draw(self, draws: Draws) -> Any:
        if not self.weights:
            return self.values[draws.below(len(self.values))]
        at = draws.uniform(0.0, sum(self.weights))
        for value, weight in zip(self.values, self.weights, strict=True):
            at -= weight
            if at < 0:
                return value
        return self.values[-1]


@dataclass(frozen=True)
class InOrder:
    """The values by the sample's index, from the first one again after the last."""

    values: tuple[Any, ...]

    def draw(self, draws: Draws) -> Any:
        return self.values[draws.index % len(self.values)]


def distribution_of(entry: Entry) -> Distribution:
    """Return the distribution that an entry describes; any value that has no keys is a constant."""
    if not isinstance(entry.value, dict):
        return Constant(entry.plain)
    fields = entry.fields(optional=(*_FORMS, "weights", "within"))
    forms = [name for name in fields if name in _FORMS]
    if len(forms) != 1:
        raise entry.fault(f"it must have one of {', '.join(_FORMS)}")
    for extra, of in (("weights", "choice"), ("within", "normal")):
        if extra in fields and forms[0] != of:
            raise fields[extra].fault(f"{extra} is for {of} only")
    return _FORMS[forms[0]](fields[forms[0]], fields)


def _uniform(entry: Entry, fields: Any) -> Distribution:
    low, high, is_vector = _bounds(entry)
    return Uniform(low, high, is_vector)


def _log_uniform(entry: Entry, fields: Any) -> Distribution:
    low, high, is_vector = _bounds(entry)
    if min(low) <= 0:
        raise entry.fault("both ends must be above 0")
    return Uniform(low, high, is_vector, log=True)


def _bounds(entry: Entry) -> tuple[tuple[float, ...], tuple[float, ...], bool]:
    ends = entry.entries()
    if not isinstance(entry.value, list) or len(ends) != 2:
        raise entry.fault("it must be a list of two: the least and the greatest")
    is_vector = isinstance(ends[0].value, list)
    if is_vector != isinstance(ends[1].value, list):
        raise entry.fault("both ends must be numbers, or both lists of numbers")
    low, high = (tuple(each.number() for each in end.entries()) for end in ends)
    if len(low) != len(high) or not low:
        raise entry.fault(f"the ends have {len(low)} and {len(high)} numbers")
    if any(a > b for a, b in zip(low, high, strict=True)):
        raise entry.fault("the least is above the greatest")
    return low, high, is_vector


def _normal(entry: Entry, fields: Any) -> Distribution:
    mean, deviation = entry.numbers(2)
    if deviation < 0:
        raise entry.fault("a standard deviation must not be below 0")
    low, high = fields["within"].numbers(2) if "within" in fields else (-math.inf, math.inf)
    if low > high:
        raise fields["within"].fault("the least is above the greatest")
    return Normal(mean, deviation, low, high)


def _whole(entry: Entry, fields: Any) -> Distribution:
    ends = entry.entries()
    if not isinstance(entry.value, list) or len(ends) != 2:
        raise entry.fault("it must be a list of two: the least and the greatest")
    low, high = ends[0].whole(), ends[1].whole()
    if low > high:
        raise entry.fault("the least is above the greatest")
    return Whole(low, high)


def _choice(entry: Entry, fields: Any) -> Distribution:
    values = _values(entry)
    if "weights" not in fields:
        return Choice(values)
    weights = fields["weights"].numbers(len(values))
    if min(weights) < 0 or sum(weights) <= 0:
        raise fields["weights"].fault("weights must not be below 0, and one of them above it")
    return Choice(values, weights)


def _in_order(entry: Entry, fields: Any) -> Distribution:
    return InOrder(_values(entry))


def _values(entry: Entry) -> tuple[Any, ...]:
    if not isinstance(entry.value, list) or not entry.value:
        raise entry.fault("it must be a list of values")
    return tuple(entry.plain)


_FORMS: dict[str, Callable[[Entry, Any], Distribution]] = {
    "uniform": _uniform,
    "log_uniform": _log_uniform,
    "normal": _normal,
    "whole": _whole,
    "choice": _choice,
    "in_order": _in_order,
}


def possible_values(distribution: Distribution) -> tuple[Any, ...]:
    """Return the values that a distribution may give where these are listed, to check them ahead."""
    if isinstance(distribution, Choice | InOrder):
        return distribution.values
    return (distribution.value,) if isinstance(distribution, Constant) else ()
