"""Differences of two descriptions by field: arrays and shapes are compared by identity, small values by equality."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ..description import SceneDescription

_LONG = frozenset({"shapes", "static", "prototypes", "placements", "lights", "surfaces"})

SETTINGS = "asked"  # the stage's requests to the renderer: no part of a scene depends on it
ALL = frozenset(f.name for f in fields(SceneDescription))


def differing(one: SceneDescription, other: SceneDescription) -> frozenset[str]:
    """Return the names of fields that differ. Long fields built twice from the same input count as different."""
    if one is other:
        return frozenset()
    return frozenset(
        f.name
        for f in fields(one)
        if f.name != SETTINGS and not _same_field(f.name, getattr(one, f.name), getattr(other, f.name))
    )


def same_items(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Return whether both have the very same objects, in order."""
    return some is others or (len(some) == len(others) and all(map(lambda a, b: a is b, some, others)))


def same(one: Any, other: Any) -> bool:
    """Return whether two values, such as dataclasses of numbers and arrays, are equal."""
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
    """Return whether two diced descriptions have the same numbers of everything and the same images."""
    long = ("lights", "surfaces")
    return not differing(one, other) - {*long, "static", "camera", "time_code"} and (
        all(len(getattr(one, name)) == len(getattr(other, name)) for name in long)
        and [p.shape for p in one.static] == [p.shape for p in other.static]
        and [(s.inputs, s.pattern) for s in one.surfaces] == [(s.inputs, s.pattern) for s in other.surfaces]
        and [light.texture for light in one.lights] == [light.texture for light in other.lights]
    )


def _same_field(name: str, one: Any, other: Any) -> bool:
    return same_items(one, other) if name in _LONG else same(one, other)
