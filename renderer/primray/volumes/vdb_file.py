"""OpenVDB files (formats 222 to 225; openvdb/io/Archive.cc): which grids they have, and the values of one of them.

`list_grids` reads names, metadata and transforms, and the structure of a tree only where metadata do not say how many voxels
are active or where they are. `read_grid` reads the values of one grid. What cannot be read is a VdbError that says where; a
grid whose type or transform is not supported is listed with the reason in `refusal`, and UnsupportedVdbError when it is read.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Ints
from ..errors import did_you_mean
from .vdb_bytes import UnsupportedVdbError, VdbBytes, VdbError
from .vdb_transform import FRUSTUM, read_transform
from .vdb_tree import VOXELS, Topology, read_leaves, read_topology, skip_leaves
from .vdb_values import FLAGS, ValueType, one_blosc_thread, skip_node_values, value_type
from .volume_grid import VolumeGrid

MAGIC = 0x56444220
FIRST_FORMAT, LAST_FORMAT = 222, 225
_UUID = 36
_HALF_SUFFIX, _HALF_FLAG = "_HalfFloat", "is_saved_as_half_float"
_NUMBERED = "\x1e"  # precedes the number of a grid whose name is not unique
_TREE, _CONFIGURATION = "Tree_", "_5_4_3"
_SINGULAR = 1e-12  # of a transform's determinant, where its axes have unit length

Metadata = Mapping[str, str | bool | int | float | tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class GridInfo:
    """What a file says of one of its grids."""

    name: str
    index: int  # among the grids of this name, in the file's order
    value_type: str  # "float", "vec3s", ...; of a tree that is not supported its whole type
    is_half: bool  # its values are stored in half precision
    grid_class: str  # "level set", "fog volume", "staggered" or "unknown"
    field_from_index: Doubles | None  # (4, 4) for column vectors; None where it is not linear
    bounds: Ints | None  # (2, 3): the first and last active voxels; None where there are none, or in a refused grid
    active_voxels: int | None  # None only in a refused grid
    metadata: Metadata  # those of types that Python has
    refusal: str  # why the grid cannot be read, "" if it can
    tree: _Tree


@dataclass(frozen=True)
class _Tree:
    """Where the tree of a grid is in the file, which several grids may share."""

    unique_name: str
    parent: str  # the unique name of the grid whose tree it is, "" if it has its own
    kind: ValueType | None
    compression: int
    at: int
    end: int


def list_grids(data: bytes) -> tuple[GridInfo, ...]:
    """Return all grids of a file in its order; VdbError if the file is broken."""
    source = VdbBytes(data, "the file")
    has_offsets = _read_header(source)
    _read_metadata(source)
    count = source.i32("the number of grids")
    if count < 0:
        raise source.error(f"it has {count} grids")
    found: list[GridInfo] = []
    names: Counter[str] = Counter()
    for k in range(count):
        source.place = f"grid {k}"
        info = _read_info(source, has_offsets, found)
        found.append(replace(info, index=names[info.name]))
        names[info.name] += 1
    return tuple(found)


def find_grid(grids: Sequence[GridInfo], name: str, index: int = 0) -> GridInfo:
    """Return the grid of this name, of several the one with this index; VdbError says which grids there are."""
    for grid in grids:
        if (grid.name, grid.index) == (name, index):
            return grid
    names = list(dict.fromkeys(grid.name for grid in grids))
    if name in names:
        raise VdbError(
            f"the file: it has no grid {name!r} with index {index}, but {sum(g.name == name for g in grids)} of that name"
        )
    listed = ", ".join(map(repr, names)) or "none"
    raise VdbError(f"the file: it has no grid {name!r}; {did_you_mean(name, names, f'its grids: {listed}')}")


def read_grid(data: bytes, grids: Sequence[GridInfo], info: GridInfo) -> VolumeGrid:
    """Return the values of one of the grids that `list_grids` found in these bytes."""
    if info.refusal or info.field_from_index is None:
        raise UnsupportedVdbError(f"grid {info.name!r}: {info.refusal}")
    tree = _own_tree(info, grids)
    kind = tree.kind
    assert kind is not None  # as there is no refusal
    source = VdbBytes(data, f"grid {info.name!r}", tree.at, tree.end)
    with one_blosc_thread(tree.compression):
        topology = read_topology(source, kind, tree.compression)
        values, nonfinite, negative = _leaf_values(source, topology, kind, tree.compression)
    with np.errstate(over="ignore"):  # what single precision cannot hold is infinite, and counted
        background, tile_values = topology.background.astype(np.float32), topology.tiles.values.astype(np.float32)
    for own in (background[None], tile_values):
        nonfinite += _count(~np.isfinite(own))
        negative += _count(own < 0)
    return VolumeGrid(
        name=info.name,
        grid_class=info.grid_class,
        field_from_index=info.field_from_index,
        background=background if kind.width > 1 else background[0],
        leaf_origins=topology.origins,
        leaf_values=values,
        tile_origins=topology.tiles.origins,
        tile_sizes=topology.tiles.sizes,
        tile_values=tile_values if kind.width > 1 else tile_values[:, 0],
        bounds=topology.bounds,
        active_voxels=topology.active_voxels,
        nonfinite=nonfinite,
        negative=negative,
    )


def _leaf_values(source: VdbBytes, topology: Topology, kind: ValueType, compression: int) -> tuple[npt.NDArray[Any], int, int]:
    """Return the values of all leaves, and how many are not finite or negative."""
    count = len(topology.masks)
    dtype = np.dtype(np.float16 if kind.stored.itemsize == 2 else np.float32)
    shape = (count, VOXELS) if kind.width == 1 else (count, VOXELS, kind.width)
    values = np.empty(shape, dtype)
    nonfinite = negative = 0
    for rows, found in read_leaves(source, topology, kind, compression):
        with np.errstate(over="ignore"):
            values[rows] = found.reshape(values[rows].shape)
        own = values[rows].reshape(-1, kind.width)
        if dtype == np.float16:  # by bits, since arithmetic of halves is slow
            bits = own.view(np.uint16)
            nonfinite += _count((bits & 0x7C00) == 0x7C00)
            negative += _count((bits > 0x8000) & (bits <= 0xFC00))
        else:
            nonfinite += _count(~np.isfinite(own))
            negative += _count(own < 0)
    return values, nonfinite, negative


def _count(flags: npt.NDArray[np.bool_]) -> int:
    """Return how many values (n, width) have a number with this flag."""
    return int(np.count_nonzero(flags if flags.shape[1] == 1 else flags.any(1)))


def _own_tree(info: GridInfo, grids: Sequence[GridInfo]) -> _Tree:
    if not info.tree.parent:
        return info.tree
    for grid in grids:
        if grid.tree.unique_name == info.tree.parent and not grid.tree.parent:
            return grid.tree
    raise VdbError(f"grid {info.name!r}: it shares the tree of {info.tree.parent!r}, which the file does not have")


def _read_header(source: VdbBytes) -> bool:
    """Return whether the file has the positions of its grids; a stream has not."""
    if source.end < 8 or source.i64("the first bytes") != MAGIC:
        raise source.error("it is not an OpenVDB file")
    version = source.u32("the format's version")
    if not FIRST_FORMAT <= version <= LAST_FORMAT:
        which = "older" if version < FIRST_FORMAT else "newer"
        raise UnsupportedVdbError(
            f"{source.place}: its format {version} is {which} than those that are read, {FIRST_FORMAT} to {LAST_FORMAT}"
        )
    source.skip(8, "the library's version")
    has_offsets = source.byte("the header") != 0
    source.skip(_UUID, "the header")
    return has_offsets


def _read_info(source: VdbBytes, has_offsets: bool, earlier: Sequence[GridInfo]) -> GridInfo:
    """Return what precedes a grid's tree, and leave the source behind the grid."""
    unique_name = source.text("its name")
    name = unique_name.partition(_NUMBERED)[0]
    source.place = f"grid {name!r}"
    tree_type = source.text("its type")
    parent = source.text("the grid whose tree it shares")
    start, _, end = (source.i64("its position") for _ in range(3))
    if not has_offsets:
        start, end = source.at, source.end
    elif not source.at <= start <= end <= source.end:
        raise source.error(f"it is said to be from byte {start} to {end}, of {source.end} bytes, and begins after {source.at}")
    own = VdbBytes(source.data, source.place, start, end)
    compression = own.u32("the flags of compression")
    metadata = _read_metadata(own)
    map_type, matrix = read_transform(own)
    is_half = bool(metadata.get(_HALF_FLAG))  # as in OpenVDB, for which the type's suffix does not count
    plain = tree_type.removesuffix(_HALF_SUFFIX)
    is_known = plain.startswith(_TREE) and plain.endswith(_CONFIGURATION)
    value = plain[len(_TREE) : -len(_CONFIGURATION)] if is_known else plain
    kind = value_type(value, is_half) if is_known else None
    tree = _Tree(unique_name, parent, kind, compression, own.at, end)
    refusal = _refusal(plain, kind, compression, map_type, matrix)
    bounds, active = (None, None) if kind is None or compression & ~FLAGS else _extent(metadata, tree, own, name, earlier)
    if has_offsets:
        source.at = end
    elif not parent:
        if kind is None or compression & ~FLAGS:
            raise UnsupportedVdbError(f"{source.place}: {refusal}; what follows it in a file without positions cannot be found")
        own.at = tree.at
        skip_leaves(own, read_topology(own, kind, compression, skip_node_values), kind, compression)
        source.at = own.at
    else:
        source.at = own.at
    return GridInfo(
        name=name,
        index=0,
        value_type=value,
        is_half=kind is not None and kind.stored != kind.dtype,
        grid_class=str(metadata.get("class", "unknown")),
        field_from_index=matrix,
        bounds=bounds,
        active_voxels=active,
        metadata=metadata,
        refusal=refusal,
        tree=tree,
    )


def _refusal(tree_type: str, kind: ValueType | None, compression: int, map_type: str, matrix: Doubles | None) -> str:
    if kind is None:
        what = (
            "it holds points, not voxels" if "ptdataidx" in tree_type or "ptidx" in tree_type else "its type is not supported"
        )
        return f"{what} ({tree_type[:80]})"
    if compression & ~FLAGS:
        return f"its values are compressed in an unknown way (flags {compression:#x})"
    if matrix is None:
        return f"its transform is a frustum ({map_type}), not linear" if map_type == FRUSTUM else "its transform is not linear"
    if not np.isfinite(matrix).all():
        return "its transform is not finite"
    if _is_singular(matrix):
        return "its transform is singular"
    return ""


def _is_singular(matrix: Doubles) -> bool:
    axes = matrix[:3, :3]
    largest = np.abs(axes).max(0)
    if not largest.all() or matrix[3].tolist() != [0, 0, 0, 1]:
        return True
    axes = axes / largest
    return bool(abs(np.linalg.det(axes / np.linalg.norm(axes, axis=0))) < _SINGULAR)


def _extent(
    metadata: Metadata, tree: _Tree, source: VdbBytes, name: str, earlier: Sequence[GridInfo]
) -> tuple[Ints | None, int | None]:
    """Return the bounds and number of active voxels: from metadata where those have both, else from the tree's structure."""
    count, first, last = (metadata.get(key) for key in ("file_voxel_count", "file_bbox_min", "file_bbox_max"))
    if isinstance(count, int) and count >= 0 and isinstance(first, tuple) and isinstance(last, tuple):
        bounds = np.array([first, last])
        fits = bounds.shape == (2, 3) and (np.abs(bounds) < 1 << 31).all()
        return (bounds.astype(np.int32) if fits and count else None), count
    if tree.parent:
        shared = [grid for grid in earlier if grid.tree.unique_name == tree.parent]
        return (shared[0].bounds, shared[0].active_voxels) if shared else (None, None)
    assert tree.kind is not None
    own = VdbBytes(source.data, f"grid {name!r}", tree.at, tree.end)
    topology = read_topology(own, tree.kind, tree.compression, skip_node_values)
    return topology.bounds, topology.active_voxels


def _read_metadata(source: VdbBytes) -> Metadata:
    """Return metadata by name; those of types that Python does not have are left out."""
    found: dict[str, Any] = {}
    place = source.place
    for k in range(source.u32("the number of its metadata")):
        source.place = f"{place}, metadata {k}"
        name, kind = source.text("its name"), source.text("its type")
        value = source.take(source.u32("its size"), "its value")
        if kind in _METADATA:
            try:
                found[name] = _METADATA[kind](value)
            except struct.error:
                raise source.error(f"{name[:60]!r} has {len(value)} bytes, which is no {kind}") from None
    source.place = place
    return found


def _numbers(code: str) -> Callable[[bytes], Any]:
    def decoded(value: bytes) -> Any:
        numbers = struct.unpack(f"<{code}", value)
        return numbers[0] if len(numbers) == 1 else numbers

    return decoded


_METADATA: dict[str, Callable[[bytes], Any]] = {
    "string": lambda value: value.decode(errors="replace"),
    "bool": lambda value: any(value),
    "int32": _numbers("i"),
    "int64": _numbers("q"),
    "float": _numbers("f"),
    "double": _numbers("d"),
    **{f"vec{n}{code}": _numbers(f"{n}{own}") for n in (2, 3, 4) for code, own in (("i", "i"), ("s", "f"), ("d", "d"))},
}
