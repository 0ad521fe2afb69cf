"""The tree of an OpenVDB grid (openvdb/tree, the usual 5-4-3 configuration): its nodes, tiles and leaves.

A root's table has nodes of 4096^3 voxels, which have 32^3 of 128^3, which have 16^3 leaves of 8^3. A node holds a value for
each part of it that is not a child: a tile. The file has the structure first (masks, tiles), then the leaves' values, each with
its size in front of it: their positions are found in a loop, while all that follows is done for many leaves at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Ints
from .vdb_bytes import VdbBytes, VdbError
from .vdb_values import (
    ACTIVE_MASK,
    ALL_VALUES,
    BACKGROUND,
    ChunkReader,
    Inactive,
    NodeReader,
    ValueType,
    bits_of,
    chunk_reader,
    chunk_skipper,
    read_inactive,
    read_node_values,
    read_value,
    values_in,
)

LEAF, LOWER, UPPER = 8, 128, 4096  # voxels along the edges of nodes
VOXELS = LEAF**3
_MASK = VOXELS // 8  # bytes of a leaf's mask
_BATCH = 4096  # leaves that are put into place at a time

Array = npt.NDArray[Any]
Bits = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Tiles:
    """Cubes of one value: first voxels (n, 3), edges (n,) in voxels, values (n, width), and whether they are active (n,)."""

    origins: Ints
    sizes: Ints
    values: Array
    are_active: Bits


@dataclass(frozen=True)
class Topology:
    """The structure of a tree: all but the values of its leaves."""

    background: Array  # (width,)
    tiles: Tiles  # those that are active, or have another value than the background
    origins: Ints  # (n, 3): the first voxels of the leaves, in the file's order
    masks: npt.NDArray[np.uint8]  # (n, 64): which of their voxels are active

    @property
    def active_voxels(self) -> int:
        in_tiles = sum(int(size) ** 3 for size in self.tiles.sizes[self.tiles.are_active])
        return int(np.bitwise_count(self.masks).sum(dtype=np.int64)) + in_tiles

    @property
    def bounds(self) -> Ints | None:
        """The first and last active voxels along each axis (2, 3), None where there are none."""
        tiles = self.tiles
        firsts = [tiles.origins[tiles.are_active]]
        lasts = [firsts[0] + (tiles.sizes[tiles.are_active, None] - 1)]
        for k in range(0, len(self.masks), _BATCH):
            bits = bits_of(self.masks[k : k + _BATCH]).reshape(-1, LEAF, LEAF, LEAF)
            along = np.stack([bits.any((2, 3)), bits.any((1, 3)), bits.any((1, 2))], 1)  # (batch, 3, 8)
            there = along.any((1, 2))
            origins = self.origins[k : k + _BATCH][there]
            firsts.append(origins + along.argmax(2)[there].astype(np.int32))
            lasts.append(origins + (LEAF - 1 - along[:, :, ::-1].argmax(2))[there].astype(np.int32))
        first, last = np.concatenate(firsts), np.concatenate(lasts)
        return np.stack([first.min(0), last.max(0)]).astype(np.int32) if len(first) else None


class _Parts:
    """What the nodes of a tree add while they are read."""

    def __init__(self, kind: ValueType, node_values: NodeReader) -> None:
        self.kind = kind
        self.node_values = node_values
        self.origins: list[Array] = [np.empty((0, 3), np.int64)]
        self.masks: list[Array] = [np.empty((0, _MASK), np.uint8)]
        self.tiles: list[tuple[Array, int, Array, Bits]] = []

    def topology(self, background: Array) -> Topology:
        tiles = Tiles(
            np.concatenate([np.empty((0, 3), np.int64), *(part[0] for part in self.tiles)]).astype(np.int32),
            np.concatenate([np.full(len(part[0]), part[1], np.int32) for part in self.tiles] or [np.empty(0, np.int32)]),
            np.concatenate([np.empty((0, self.kind.width), self.kind.dtype), *(part[2] for part in self.tiles)]),
            np.concatenate([np.empty(0, np.bool_), *(part[3] for part in self.tiles)]),
        )
        return Topology(background, tiles, np.concatenate(self.origins).astype(np.int32), np.concatenate(self.masks))


def _counts(values: Array, are_active: Bits, background: Array) -> Bits:
    """Return which tiles (n,) are active or differ from the background; a value that is not a number equals another one."""
    same = values == background
    if values.dtype.kind == "f":
        same |= np.isnan(values) & np.isnan(background)
    found: Bits = are_active | ~same.all(1)
    return found


def read_topology(source: VdbBytes, kind: ValueType, compression: int, node_values: NodeReader = read_node_values) -> Topology:
    """Return the structure that begins at the source's position, and leave it at the values of the first leaf.

    With `skip_node_values` nothing is decompressed: tiles inside nodes have no values, and are only there if they are active.
    """
    buffers = source.i32("the number of buffers")
    if buffers != 1:
        raise source.error(f"its leaves have {buffers} buffers, not one")
    background = read_value(source, kind, "the background")
    tiles, children = source.u32("the number of the root's tiles"), source.u32("the number of the root's nodes")
    parts = _Parts(kind, node_values)
    tile = np.dtype([("origin", "<i4", (3,)), ("value", "u1", (kind.bytes_of_one,)), ("active", "u1")])
    found = source.array(tile, tiles, f"the root's {tiles} tiles")
    values = values_in(found["value"].tobytes(), kind.dtype).reshape(tiles, kind.width)
    _check_aligned(source, found["origin"])
    are_active = found["active"] != 0
    kept = _counts(values, are_active, background)
    parts.tiles.append((found["origin"][kept].astype(np.int64), UPPER, values[kept], are_active[kept]))
    places = {tuple(origin) for origin in found["origin"].tolist()}
    if len(places) < tiles:
        raise source.error("two of the root's tiles have the same place")
    place = source.place
    last: tuple[int, ...] = ()
    for k in range(children):
        source.place = f"{place}, upper node {k}"
        origin = source.array("<i4", 3, "its place")
        _check_aligned(source, origin[None])
        key = tuple(origin.tolist())
        if key in places or key <= last:
            raise source.error(f"its place {key} is out of order, or is there twice")
        last = key
        _read_upper(source, kind, compression, background, origin.astype(np.int64), parts)
    source.place = place
    return parts.topology(background)


def _check_aligned(source: VdbBytes, origins: Array) -> None:
    if (origins & (UPPER - 1)).any():
        raise source.error(f"a place in the root's table is not a multiple of {UPPER}")


def _read_upper(source: VdbBytes, kind: ValueType, compression: int, background: Array, origin: Array, parts: _Parts) -> None:
    place = source.place
    for k, child in enumerate(_read_node(source, kind, compression, background, origin, (UPPER, LOWER), parts)):
        source.place = f"{place}, lower node {k}"
        leaves = _read_node(source, kind, compression, background, child, (LOWER, LEAF), parts)
        masks = source.array("u1", len(leaves) * _MASK, f"the masks of {len(leaves)} leaves")
        parts.origins.append(leaves)
        parts.masks.append(masks.reshape(-1, _MASK))


def _read_node(
    source: VdbBytes,
    kind: ValueType,
    compression: int,
    background: Array,
    origin: Array,
    edges: tuple[int, int],  # of the node and of its children
    parts: _Parts,
) -> Array:
    """Add the tiles of an internal node, and return the places (n, 3) of its children."""
    along = edges[0] // edges[1]
    children = bits_of(source.take(along**3 // 8, "the mask of its children"))
    active = source.take(along**3 // 8, "the mask of its tiles")
    values = parts.node_values(source, active, kind, compression, background)
    are_active = bits_of(active)
    tiles = np.flatnonzero(~children & _counts(values, are_active, background))
    if len(tiles):
        parts.tiles.append((_places(tiles, along, edges[1], origin), edges[1], values[tiles], are_active[tiles]))
    return _places(np.flatnonzero(children), along, edges[1], origin)


def _places(offsets: Array, along: int, edge: int, origin: Array) -> Array:
    """Return the first voxels of the children at these offsets of a node: z is the fastest to change."""
    return np.stack([offsets // (along * along), offsets // along % along, offsets % along], 1) * edge + origin


def read_leaves(source: VdbBytes, tree: Topology, kind: ValueType, compression: int) -> Iterator[tuple[slice, Array]]:
    """Yield the values (n, 512, width) of the leaves in ranges of them, as `kind.stored` where that loses nothing."""
    reader = chunk_reader(kind, compression)
    for k in range(0, len(tree.masks), _BATCH):
        masks = tree.masks[k : k + _BATCH]
        if kind.is_bool:
            yield slice(k, k + len(masks)), _bool_leaves(source, k, masks)
            continue
        chunks, inactive = _chunks(source, k, masks, kind, compression, tree.background, reader)
        yield slice(k, k + len(masks)), _filled(masks, chunks, inactive, kind, tree.background)


def skip_leaves(source: VdbBytes, tree: Topology, kind: ValueType, compression: int) -> None:
    """Move the source behind the values of the leaves."""
    skipper = chunk_skipper(kind, compression)
    for k in range(0, len(tree.masks), _BATCH):
        masks = tree.masks[k : k + _BATCH]
        if kind.is_bool:
            _bool_leaves(source, k, masks)
        else:
            _chunks(source, k, masks, kind, compression, tree.background, skipper)


def _bool_leaves(source: VdbBytes, first: int, masks: Array) -> Array:
    """Return the values of leaves that hold bits: a mask of the active ones, the leaf's place, the values."""
    size = _MASK + 12 + _MASK
    rows = source.array("u1", len(masks) * size, f"the values of {len(masks)} leaves").reshape(-1, size)
    differing = np.flatnonzero((rows[:, :_MASK] != masks).any(1))
    if len(differing):
        raise VdbError(f"{source.place}, leaf {first + int(differing[0])}: {_OTHER_MASK}")
    return bits_of(rows[:, -_MASK:]).reshape(-1, VOXELS, 1)


_OTHER_MASK = "its mask is not the one that the tree's structure has"


def _chunks(
    source: VdbBytes, first: int, masks: Array, kind: ValueType, compression: int, background: Array, reader: ChunkReader
) -> tuple[list[bytes], dict[int, Inactive | None]]:
    """Return the chunks of leaves, and those whose inactive values are not the background, by their place in the batch.

    They have None where inactive values are stored like active ones.
    """
    data, at, end = source.data, source.at, source.end
    flat = masks.tobytes()
    counts = np.bitwise_count(masks).sum(1).tolist()
    has_mask = bool(compression & ACTIVE_MASK)
    one = kind.stored_bytes_of_one
    chunks: list[bytes] = []
    others: dict[int, Inactive | None] = {}
    k = 0
    try:
        for k, count in enumerate(counts):  # k is the place of an error
            if at + _MASK >= end:
                raise VdbError("the file ends before it")
            if data[at : at + _MASK] != flat[k * _MASK : (k + 1) * _MASK]:
                raise VdbError(_OTHER_MASK)
            code = data[at + _MASK]
            at += _MASK + 1
            if code != BACKGROUND:
                source.at = at
                inactive = read_inactive(source, code, kind, background, _MASK)
                at = source.at
                others[k] = None if code == ALL_VALUES else inactive
            if code == ALL_VALUES or not has_mask:
                others[k], count = None, VOXELS
            chunk, at = reader(data, at, end, count * one)
            chunks.append(chunk)
    except VdbError as error:
        message = str(error).removeprefix(f"{source.place}: ")
        raise type(error)(f"{source.place}, leaf {first + k}: {message}") from None
    source.at = at
    return chunks, others


def _filled(masks: Array, chunks: list[bytes], others: dict[int, Inactive | None], kind: ValueType, background: Array) -> Array:
    """Return the values (n, 512, width) of leaves: stored ones where they are active, others where they are not."""
    stored = values_in(b"".join(chunks), kind.stored).reshape(-1, kind.width)
    if len(stored) == len(masks) * VOXELS:
        return stored.reshape(-1, VOXELS, kind.width)
    bits = bits_of(masks)
    # Halves hold active values only: where an inactive one does not fit, it is rounded, as OpenVDB does when it writes.
    with np.errstate(over="ignore"):
        values = np.empty((len(masks), VOXELS, kind.width), kind.stored)
        values[:] = background
        for k, inactive in others.items():
            if inactive is None:
                bits[k] = True
                continue
            values[k] = inactive.first
            if inactive.chosen is not None:
                values[k, bits_of(inactive.chosen)] = inactive.second
    values[bits] = stored
    return values
