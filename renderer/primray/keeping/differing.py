"""In which fields two descriptions differ: arrays and shapes by being the very same object, small things by their values."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ..description import SceneDescription

_LONG = frozenset({"shapes", "static", "prototypes", "placements", "lights", "surfaces"})

SETTINGS = "asked"  # what a stage asks of the render: no part of a scene is made of it
ALL = frozenset(f.name for f in fields(SceneDescription))


def differing(one: SceneDescription, other: SceneDescription) -> frozenset[str]:
    """Names of fields. What is built twice from the same counts as different where it is long."""
    if one is other:
        return frozenset()
    return frozenset(
        f.name
        for f in fields(one)
        if f.name != SETTINGS and not _same_field(f.name, getattr(one, f.name), getattr(other, f.name))
    )


def same_items(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """The very same, in order."""
    return some is others or (len(some) == len(others) and all(map(lambda a, b: a is b, some, others)))


def same(one: Any, other: Any) -> bool:
    """By value, of dataclasses of numbers, arrays and the like."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)


def counts_alike(one: SceneDescription, other: SceneDescription) -> bool:
    """Whether there is as much of everything in both, which are diced, and their images are the same."""
    long = ("lights", "surfaces")
    return not differing(one, other) - {*long, "static", "camera", "time_code"} and (
        all(len(getattr(one, name)) == len(getattr(other, name)) for name in long)
        and [p.shape for p in one.static] == [p.shape for p in other.static]
        and [(s.inputs, s.pattern) for s in one.surfaces] == [(s.inputs, s.pattern) for s in other.surfaces]
        and [light.texture for light in one.lights] == [light.texture for light in other.lights]
    )


def _same_field(name: str, one: Any, other: Any) -> bool:
    return same_items(one, other) if name in _LONG else same(one, other)
