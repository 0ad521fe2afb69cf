"""Writes small OpenVDB files of every kind, as openvdb/io and openvdb/tree do; shares nothing with the reader.

Where PRIMRAY_OPENVDB names an environment with OpenVDB, tests/unit/volumes check that it reads the same from these files.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4
UPPER, LOWER, LEAF = 4096, 128, 8
Place = tuple[int, int, int]

TYPES = {
    "half": ("<f2", 1),
    "float": ("<f4", 1),
    "double": ("<f8", 1),
    "int32": ("<i4", 1),
    "int64": ("<i8", 1),
    "bool": ("?", 1),
    "vec3s": ("<f4", 3),
    "vec3d": ("<f8", 3),
    "vec3i": ("<i4", 3),
}
IDENTITY = ("AffineMap", tuple(np.eye(4).ravel()))


@dataclass(frozen=True)
class Leaf:
    values: np.ndarray  # (512,) or (512, 3)
    active: np.ndarray  # (512,) bool


@dataclass(frozen=True)
class Tile:
    origin: Place
    size: int  # 8, 128 or 4096
    value: object
    is_active: bool = True


@dataclass(frozen=True)
class Grid:
    """A grid to be written; `transform` is a map's type and the doubles, or the bytes, that follow it."""

    name: str = "density"
    kind: str = "float"
    half: bool = False
    background: object = 0
    leaves: Mapping[Place, Leaf] = field(default_factory=dict)
    tiles: Sequence[Tile] = ()
    transform: tuple[str, Sequence[float] | np.ndarray | bytes] = IDENTITY
    compression: int = ACTIVE_MASK
    metadata: Mapping[str, tuple[str, bytes]] = field(default_factory=dict)
    parent: str = ""  # the unique name of the grid whose tree it shares
    tree_type: str = ""  # instead of the usual one
    buffers: int = 1


def text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def string(value: str) -> tuple[str, bytes]:
    return "string", value.encode()


def scale_map(x: float, y: float, z: float) -> tuple[float, ...]:
    """The doubles of a ScaleMap: the scale, the voxel's size and three kinds of inverses."""
    scale = np.array([x, y, z])
    return tuple(np.concatenate([scale, np.abs(scale), 1 / scale, 1 / scale**2, 0.5 / scale]))


def vdb_bytes(grids: Sequence[Grid], version: int = 224, has_offsets: bool = True) -> bytes:
    out = bytearray(struct.pack("<qIIIB", 0x56444220, version, 12, 0, has_offsets) + b"0" * 36)
    out += metadata_bytes({})
    out += struct.pack("<i", len(grids))
    names = [grid.name for grid in grids]
    seen: dict[str, int] = {}
    for grid in grids:
        number = seen.get(grid.name, 0)
        seen[grid.name] = number + 1
        unique = f"{grid.name}\x1e{number}" if names.count(grid.name) > 1 else grid.name
        out += text(unique) + text(grid.tree_type or f"Tree_{grid.kind}_5_4_3" + "_HalfFloat" * grid.half) + text(grid.parent)
        at = len(out)
        out += bytes(24)
        start = len(out)
        out += struct.pack("<I", grid.compression) + metadata_bytes({**_own_metadata(grid), **grid.metadata})
        map_type, rest = grid.transform
        out += text(map_type) + (rest if isinstance(rest, bytes) else np.array(rest, "<f8").tobytes())
        block = 0
        if not grid.parent:
            structure, values = _tree(grid)
            out += structure
            block = len(out)
            out += values
        if has_offsets:
            out[at : at + 24] = struct.pack("<qqq", start, block, len(out))
    return bytes(out)


def _own_metadata(grid: Grid) -> dict[str, tuple[str, bytes]]:
    return {"name": string(grid.name), **({"is_saved_as_half_float": ("bool", b"\1")} if grid.half else {})}


def metadata_bytes(metadata: Mapping[str, tuple[str, bytes]]) -> bytes:
    rows = b"".join(text(name) + text(kind) + text(value) for name, (kind, value) in metadata.items())
    return struct.pack("<I", len(metadata)) + rows


def _tree(grid: Grid) -> tuple[bytes, bytes]:
    """The structure of a tree, and its buffers."""
    code, width = TYPES[grid.kind]
    background = np.broadcast_to(np.asarray(grid.background, code), width)
    of_root = [tile for tile in grid.tiles if tile.size == UPPER]
    inner = [*grid.leaves, *(tile.origin for tile in grid.tiles if tile.size < UPPER)]
    roots = sorted({_parent(place, UPPER) for place in inner})
    out = bytearray(struct.pack("<i", grid.buffers) + background.tobytes() + struct.pack("<II", len(of_root), len(roots)))
    for tile in of_root:
        value = np.broadcast_to(np.asarray(tile.value, code), width)
        out += struct.pack("<3i", *tile.origin) + value.tobytes() + bytes([tile.is_active])
    leaves: list[Place] = []
    for root in roots:
        out += struct.pack("<3i", *root)
        lowers = {_parent(p, LOWER) for p in grid.leaves if _parent(p, UPPER) == root}
        lowers |= {_parent(t.origin, LOWER) for t in grid.tiles if t.size == LEAF and _parent(t.origin, UPPER) == root}
        tiles = [t for t in grid.tiles if t.size == LOWER and _parent(t.origin, UPPER) == root]
        out += _node(grid, background, root, UPPER, LOWER, lowers, tiles)
        for lower in sorted(lowers, key=lambda p: _offset(p, root, UPPER, LOWER)):
            own = [p for p in grid.leaves if _parent(p, LOWER) == lower]
            tiles = [t for t in grid.tiles if t.size == LEAF and _parent(t.origin, LOWER) == lower]
            out += _node(grid, background, lower, LOWER, LEAF, own, tiles)
            own.sort(key=lambda p: _offset(p, lower, LOWER, LEAF))
            out += b"".join(_bits(grid.leaves[p].active) for p in own)
            leaves += own
    return bytes(out), b"".join(_leaf(grid, place, background) for place in leaves)


def _parent(place: Place, size: int) -> Place:
    x, y, z = (c // size * size for c in place)
    return x, y, z


def _offset(place: Place, origin: Place, size: int, part: int) -> int:
    x, y, z = ((c - o) // part for c, o in zip(place, origin, strict=True))
    along = size // part
    return (x * along + y) * along + z


def _bits(mask: np.ndarray) -> bytes:
    return np.packbits(mask, bitorder="little").tobytes()


def _node(grid: Grid, background: np.ndarray, origin: Place, size: int, part: int, children, tiles: Sequence[Tile]) -> bytes:
    count = (size // part) ** 3
    has_child, active = np.zeros(count, bool), np.zeros(count, bool)
    values = np.empty((count, len(background)), background.dtype)
    values[:] = background
    for child in children:
        has_child[_offset(child, origin, size, part)] = True
    for tile in tiles:
        at = _offset(tile.origin, origin, size, part)
        values[at], active[at] = tile.value, tile.is_active
    return _bits(has_child) + _bits(active) + _values(grid, values, active, has_child, background)


def _leaf(grid: Grid, place: Place, background: np.ndarray) -> bytes:
    leaf = grid.leaves[place]
    mask = _bits(leaf.active)
    if grid.kind == "bool":
        return mask + struct.pack("<3i", *place) + _bits(np.asarray(leaf.values, bool))
    values = np.asarray(leaf.values, background.dtype).reshape(512, -1)
    return mask + _values(grid, values, leaf.active, np.zeros(512, bool), background)


def _values(grid: Grid, values: np.ndarray, active: np.ndarray, has_child: np.ndarray, background: np.ndarray) -> bytes:
    """The code of inactive values, what it needs, and the chunk."""
    if not grid.compression & ACTIVE_MASK:
        return b"\6" + _chunk(grid, values)
    code, first, second = _inactive(values[~active & ~has_child], background)
    head = bytes([code])
    if grid.half:
        first, second = (row.astype(np.float16).astype(row.dtype) for row in (first, second))
    if code in (2, 4, 5):
        head += first.tobytes()
    if code == 5:
        head += second.tobytes()
    if code in (3, 4, 5):
        chosen = ~active & (values.astype(np.float16 if grid.half else values.dtype) == second.astype(values.dtype)).all(1)
        head += _bits(chosen)
    return head + _chunk(grid, values if code == 6 else values[active])


def _inactive(values: np.ndarray, background: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
    """OpenVDB's MaskCompress: the code, and the values that a mask chooses between."""
    minus = ~background if background.dtype == bool else -background
    distinct: list[np.ndarray] = []
    while len(values):
        if len(distinct) == 2:
            return 6, background, background
        distinct.append(values[0])
        values = values[(values != values[0]).any(1)]

    def is_one(row: np.ndarray, value: np.ndarray) -> bool:
        return bool((row == value).all())

    if not distinct or (len(distinct) == 1 and is_one(distinct[0], background)):
        return 0, background, background
    if len(distinct) == 1:
        return (1 if is_one(distinct[0], minus) else 2), distinct[0], background
    if not any(is_one(row, background) for row in distinct):
        return 5, distinct[0], distinct[1]
    (other,) = (row for row in distinct if not is_one(row, background))
    return (3 if is_one(other, minus) else 4), other, background


def _chunk(grid: Grid, values: np.ndarray) -> bytes:
    is_real = grid.kind in ("float", "double", "vec3s", "vec3d")
    if grid.half and is_real:
        if not len(values):
            return b""
        values = values.astype("<f2")
    data = values.tobytes()
    if grid.compression & BLOSC:
        import blosc

        packed = blosc.compress(data, typesize=4, clevel=9, shuffle=blosc.SHUFFLE, cname="lz4") if data else b""
        return struct.pack("<q", len(packed)) + packed if packed else struct.pack("<q", 0)
    if grid.compression & ZIP:
        packed = zlib.compress(data)
        small = len(packed) < len(data)
        return struct.pack("<q", len(packed)) + packed if small else struct.pack("<q", -len(data)) + data
    return data


def sample_grid(kind: str = "float", half: bool = False, compression: int = ACTIVE_MASK, **other) -> Grid:
    """A grid with leaves of each kind of inactive values, tiles of each size, and places on both sides of the origin."""
    code, width = TYPES[kind]
    rng = np.random.default_rng(5)
    shape = (512,) if width == 1 else (512, width)

    def numbers(count: int) -> np.ndarray:
        drawn = rng.integers(1, 120, (count, width))
        own = drawn % 2 == 1 if kind == "bool" else drawn / 4 if code[1] == "f" else drawn - 60
        return own.astype(code)

    background = np.full(width, kind == "bool" or 3, code)
    minus = ~background if kind == "bool" else -background
    first, second = numbers(2) if kind != "bool" else (background, minus)
    some = rng.random(512) < 0.4
    choices = [[background], [minus], [first], [background, minus], [background, first], [first, second], None]
    leaves: dict[Place, Leaf] = {}
    for k, inactive in enumerate(choices):
        values = numbers(512)
        if inactive is not None:
            values[~some] = np.array(inactive)[rng.integers(0, len(inactive), int((~some).sum()))]
        leaves[(8 * k - 24, 16, -8)] = Leaf(values.reshape(shape), some)
    leaves[(4096 + 8, 0, -4096)] = Leaf(numbers(512).reshape(shape), np.ones(512, bool))
    leaves[(8, 0, 0)] = Leaf(np.broadcast_to(background, (512, width)).reshape(shape).copy(), np.zeros(512, bool))
    tiles = [
        Tile((0, 0, 0), LEAF, first),
        Tile((16, 0, 0), LEAF, minus, is_active=False),
        Tile((-128, 256, 0), LOWER, second),
        Tile((-4096, 8192, 0), UPPER, first),
        Tile((0, -8192, 4096), UPPER, minus, is_active=False),
    ]
    return replace(
        Grid(kind=kind, half=half, compression=compression, background=background, leaves=leaves, tiles=tiles), **other
    )


def values_of(grid: Grid, voxels: np.ndarray) -> np.ndarray:
    """The values (n, width) of voxels (n, 3), as written."""
    code, width = TYPES[grid.kind]
    found = np.empty((len(voxels), width), code)
    found[:] = grid.background
    for tile in grid.tiles:
        found[((voxels >= tile.origin) & (voxels < np.array(tile.origin) + tile.size)).all(1)] = tile.value
    for place, leaf in grid.leaves.items():
        own = ((voxels >= place) & (voxels < np.array(place) + LEAF)).all(1)
        x, y, z = (voxels[own] - place).T
        found[own] = leaf.values.reshape(512, width)[(x * LEAF + y) * LEAF + z]
    return found


def active_voxels(grid: Grid) -> int:
    return sum(int(leaf.active.sum()) for leaf in grid.leaves.values()) + sum(t.size**3 for t in grid.tiles if t.is_active)
