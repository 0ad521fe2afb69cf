"""Units of a document's values: conversion factors from an input's unit to the one that its node expects.

An input's value is converted from its own unit to the one that the node's definition names, else to the scene unit of its type
(specification of MaterialX, "Units" and "NodeDef Input Elements"). The scene unit of distance is the stage's metersPerUnit;
for every other type it is the unit of scale 1, for angles degrees.
"""

from __future__ import annotations

import math
from typing import Any

_TYPES = ("float", "vector2", "vector3", "vector4", "floatarray", "vector2array", "vector3array", "vector4array", "filename")
_DISTANCE = "distance"


class UnitError(Exception):
    """A unit that cannot be converted; the message says why."""


class Units:
    """Units that a document and the standard library define, and the scene's."""

    def __init__(self, document: Any, meters_per_unit: float) -> None:
        self._meters_per_unit = meters_per_unit
        self._scales: dict[str, dict[str, float]] = {}
        for definition in document.getUnitDefs():
            scales = self._scales.setdefault(definition.getAttribute("unittype"), {})
            for unit in definition.getUnits():
                scales[unit.getName()] = _scale(unit.getAttribute("scale"))

    def factor(self, element: Any, expected: Any = None) -> float:
        """Return the factor for an element's value; UnitError where its unit has no meaning.

        `expected`: the input of that name in the node's definition, None where there is none.
        """
        unit = element.getAttribute("unit")
        if not unit:
            return 1.0
        defined_type = expected.getAttribute("unittype") if expected is not None else ""
        unit_type = element.getAttribute("unittype") or defined_type
        if element.getType() not in _TYPES:
            raise UnitError(f"it has the unit {unit}, but is not a float, vector or file")
        if not unit_type:
            raise UnitError(f"it has the unit {unit}, but neither it nor its definition has a unittype")
        if defined_type and unit_type != defined_type:
            raise UnitError(f"its unittype is {unit_type}, but its definition's is {defined_type}")
        target = expected.getAttribute("unit") if expected is not None else ""
        own = self._size(unit, unit_type)
        return own / (self._size(target, unit_type) if target else self._scene_unit(unit_type))

    def _scene_unit(self, unit_type: str) -> float:
        return self._meters_per_unit if unit_type == _DISTANCE else 1.0

    def _size(self, unit: str, unit_type: str) -> float:
        """Return the size of a unit in units of scale 1."""
        scales = self._scales.get(unit_type)
        if scales is None:
            raise UnitError(f"its unittype {unit_type} is not defined")
        size = scales.get(unit, 0.0)
        if not (math.isfinite(size) and size > 0):
            raise UnitError(f"there is no unit {unit} of the type {unit_type}")
        return size


def _scale(text: str) -> float:
    """Return a unit's scale: 1 where it has none, 0 where it is not a number."""
    try:
        return float(text) if text else 1.0
    except ValueError:
        return 0.0
