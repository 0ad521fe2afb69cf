"""Light meters that are authored on a stage by PrimrayLightMeterAPI."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from ...arrays import Doubles
from ...diagnostics import Diagnostics
from ..scene.inheritance import transforms, world_matrix
from ..stage.metadata import meters_per_unit, up_axis
from ..stage.reads import computed, metadatum, property_names, schemas_applied, targets, type_name
from ..stage.traversal import range_with_instances, world_prims_in_instances
from ..stage.values import When, array, matrix, number, read, time_of, token, vector, when_of_few

SCHEMA, PREFIX = "PrimrayLightMeterAPI", "primray:lightMeter:"
MOST_NESTED = 8  # instancers in prototypes of instancers; a cycle has no end
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
    """Return the light meters of a stage in its order, those in native instances by their proxies, and those of prototypes of
    point instancers at each of their instances, as /instancer[3]/meter; and its units."""
    when = when_of_few(time_code)
    reading = _Reading(stage, when, transforms(when), diagnostics)
    found = tuple(reading.below(stage.GetPseudoRoot(), "", Gf.Matrix4d(1.0)))
    up = (0.0, 0.0, 1.0) if up_axis(stage) == "Z" else (0.0, 1.0, 0.0)
    return AuthoredMeters(found, meters_per_unit(stage), up)


@dataclass(frozen=True)
class _Reading:
    stage: Usd.Stage
    when: When
    cache: UsdGeom.XformCache
    diagnostics: Diagnostics

    def below(self, root: Usd.Prim, name: str, placed: Gf.Matrix4d, depth: int = 0) -> Iterator[AuthoredMeter]:
        """Yield the meters from a prim down, whose names begin with `name` in place of its path; `placed` moves them to where
        they are drawn."""
        # What is below a class or an over is not in the world, unless an instancer draws it.
        prims = iter(range_with_instances(root) if name else world_prims_in_instances(root))
        for prim in prims:
            own = name + str(prim.GetPath()).removeprefix(str(root.GetPath()) if name else "")
            if type_name(prim) == "PointInstancer":
                prims.PruneChildren()
                yield from self._of_instances(prim, own, placed, depth)
            names = [each for each in property_names(prim) if each.startswith(PREFIX)]
            if names or SCHEMA in schemas_applied(prim):
                yield self._meter(prim, own, names, placed)

    def _meter(self, prim: Usd.Prim, own: str, names: list[str], placed: Gf.Matrix4d) -> AuthoredMeter:
        when, diagnostics = self.when, self.diagnostics
        for name in sorted(names):
            if name not in ATTRIBUTES:
                message = f"{name} is ignored: {SCHEMA} has no such attribute."
                diagnostics.add("unknown-input", str(prim.GetPath()), message, name)
        kind, size, counts, border = ATTRIBUTES
        return AuthoredMeter(
            own,
            matrix(world_matrix(prim, when, self.cache) * placed),
            token(prim, kind, when, "illuminance"),
            vector(prim, size, when, (0.0, 0.0), diagnostics),
            vector(prim, counts, when, (0.0, 0.0), diagnostics),
            number(prim, border, when, -1.0, diagnostics),
        )

    def _of_instances(self, prim: Usd.Prim, own: str, placed: Gf.Matrix4d, depth: int) -> Iterator[AuthoredMeter]:
        """Yield the meters below the prototypes of a point instancer, at each instance that is drawn."""
        roots = [self.stage.GetPrimAtPath(path) for path in targets(prim, "prototypes")]
        if depth > MOST_NESTED or not any(map(self._has_meters, roots)):
            return
        instancer = UsdGeom.PointInstancer(prim)
        exclude, ignore = UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        time = time_of(instancer.GetPositionsAttr(), self.when)
        of_instances = computed(lambda: instancer.ComputeInstanceTransformsAtTime(time, time, exclude, ignore), None)
        numbers = array(read(prim, "protoIndices", self.when), 1, "i")
        if of_instances is None or numbers is None:  # a render reports it
            return
        ids = array(read(prim, "ids", self.when), 1, "i")
        ids = np.arange(len(numbers)) if ids is None or len(ids) != len(numbers) else ids
        invisible, inactive = array(read(prim, "invisibleIds", self.when), 1, "i"), metadatum(prim, "inactiveIds")
        hidden: set[int] = set() if invisible is None else set(invisible.tolist())
        hidden |= set(inactive.GetAppliedItems()) if isinstance(inactive, Sdf.Int64ListOp) else set()
        world = world_matrix(prim, self.when, self.cache)
        for k, (which, own_place) in enumerate(zip(numbers.tolist(), of_instances, strict=False)):
            if not 0 <= which < len(roots) or not roots[which] or int(ids[k]) in hidden:
                continue
            root = roots[which]
            above = world_matrix(root.GetParent(), self.when, self.cache) if root.GetParent() else Gf.Matrix4d(1.0)
            there = above.GetInverse() * own_place * world * placed
            yield from self.below(root, f"{own}[{k}]", there, depth + 1)

    def _has_meters(self, root: Usd.Prim) -> bool:
        """Return whether a prototype may hold a meter: most have thousands of instances and none."""
        return bool(root) and any(
            type_name(prim) == "PointInstancer"
            or SCHEMA in schemas_applied(prim)
            or any(name.startswith(PREFIX) for name in property_names(prim))
            for prim in range_with_instances(root)
        )
