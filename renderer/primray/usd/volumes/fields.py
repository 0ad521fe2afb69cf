"""Fields of a Volume: the prims that its relationships `field:NAME` name, each with a grid and a place of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pxr import Gf, Sdf, Usd

from ...arrays import Doubles
from ...volumes.volume_grid import LEVEL_SET, VolumeGrid
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim, local_matrix, transforms, world_matrix
from ..stage.reads import property_names, targets, type_name
from ..stage.values import read
from .files import UnreadableGridError, grid_of_file

_PREFIX = "field:"
# Types of values by fieldDataType, as OpenVDB calls them.
_TYPES = {
    "half": ("float",),
    "float": ("float",),
    "double": ("double",),
    "int": ("int32",),
    "int64": ("int64",),
    "bool": ("bool",),
    "float3": ("vec3s",),
    "half3": ("vec3s",),
    "double3": ("vec3d",),
    "int3": ("vec3i",),
}


@dataclass(frozen=True, eq=False)
class Field:
    """A field of a volume that could be read."""

    name: str  # of its relationship, without "field:"
    path: str
    grid_name: str  # in its file
    grid: VolumeGrid
    group_from_index: Doubles  # (4, 4), to the space of the group that the Volume is in

    @cached_property
    def largest(self) -> float:
        """The largest number in the grid, 0 where it has no values."""
        values = (self.grid.leaf_values, self.grid.tile_values)
        return max((float(one.max()) for one in values if one.size), default=0.0)


def field_named(fields: Mapping[str, Field], name: str) -> Field | None:
    """Return the field of this name or, where there is none, the first whose grid has it in its file."""
    found = fields.get(name)
    return found if found is not None else next((field for field in fields.values() if field.grid_name == name), None)


def fields_of(volume: ResolvedPrim, group_from_volume: Doubles, is_in_world: bool, ctx: Context) -> dict[str, Field]:
    """Return the fields of a Volume by name; those that cannot be read are reported.

    `is_in_world`: `group_from_volume` is its matrix in the world.
    """
    found: dict[str, Field] = {}
    for name, prim in _field_prims(volume, ctx):
        path = ctx.shown(str(prim.GetPath()))
        made = _field(name, prim, path, ctx)
        if made is None:
            continue
        grid_name, grid = made
        group_from_field = _group_from_field(volume, prim, group_from_volume, is_in_world, ctx)
        if group_from_field is None or not np.isfinite(group_from_field).all():
            ctx.warn("invalid-transform", path, "Its transform, or that of its Volume, is not usable: the field is ignored.")
            continue
        found[name] = Field(name, path, grid_name, grid, group_from_field @ grid.field_from_index)
    return found


def _field_prims(volume: ResolvedPrim, ctx: Context) -> Iterator[tuple[str, Usd.Prim]]:
    for name in sorted(name for name in volume.names if name.startswith(_PREFIX)):
        paths = targets(volume.prim, name)
        if len(paths) > 1:
            ctx.warn("volume-field", volume.path, f"{name} has {len(paths)} targets: only the first is used.", name)
        prim = ctx.stage.GetPrimAtPath(paths[0].GetPrimPath()) if paths else None
        if prim:
            yield name.removeprefix(_PREFIX), prim
        else:
            what = f"{ctx.shown(str(paths[0]))} does not exist" if paths else "It has no target"
            ctx.warn("volume-field", volume.path, f"{what}: the field is missing.", name)


def _field(name: str, prim: Usd.Prim, path: str, ctx: Context) -> tuple[str, VolumeGrid] | None:
    """Return the grid of a field prim with its name in the file; None, reported, where it cannot be read."""
    kind = type_name(prim)
    if kind != "OpenVDBAsset":
        what = f"a {kind}" if kind else "a prim without a type"
        ctx.warn("volume-field", path, f"It is {what}: only fields of the type OpenVDBAsset are read.")
        return None
    names = frozenset(property_names(prim))
    asset = read(prim, "filePath", ctx.when) if "filePath" in names else None
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        ctx.warn("volume-field", path, "No file is set: the field is missing.", "filePath")
        return None
    if not asset.resolvedPath:
        ctx.warn("asset-missing", path, f"{asset.path} cannot be found: the field is missing.", "filePath")
        return None
    ctx.caches.volume_files.add(str(asset.resolvedPath))
    grid_name, index = _grid_name(prim, names, name, ctx)
    try:
        grid, found = grid_of_file(str(asset.resolvedPath), grid_name, index, ctx.settings.max_memory_bytes)
    except UnreadableGridError as error:
        ctx.warn(error.code, path, f"{asset.path} cannot be read: {error.reason}. The field is missing.", "filePath")
        return None
    for sentence in found.changes:
        ctx.warn("volume-values", path, sentence)
    _check_type(prim, names, path, found.value_type, grid.grid_class != LEVEL_SET, ctx)
    return grid.name, grid


def _grid_name(prim: Usd.Prim, names: frozenset[str], name: str, ctx: Context) -> tuple[str | None, int]:
    """Return the name of the grid, None where none is authored, and its index among those of that name."""
    path = ctx.shown(str(prim.GetPath()))
    given = read(prim, "fieldName", ctx.when) if "fieldName" in names else None
    index = read(prim, "fieldIndex", ctx.when) if "fieldIndex" in names else 0
    if given is not None and not isinstance(given, str):
        ctx.warn("wrong-type", path, f"fieldName = {given!r} is not a token: it is ignored.", "fieldName")
        given = None
    if not isinstance(index, int) or isinstance(index, bool) or index < 0:
        if index is not None:
            ctx.warn("wrong-type", path, f"fieldIndex = {index!r} is not a number of a grid: 0 is used.", "fieldIndex")
        index = 0
    return given, index


def _check_type(prim: Usd.Prim, names: frozenset[str], path: str, has: str, is_fog: bool, ctx: Context) -> None:
    said = read(prim, "fieldDataType", ctx.when) if "fieldDataType" in names else None
    if isinstance(said, str) and said and has not in _TYPES.get(said, (has,)):
        message = f"fieldDataType is {said}, but the file's grid has values of the type {has}, which are read."
        ctx.warn("volume-values", path, message, "fieldDataType")
    said = read(prim, "fieldClass", ctx.when) if "fieldClass" in names else None
    if said == "levelSet" and is_fog:
        message = "fieldClass is levelSet, but the file's grid is none: its values are read as they are."
        ctx.warn("volume-values", path, message, "fieldClass")


def _group_from_field(
    volume: ResolvedPrim, prim: Usd.Prim, group_from_volume: Doubles, is_in_world: bool, ctx: Context
) -> Doubles | None:
    """Return the field's matrix; None where it has none.

    A field below its Volume has the Volume's transform and its own. A field elsewhere is where its own namespace says; in a
    prototype it keeps its place relative to the Volume.
    """
    cache = transforms(ctx.when)
    between = Gf.Matrix4d(1.0)
    above = prim
    while above and above != volume.prim and not above.IsPseudoRoot():
        local, resets = local_matrix(above, frozenset(property_names(above)), ctx.when, cache)
        between = between * local
        if resets:
            above = Usd.Prim()
            break
        above = above.GetParent()
    if above and above == volume.prim:
        return group_from_volume @ _columns(between)
    field = _columns(world_matrix(prim, ctx.when, cache))
    if is_in_world:
        return field
    try:
        volume_from_space = np.linalg.inv(_columns(world_matrix(volume.prim, ctx.when, cache)))
    except np.linalg.LinAlgError:
        return None
    return group_from_volume @ volume_from_space @ field


def _columns(matrix: Gf.Matrix4d) -> Doubles:
    return np.array(matrix, np.float64).T
