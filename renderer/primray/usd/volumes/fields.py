"""Fields of a Volume: the prims that its relationships `field:NAME` name, each with a grid and a place of its own."""

from __future__ import annotations

import re
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
from ..stage.values import matrix, read
from .files import UnreadableGridError, grid_of_file
from .motion import FieldMotion, TransformPath, namespace_path

_PREFIX = "field:"
# Names of fields of velocities, first those that are preferred: Houdini and Arnold write vel or v, Blender velocity.
VELOCITY_NAMES = ("velocity", "vel", "v")
# Names of their components, where each is a grid of its own: vel.x (Houdini, FumeFX), vel_x, velocityX.
_COMPONENT = re.compile(rf"({'|'.join(VELOCITY_NAMES)})[._:]?([xyz])", re.IGNORECASE)
# What other programs have in names of files for the number of a frame.
_FRAME_MARKS = ("#", "$F", "<F", "%0", "<frame")
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


FieldChange = tuple[str, str]  # a sentence, and the attribute that it concerns ("": none)


@dataclass(frozen=True, eq=False)
class Field:
    """A field of a volume that could be read."""

    name: str  # of its relationship, without "field:"
    path: str
    grid_name: str  # in its file
    grid: VolumeGrid
    group_from_index: Doubles  # (4, 4), to the space of the group that the Volume is in, at the frame
    motion: FieldMotion | None = None  # None: it moves only with its group
    instant: float = 0.0  # offset from the frame at which matrices hold
    changes: tuple[FieldChange, ...] = ()  # what is not rendered as the file has it, to be reported if the field is read

    def placed(self, instances: Doubles) -> Doubles:
        """Return world_from_index (N, 4, 4) at the frame for instances world_from_group (N, 4, 4) of the Volume."""
        if self.motion is not None and self.motion.in_world:
            return self.motion.at(self.instant)[None]
        return np.asarray(instances @ self.group_from_index)

    @property
    def is_velocity(self) -> bool:
        """Whether it is named as velocities or one of their components are, which may be negative, and has such values."""
        return self.grid.width == _signed_width(self.name, self.grid_name)

    @property
    def component(self) -> tuple[str, int] | None:
        """The velocities of which it is a component, and the axis; None where it is none."""
        return component_of(self.name) or component_of(self.grid_name) if self.grid.width == 1 else None

    @cached_property
    def largest(self) -> float:
        """The largest number in the grid, 0 where it has no values."""
        values = (self.grid.leaf_values, self.grid.tile_values)
        return max((float(one.max()) for one in values if one.size), default=0.0)


def field_named(fields: Mapping[str, Field], name: str) -> Field | None:
    """Return the field of this name or, where there is none, the first whose grid has it in its file."""
    found = fields.get(name)
    return found if found is not None else next((field for field in fields.values() if field.grid_name == name), None)


def component_of(name: str) -> tuple[str, int] | None:
    """Return the name of velocities and the axis of their component that `name` is; None where it is none."""
    found = _COMPONENT.fullmatch(name)
    return None if found is None else (found[1].lower(), "xyz".index(found[2].lower()))


def _signed_width(*names: str | None) -> int:
    """Return how many numbers the values of a field with these names have if they are velocities; 0: they are none."""
    if any(name in VELOCITY_NAMES for name in names):
        return 3
    return 1 if any(component_of(name) for name in names if name) else 0


def fields_of(
    volume: ResolvedPrim, group_from_volume: Doubles, instances: Doubles, is_in_world: bool, instant: float, ctx: Context
) -> tuple[dict[str, Field], frozenset[str]]:
    """Return the fields of a Volume by name, and the names of those that cannot be read, which are reported.

    `instances`: world_from_group (N, 4, 4). `is_in_world`: `group_from_volume` is its matrix in the world. `instant`: the
    offset from the frame, in time codes, at which matrices hold.
    """
    where = _VolumePlace(
        prim=volume.prim,
        group_from_volume=group_from_volume,
        instances=instances,
        is_in_world=is_in_world and volume.mover is None,
        moves=volume.mover is not None,
        instant=instant,
        ctx=ctx,
    )
    found: dict[str, Field] = {}
    missing: set[str] = set()
    for name, prim in _field_prims(volume, ctx):
        missing.add(name)
        if not prim:
            continue
        path = ctx.shown(str(prim.GetPath()))
        made = _field(name, prim, path, ctx)
        if made is None:
            missing.add(str(read(prim, "fieldName", ctx.when) or ""))
            continue
        grid_name, grid, changes = made
        placed = _field_place(where, prim)
        if placed is None or not np.isfinite(placed[0]).all():
            ctx.warn("invalid-transform", path, "Its transform, or that of its Volume, is not usable: the field is ignored.")
            continue
        group_from_field, motion = placed
        found[name] = Field(
            name=name,
            path=path,
            grid_name=grid_name,
            grid=grid,
            group_from_index=group_from_field @ grid.field_from_index,
            motion=None if motion is None else motion.within(grid.field_from_index),
            instant=instant,
            changes=changes,
        )
        missing.discard(name)
    return found, frozenset(missing)


def _field_prims(volume: ResolvedPrim, ctx: Context) -> Iterator[tuple[str, Usd.Prim | None]]:
    """Yield the names of fields with their prims; None, reported, where there is none."""
    for name in sorted(name for name in volume.names if name.startswith(_PREFIX)):
        paths = targets(volume.prim, name)
        if len(paths) > 1:
            ctx.warn("volume-field", volume.path, f"{name} has {len(paths)} targets: only the first is used.", name)
        prim = ctx.stage.GetPrimAtPath(paths[0].GetPrimPath()) if paths else None
        yield name.removeprefix(_PREFIX), prim
        if not prim:
            what = f"{ctx.shown(str(paths[0]))} does not exist" if paths else "It has no target"
            ctx.warn("volume-field", volume.path, f"{what}: the field is missing.", name)


def _field(name: str, prim: Usd.Prim, path: str, ctx: Context) -> tuple[str, VolumeGrid, tuple[FieldChange, ...]] | None:
    """Return the grid of a field prim with its name in the file, and what is not rendered as it is there; None, reported,
    where it cannot be read."""
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
        of_frames = any(mark in asset.path for mark in _FRAME_MARKS)
        hint = " A file for each frame is a time sample of filePath: USD knows no marks for numbers." if of_frames else ""
        ctx.warn("asset-missing", path, f"{asset.path} cannot be found: the field is missing.{hint}", "filePath")
        return None
    ctx.caches.volume_files.add(str(asset.resolvedPath))
    grid_name, index = _grid_name(prim, names, name, ctx)
    try:
        grid, found = grid_of_file(
            str(asset.resolvedPath),
            grid_name,
            index,
            ctx.settings.max_memory_bytes,
            signed_width=_signed_width(name, grid_name),
        )
    except UnreadableGridError as error:
        reason = error.reason.removeprefix("the file: ")
        end = "" if reason.endswith("?") else "."
        ctx.warn(error.code, path, f"{asset.path} cannot be read: {reason}{end} The field is missing.", "filePath")
        return None
    changes: list[FieldChange] = [(sentence, "") for sentence in found.changes]
    changes += _other_types(prim, names, found.value_type, grid.grid_class != LEVEL_SET, ctx)
    return grid.name, grid, tuple(changes)


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


def _other_types(prim: Usd.Prim, names: frozenset[str], has: str, is_fog: bool, ctx: Context) -> Iterator[FieldChange]:
    """Yield where the file's grid is not what the field prim says."""
    said = read(prim, "fieldDataType", ctx.when) if "fieldDataType" in names else None
    if isinstance(said, str) and said and has not in _TYPES.get(said, (has,)):
        message = f"fieldDataType is {said}, but the file's grid has values of the type {has}, which are read."
        yield message, "fieldDataType"
    said = read(prim, "fieldClass", ctx.when) if "fieldClass" in names else None
    if said == "levelSet" and is_fog:
        yield "fieldClass is levelSet, but the file's grid is none: its values are read as they are.", "fieldClass"


@dataclass(frozen=True, eq=False)
class _VolumePlace:
    """Where a Volume is, to place its fields."""

    prim: Usd.Prim
    group_from_volume: Doubles  # (4, 4); of a moving Volume the group's space is that of its mover
    instances: Doubles  # (N, 4, 4) world_from_group
    is_in_world: bool  # the group's space is the world
    moves: bool
    instant: float  # offset from the frame at which the matrices hold
    ctx: Context

    @cached_property
    def path(self) -> TransformPath:
        """The path of its own namespace."""
        return namespace_path(self.prim, self.ctx)

    @cached_property
    def moves_in_world(self) -> bool:
        """Whether it moves and is placed once, where its own namespace says."""
        if not self.moves or len(self.instances) != 1:
            return False
        own = self.path.at(self.instant)
        return bool(np.allclose(self.instances[0] @ self.group_from_volume, own, rtol=1e-9, atol=1e-9 * np.abs(own).max()))


def _field_place(volume: _VolumePlace, prim: Usd.Prim) -> tuple[Doubles, FieldMotion | None] | None:
    """Return group_from_field at the frame, and the motion that is not the group's; None where it has no place.

    A field below its Volume has the Volume's transform and its own. A field elsewhere is where its own namespace says; in a
    prototype it keeps its place relative to the Volume.
    """
    ctx = volume.ctx
    cache = transforms(ctx.when)
    between = Gf.Matrix4d(1.0)
    prims: list[Usd.Prim] = []
    above = prim
    while above and above != volume.prim and not above.IsPseudoRoot():
        local, resets = local_matrix(above, frozenset(property_names(above)), ctx.when, cache)
        between = between * local
        prims.append(above)
        if resets:
            above = Usd.Prim()
            break
        above = above.GetParent()
    if above and above == volume.prim:
        inner = TransformPath(prims, ctx)
        if not inner.moves:
            return volume.group_from_volume @ matrix(between), None
        below = FieldMotion(lambda offset: volume.group_from_volume @ inner.at(offset), inner.times, in_world=False)
        return below.at(volume.instant), below
    path = namespace_path(prim, ctx)
    if volume.is_in_world and not path.moves:
        return matrix(world_matrix(prim, ctx.when, cache)), None
    own = FieldMotion(path.at, path.times, in_world=True)
    if volume.is_in_world:
        return own.at(volume.instant), own

    def relative(offset: float) -> Doubles:
        return volume.group_from_volume @ np.linalg.inv(volume.path.at(offset)) @ path.at(offset)

    try:
        group_from_field = relative(volume.instant)
    except np.linalg.LinAlgError:
        return None
    if volume.moves_in_world:
        return group_from_field, own
    moves = path.moves or volume.path.moves
    times = tuple(sorted({*path.times, *volume.path.times}))
    return group_from_field, FieldMotion(relative, times, in_world=False) if moves else None
