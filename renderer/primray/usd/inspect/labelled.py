"""Labelled prims of a stage: which of them hold what a pixel shows, by their names in the world.

What is instanced is in the world several times, and a prim's path says only one of them. A labelled prim is therefore named
after the way to it: /street/car1/wheel in the native instance /street/car1, /lot[2] for the instance 2 of the point instancer
/lot, which shows the root of its prototype, and /lot[2]/wheel for a prim below that root.

Labels are those of UsdSemantics' LabelsAPI, and of the attributes that Omniverse used before it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from typing import Any, NamedTuple

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from ...arrays import Doubles
from ..scene.inheritance import transforms, world_matrix
from ..stage.metadata import meters_per_unit
from ..stage.reads import computed, property_names, targets
from ..stage.traversal import populated, range_with_instances
from ..stage.values import read, time_of, when_of_few

NAMESPACE = "semantics:labels:"
OLD, TYPE, DATA = "semantic:", ":params:semanticType", ":params:semanticData"
# Keypoints: the name of a prim's origin, or the names of points in its space.
KEYPOINT, KEYPOINTS = "primray:keypoint", "primray:keypoints"
SYMMETRIES = "primray:symmetries"
_PARTS = re.compile(r"/([^/\[\]]+)((?:\[\d+\])*)")
_INDEX = re.compile(r"\d+")


class Step(NamedTuple):
    """A prim on the way to what is seen: its name in the world, its path on the stage, and whether its instance follows."""

    name: str
    prim: Sdf.Path
    is_instancer: bool = False


@dataclass(frozen=True)
class LabelledPrim:
    """A labelled prim: its name in the world, its path on the stage, and its own labels, sorted and joined by commas."""

    name: str
    prim: str
    label: str


@dataclass(frozen=True)
class AuthoredPoint:
    """A named point of a labelled prim in the world; `radius`: how far below a surface it counts as visible, in scene units."""

    name: str
    position: list[float]
    radius: float | None


class LabelledPrims:
    """Labels of a stage at one time. Prims are asked for by path and by the name of the instance in which they are seen."""

    def __init__(self, stage: Usd.Stage, time_code: float | None) -> None:
        self.stage = stage
        self.when = when_of_few(time_code)
        self._own: dict[tuple[Sdf.Path, str], tuple[str, ...]] = {}
        self._routes: dict[str, tuple[Step, ...]] = {}
        self._instancers: dict[Sdf.Path, tuple[list[int], list[Sdf.Path]]] = {}
        self._instances: dict[Sdf.Path, Doubles] = {}
        self._matrices: dict[Sdf.Path, Doubles] = {}
        self._cache = transforms(self.when)
        self.has_keypoints = False  # known once the taxonomies have been asked for

    def inherited(self, prim: str, instance: str, taxonomy: str) -> tuple[str, ...]:
        """Return the labels of a prim and of all prims that hold it, sorted, as UsdSemanticsLabelsQuery computes them."""
        return tuple(sorted({label for step in self.way(prim, instance) for label in self._labels(step.prim, taxonomy)}))

    def holding(self, prim: str, instance: str, taxonomy: str) -> tuple[LabelledPrim, ...]:
        """Return the labelled prims that hold a prim, itself included, outermost first.

        The labels of a point instancer are those of each of its instances whose prototype's root has none, which then stand
        for the instancer.
        """
        found: list[LabelledPrim] = []
        handed: tuple[str, ...] = ()
        way = self.way(prim, instance)
        for step, after in zip_longest(way, way[1:]):
            own = self._labels(step.prim, taxonomy) or handed
            handed = ()
            if step.is_instancer and own and after is not None and not self._labels(after.prim, taxonomy):
                handed = own
            elif own:
                found.append(LabelledPrim(step.name, str(step.prim), ",".join(sorted(set(own)))))
        return tuple(found)

    def taxonomies(self) -> dict[str, tuple[str, ...]]:
        """Return the classes of each taxonomy of the stage, sorted: the labels of a prim, joined by commas, are one class."""
        found: dict[str, set[str]] = {}
        for prim in populated(self.stage):
            every = property_names(prim)
            self.has_keypoints |= any(name in (KEYPOINT, KEYPOINTS) for name in every)
            names = [name for name in every if name.startswith((NAMESPACE, OLD))]
            own = {name.removeprefix(NAMESPACE) for name in names if name.startswith(NAMESPACE)}
            own |= {str(read(prim, name, self.when)) for name in names if name.startswith(OLD) and name.endswith(TYPE)}
            for taxonomy in own:
                labels = self._labels(prim.GetPath(), taxonomy)
                if labels:
                    found.setdefault(taxonomy, set()).add(",".join(sorted(set(labels))))
        return {taxonomy: tuple(sorted(classes)) for taxonomy, classes in sorted(found.items())}

    @property
    def meters_per_unit(self) -> float:
        return meters_per_unit(self.stage)

    def world_from(self, name: str) -> Doubles:
        """Return world_from_prim (4, 4) of a labelled prim by its name."""
        if not self._route(name):
            return np.eye(4)
        world, base = np.eye(4), np.eye(4)  # world_from_base, and base_from_world of the stage
        last = self._route(name)[-1].prim
        for step, after in pairwise(self._route(name)):
            if step.is_instancer:
                index = int(_INDEX.findall(after.name)[-1])
                world = world @ base @ self._stage_matrix(step.prim) @ self._instance_matrix(step.prim, index)
                base = _inverse(self._stage_matrix(after.prim.GetParentPath()))
        return np.asarray(world @ base @ self._stage_matrix(last))

    def _stage_matrix(self, path: Sdf.Path) -> Doubles:
        """Return world_from_prim of a prim where the stage has it."""
        if path not in self._matrices:
            prim = self.stage.GetPrimAtPath(path)
            is_placed = prim and not prim.IsPseudoRoot()
            self._matrices[path] = np.array(world_matrix(prim, self.when, self._cache)).T if is_placed else np.eye(4)
        return self._matrices[path]

    def _instance_matrix(self, path: Sdf.Path, index: int) -> Doubles:
        """Return instancer_from_instance, without the transform of the prototype's root."""
        if path not in self._instances:
            instancer = UsdGeom.PointInstancer(self.stage.GetPrimAtPath(path))
            time = time_of(instancer.GetPositionsAttr(), self.when)
            count = len(self._instancers[path][0])
            exclude, ignore = UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
            found = computed(lambda: instancer.ComputeInstanceTransformsAtTime(time, time, exclude, ignore), None)
            matrices = np.tile(np.eye(4), (count, 1, 1))
            if found is not None and len(found) == count:
                matrices = np.array(found, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
            self._instances[path] = matrices
        return np.asarray(self._instances[path][index])

    def keypoints(self, name: str, taxonomy: str) -> list[AuthoredPoint]:
        """Return the authored points of a labelled prim, without those of labelled prims in it."""
        if not self.has_keypoints or not (route := self._route(name)):
            return []
        found: list[AuthoredPoint] = []
        root = self.stage.GetPrimAtPath(route[-1].prim)
        world_from_root, root_from_stage = self.world_from(name), _inverse(self._stage_matrix(route[-1].prim))
        below = iter(range_with_instances(root))
        for prim in below:
            if prim != root and self._labels(prim.GetPath(), taxonomy):
                below.PruneChildren()
                continue
            names, points, radius = self._authored_points(prim)
            if names:
                matrix = world_from_root @ root_from_stage @ self._stage_matrix(prim.GetPath())
                positions = np.asarray(points, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
                found += [AuthoredPoint(n, p, radius) for n, p in zip(names, positions.tolist(), strict=True)]
        return found

    def _authored_points(self, prim: Usd.Prim) -> tuple[list[str], Any, float | None]:
        one, several = read(prim, KEYPOINT, self.when), read(prim, KEYPOINTS, self.when)
        radius = read(prim, KEYPOINT + ":radius", self.when)
        names, points = [str(one)] if one else [], [[0.0, 0.0, 0.0]] if one else []
        if several:
            own = read(prim, KEYPOINTS + ":points", self.when)
            own = [] if own is None else own
            count = min(len(several), len(own))
            names += [str(text) for text in several[:count]]
            points += [[float(x) for x in point] for point in own[:count]]
        return names, points, None if radius is None else float(radius)

    def symmetries(self, name: str) -> tuple[Doubles, Doubles]:
        """Return authored symmetries of a labelled prim, in its own space.

        Transforms (N, 4, 4), for points as column vectors, after which it looks the same; and axes (M, 2, 3), about any turn of
        which it does: a point and a direction.
        """
        if not (route := self._route(name)):
            return np.zeros((0, 4, 4)), np.zeros((0, 2, 3))
        prim = self.stage.GetPrimAtPath(route[-1].prim)
        given = (read(prim, SYMMETRIES + tail, self.when) for tail in ("", ":axes", ":axes:points"))
        matrices, axes, points = (np.array([] if each is None else each, np.float64) for each in given)
        axes = axes.reshape(-1, 3)
        points = np.resize(points.reshape(-1, 3), axes.shape) if points.size else np.zeros(axes.shape)
        return matrices.reshape(-1, 4, 4).transpose(0, 2, 1), np.stack([points, axes], axis=1)

    def way(self, prim: str, instance: str) -> list[Step]:
        """Return the prims from the world's root down to what is seen: through the instance, if there is one, to the prim."""
        route = list(self._route(instance)) if instance else []
        if not (Sdf.Path.IsValidPathString(prim) and prim.startswith("/")):
            return route
        path = Sdf.Path(prim).GetPrimPath()
        if not route:
            return [Step(str(p), p) for p in path.GetPrefixes()]
        last = route[-1]
        inside = self._below(path, last.prim)
        if inside is None:
            return route
        name, before = last.name, last.prim
        for place in inside.GetPrefixes():
            if place != before and place.HasPrefix(before):
                name = f"{name}/{place.name}"
                route.append(Step(name, place))
        return route

    def _below(self, prim: Sdf.Path, place: Sdf.Path) -> Sdf.Path | None:
        """Return the path that a prim has below `place`, where it is named as in another native instance of the same."""
        if prim.HasPrefix(place):
            return prim
        for around in reversed(list(place.GetPrefixes())):
            at = self.stage.GetPrimAtPath(around)
            if not at or not at.IsInstance():
                continue
            for above in reversed(list(prim.GetPrefixes())[:-1]):
                shared = self.stage.GetPrimAtPath(above)
                if shared and shared.IsInstance() and shared.GetPrototype() == at.GetPrototype():
                    found = Sdf.Path(prim.ReplacePrefix(above, around))
                    if found.HasPrefix(place):
                        return found
        return None

    def _route(self, instance: str) -> tuple[Step, ...]:
        """Return the steps of an instance's name."""
        if instance not in self._routes:
            self._routes[instance] = tuple(self._steps(instance))
        return self._routes[instance]

    def _steps(self, instance: str) -> Iterator[Step]:
        name, place = "", Sdf.Path.absoluteRootPath
        for part, indices in _PARTS.findall(instance):
            name, place = f"{name}/{part}", place.AppendChild(part)
            for index in map(int, _INDEX.findall(indices)):
                prototype = self._prototype(place, index)
                if prototype is None:  # a point of Points
                    break
                yield Step(name, place, is_instancer=True)
                name, place = f"{name}[{index}]", prototype
            yield Step(name, place)

    def _prototype(self, instancer: Sdf.Path, index: int) -> Sdf.Path | None:
        """Return the path of the root that an instance of a point instancer shows; None for a prim of another type."""
        if instancer not in self._instancers:
            prim = self.stage.GetPrimAtPath(instancer)
            if not prim or not prim.IsA(UsdGeom.PointInstancer):
                self._instancers[instancer] = [], []
            else:
                indices = [int(i) for i in read(prim, "protoIndices", self.when) or ()]
                self._instancers[instancer] = indices, targets(prim, "prototypes")
        indices, prototypes = self._instancers[instancer]
        if index < len(indices) and 0 <= indices[index] < len(prototypes):
            return prototypes[indices[index]]
        return None

    def _labels(self, path: Sdf.Path, taxonomy: str) -> tuple[str, ...]:
        """Return the labels that a prim itself has."""
        if (path, taxonomy) not in self._own:
            prim = self.stage.GetPrimAtPath(path)
            self._own[path, taxonomy] = tuple(self._read_labels(prim, taxonomy)) if prim else ()
        return self._own[path, taxonomy]

    def _read_labels(self, prim: Usd.Prim, taxonomy: str) -> Iterator[str]:
        yield from (str(label) for label in read(prim, NAMESPACE + taxonomy, self.when) or ())
        for name in property_names(prim):
            if name.startswith(OLD) and name.endswith(TYPE) and str(read(prim, name, self.when)) == taxonomy:
                label = read(prim, name.removesuffix(TYPE) + DATA, self.when)
                if label:
                    yield str(label)


def _inverse(matrix: Doubles) -> Doubles:
    """Return the inverse of a matrix, or where it has none its pseudo-inverse."""
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrix))
