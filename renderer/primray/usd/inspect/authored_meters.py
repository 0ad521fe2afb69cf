"""Light meters that are authored on a stage by PrimrayLightMeterAPI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd

from ...arrays import Doubles
from ...diagnostics import Diagnostics
from ..scene.inheritance import transforms, world_matrix
from ..stage.metadata import meters_per_unit, up_axis
from ..stage.reads import property_names, schemas_applied
from ..stage.traversal import range_with_instances
from ..stage.values import matrix, number, token, vector, when_of_few

SCHEMA, PREFIX = "PrimrayLightMeterAPI", "primray:lightMeter:"
ATTRIBUTES = tuple(PREFIX + name for name in ("kind", "size", "counts", "border"))


@dataclass(frozen=True)
class AuthoredMeter:
    """A prim that is a light meter: it looks along -Z, and a grid is a rectangle about the origin of its XY plane."""

    path: str
    world_from_prim: Doubles  # (4, 4)
    kind: str
    size: tuple[float, ...]  # of the grid, in the prim's units; (0, 0): a single point
    counts: tuple[float, ...]  # (0, 0): by the grid's size
    border: float  # metres; below 0: by the grid's size


@dataclass(frozen=True)
class AuthoredMeters:
    meters: tuple[AuthoredMeter, ...]
    meters_per_unit: float
    up: tuple[float, float, float]


def authored_meters(stage: Usd.Stage, time_code: float | None, diagnostics: Diagnostics) -> AuthoredMeters:
    """Return the light meters of a stage in its order, those in native instances by their proxies; and its units."""
    when = when_of_few(time_code)
    cache = transforms(when)
    found = []
    for prim in range_with_instances(stage.GetPseudoRoot()):
        names = [name for name in property_names(prim) if name.startswith(PREFIX)]
        if not names and SCHEMA not in schemas_applied(prim):
            continue
        path = str(prim.GetPath())
        for name in sorted(names):
            if name not in ATTRIBUTES:
                diagnostics.add("unknown-input", path, f"{name} is ignored: {SCHEMA} has no such attribute.", name)
        kind, size, counts, border = ATTRIBUTES
        found.append(
            AuthoredMeter(
                path,
                np.asarray(matrix(world_matrix(prim, when, cache))),
                token(prim, kind, when, "illuminance"),
                vector(prim, size, when, (0.0, 0.0), diagnostics),
                vector(prim, counts, when, (0.0, 0.0), diagnostics),
                number(prim, border, when, -1.0, diagnostics),
            )
        )
    up = (0.0, 0.0, 1.0) if up_axis(stage) == "Z" else (0.0, 1.0, 0.0)
    return AuthoredMeters(tuple(found), meters_per_unit(stage), up)
