"""A stage whose prims are edited from picture to picture, in its session layer: no file changes.

Values are written by Sdf in one block of changes, so that a scene that stays ready to render hears of them once. A prim that is
placed has an operation of its own for that, a matrix in place of its authored operations; the first time it is given one is a
change of its prim, later ones are changes of a value.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Gf, Sdf, Usd, UsdGeom

from ...arrays import Doubles
from ...errors import SettingsError, did_you_mean
from ..scene.inheritance import transforms, world_matrix
from ..stage.composition import choose_variants
from ..stage.metadata import meters_per_unit, up_axis
from ..stage.reads import computed, local_transform, property_names, type_name, value_at
from ..stage.traversal import find_below, world_children
from ..stage.values import When, array, read, value, when_of_few
from .values import CODE, file_beside, usd_value

OPERATION = "xformOp:transform:dataset"
_RESET = "!resetXformStack!"
_CUBE = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
_CUBE_FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
SURFACES = ("Mesh", "Cube", "Plane")
Triangles = Doubles  # (N, 3, 3): corners in the world


class VariedStage:
    """Edits of one stage, and what they lead to. Relative files of values are those in `folder`.

    SettingsError, with the code dataset-target and the prim or attribute, for what the stage does not have.
    """

    def __init__(self, stage: Usd.Stage, folder: Path, time_code: float | None) -> None:
        self._stage = stage
        self._layer = stage.GetSessionLayer()
        self._folder = folder
        self._when: When = when_of_few(time_code)
        self._types: dict[str, Sdf.ValueTypeName] = {}
        self._written: dict[str, Any] = {}
        self._own: dict[str, tuple[Gf.Matrix4d, bool]] = {}  # authored local transforms of the prims that are placed
        self.meters_per_unit = meters_per_unit(stage)
        self.up = np.array([0.0, 1.0, 0.0]) if up_axis(stage) == "Y" else np.array([0.0, 0.0, 1.0])

    def prims(self, pattern: str) -> list[str]:
        """Return the paths of the prims that a path with wildcards (`*`, `?`) leads to, in the order of the stage."""
        if not pattern.startswith("/"):
            raise SettingsError("a prim's path begins with a slash, as in /World/car", where=pattern, code=CODE)
        found = list(self._matching(self._stage.GetPseudoRoot(), pattern.strip("/").split("/")))
        if not found:
            raise self._missing_prim(pattern)
        for prim in found:
            if prim.IsInstanceProxy():
                raise SettingsError(
                    "it is inside a native instance, whose prims are shared; vary the instance, or make it not instanceable",
                    where=str(prim.GetPath()),
                    code=CODE,
                )
        return [str(prim.GetPath()) for prim in found]

    def _matching(self, prim: Usd.Prim, names: list[str]) -> Iterator[Usd.Prim]:
        if not names:
            yield prim
            return
        if names[0].isidentifier():
            child = prim.GetChild(names[0])
            below = [child] if child else []
        else:
            below = [each for each in world_children(prim) if fnmatch.fnmatchcase(each.GetName(), names[0])]
        for child in below:
            yield from self._matching(child, names[1:])

    def _missing_prim(self, pattern: str) -> SettingsError:
        prim, names = self._stage.GetPseudoRoot(), pattern.strip("/").split("/")
        while names and names[0].isidentifier() and prim.GetChild(names[0]):
            prim = prim.GetChild(names.pop(0))
        below = [each.GetName() for each in world_children(prim)]
        listed = ", ".join(below[:20]) or "none"
        hint = did_you_mean(names[0] if names else "", below, f"below {prim.GetPath()} there are: {listed}")
        return SettingsError(f"there is no such prim; {hint}", where=pattern, code=CODE)

    def attributes(self, pattern: str) -> list[str]:
        """Return the paths of the attributes of a pattern, as in /World/lamp*.inputs:intensity."""
        prims, dot, name = pattern.rpartition(".")
        if not dot or not name or "/" in name:
            raise SettingsError("an attribute is given as /World/lamp.inputs:intensity", where=pattern, code=CODE)
        found = []
        for path in self.prims(prims):
            prim = self._stage.GetPrimAtPath(path)
            attribute = prim.GetAttribute(name)
            if not attribute or not attribute.IsDefined():
                names = property_names(prim)
                hint = did_you_mean(name, names, f"it has {', '.join(names[:20]) or 'none'}")
                raise SettingsError(f"there is no such attribute; {hint}", where=f"{path}.{name}", code=CODE)
            self._types[f"{path}.{name}"] = attribute.GetTypeName()
            found.append(f"{path}.{name}")
        return found

    def file(self, name: str) -> str:
        """Return the path of a file beside the config."""
        return file_beside(name, self._folder)

    def check_value(self, attribute: str, given: Any) -> None:
        """Raise SettingsError unless the attribute's type has this value."""
        usd_value(given, self._types[attribute], self._folder, attribute)

    def set_values(self, values: Mapping[str, Any]) -> None:
        """Write values of attributes, as a config has them; those that are as before are not written."""
        self._write({path: usd_value(given, self._types[path], self._folder, path) for path, given in values.items()})

    def _write(self, values: Mapping[str, Any]) -> None:
        changed = {path: each for path, each in values.items() if path not in self._written or self._written[path] != each}
        with Sdf.ChangeBlock():
            for path, each in changed.items():
                self._spec(path).default = each
        self._written.update(changed)

    def _spec(self, path: str) -> Sdf.AttributeSpec:
        spec = self._layer.GetAttributeAtPath(path)
        if spec is None:
            owner, _, name = path.rpartition(".")
            prim = Sdf.CreatePrimInLayer(self._layer, owner)
            is_uniform = name == "xformOpOrder"
            variability = Sdf.VariabilityUniform if is_uniform else Sdf.VariabilityVarying
            spec = Sdf.AttributeSpec(prim, name, self._types[path], variability)
        return spec

    def choose(self, choices: Iterable[Any]) -> None:
        """Choose variants; `choices` are VariantChoices."""
        choose_variants(self._stage, choices)

    def variants(self, prim: str, variant_set: str) -> list[str]:
        """Return the names of a variant set; SettingsError where there is none."""
        sets = self._stage.GetPrimAtPath(prim).GetVariantSets()
        if variant_set not in sets.GetNames():
            hint = did_you_mean(variant_set, sets.GetNames(), f"its variant sets: {', '.join(sets.GetNames()) or 'none'}")
            raise SettingsError(f"there is no variant set {variant_set}; {hint}", where=prim, code=CODE)
        return list(sets.GetVariantSet(variant_set).GetVariantNames())

    def prepare_placing(self, paths: Iterable[str]) -> None:
        """Give prims the operation by which they are placed, with what they have as its first value."""
        cache = transforms(self._when)
        for path in paths:
            if path in self._own:
                continue
            prim = self._stage.GetPrimAtPath(path)
            if not UsdGeom.Xformable(prim):
                raise SettingsError(f"a {type_name(prim) or 'prim'} has no place", where=path, code=CODE)
            self._own[path] = local_transform(cache, prim)
        with Sdf.ChangeBlock():
            for path, (local, resets) in self._own.items():
                if f"{path}.{OPERATION}" in self._types:
                    continue
                self._types[f"{path}.{OPERATION}"] = Sdf.ValueTypeNames.Matrix4d
                self._types[f"{path}.xformOpOrder"] = Sdf.ValueTypeNames.TokenArray
                order = [_RESET, OPERATION] if resets else [OPERATION]
                self._spec(f"{path}.{OPERATION}").default = local
                self._spec(f"{path}.xformOpOrder").default = Sdf.ValueTypeNames.TokenArray.type.pythonClass(order)

    def own_local(self, path: str) -> Doubles:
        """Return the authored transform of a placed prim (4, 4), for points as column vectors."""
        return np.array(self._own[path][0]).T

    def own_world_linear(self, path: str) -> Doubles:
        """Return the linear part (3, 3) of world_from_prim of a placed prim as authored, under its parent as it is now."""
        own, resets = self._own[path]
        above = np.eye(4) if resets else self.world_from(str(self._stage.GetPrimAtPath(path).GetParent().GetPath()))
        linear: Doubles = (above @ np.array(own).T)[:3, :3]
        return linear

    def place_local(self, places: Mapping[str, Doubles]) -> None:
        """Place prims by parent_from_prim (4, 4), for points as column vectors."""
        self._write({f"{path}.{OPERATION}": _gf(place) for path, place in places.items()})

    def place_in_world(self, places: Mapping[str, Doubles]) -> None:
        """Place prims by world_from_prim (4, 4), for points as column vectors."""
        cache, local = transforms(self._when), {}
        for path, world in places.items():
            _, resets = self._own[path]
            parent = self._stage.GetPrimAtPath(path).GetParent()
            above = np.eye(4) if resets else np.array(world_matrix(parent, self._when, cache)).T
            local[path] = np.linalg.inv(above) @ world
        self.place_local(local)

    def world_from(self, path: str) -> Doubles:
        """Return world_from_prim (4, 4), for points as column vectors."""
        found = world_matrix(self._stage.GetPrimAtPath(path), self._when, transforms(self._when))
        return np.array(found).T

    def boxes(self, paths: Iterable[str]) -> dict[str, tuple[Doubles, Doubles]]:
        """Return the box of each prim in its own space: its low and high corner (3,)."""
        cache = UsdGeom.BBoxCache(self._when.time, ["default", "render", "proxy"], useExtentsHint=False)
        found = {}
        for path in paths:
            bound = computed(partial(cache.ComputeUntransformedBound, self._stage.GetPrimAtPath(path)), None)
            box = None if bound is None else bound.ComputeAlignedRange()
            if box is None or box.IsEmpty():
                raise SettingsError("it has no box: nothing below it has an extent", where=path, code=CODE)
            found[path] = np.array(box.GetMin()), np.array(box.GetMax())
        return found

    def triangles(self, path: str) -> Triangles:
        """Return the triangles (N, 3, 3) of the meshes, cubes and planes from a prim down, in the world."""
        cache, found = transforms(self._when), []
        for prim in find_below(self._stage.GetPrimAtPath(path)):
            kind = type_name(prim)
            if kind in SURFACES:
                points, corners = self._faces(prim, kind)
                world = np.array(world_matrix(prim, self._when, cache)).T
                found.append((points @ world[:3, :3].T + world[:3, 3])[corners])
        if not found or not sum(map(len, found)):
            raise SettingsError(f"there is no surface: none of {', '.join(SURFACES)}", where=path, code=CODE)
        return np.concatenate(found)

    def _faces(self, prim: Usd.Prim, kind: str) -> tuple[Doubles, npt.NDArray[np.int64]]:
        if kind == "Mesh":
            points = array(read(prim, "points", self._when), 3, "f")
            counts, indices = (read(prim, name, self._when) for name in ("faceVertexCounts", "faceVertexIndices"))
            if points is None or counts is None or indices is None:
                return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
            ends = np.cumsum(np.asarray(counts)).tolist()
            corners = [np.asarray(indices)[start:end] for start, end in pairwise([0, *ends])]
            points = np.asarray(points, np.float64)
        else:
            corners, points = self._of_shape(prim, kind)
        fans = [(face[0], face[k], face[k + 1]) for face in corners for k in range(1, len(face) - 1)]
        return points, np.array(fans, np.int64).reshape(-1, 3)

    def _of_shape(self, prim: Usd.Prim, kind: str) -> tuple[list[Any], Doubles]:
        if kind == "Cube":
            return _CUBE_FACES, np.array(_CUBE, np.float64) * (value(UsdGeom.Cube(prim).GetSizeAttr(), self._when) / 2)
        plane = UsdGeom.Plane(prim)
        x, y = (value(attribute, self._when) / 2 for attribute in (plane.GetWidthAttr(), plane.GetLengthAttr()))
        axis = value_at(plane.GetAxisAttr(), self._when.time)
        flat = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], np.float64)
        order = {"Z": [0, 1, 2], "X": [2, 1, 0], "Y": [0, 2, 1]}[axis]
        return [(0, 1, 2, 3) if axis == "Z" else (3, 2, 1, 0)], flat[:, order]


def _gf(matrix: Doubles) -> Gf.Matrix4d:
    return Gf.Matrix4d(np.ascontiguousarray(np.asarray(matrix, np.float64).T))
