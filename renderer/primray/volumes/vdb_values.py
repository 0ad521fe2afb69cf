"""The values of one node of a tree (openvdb/io/Compression.h): types, codes of inactive values, and compressed chunks.

The only file that imports blosc, when it first comes to values that Blosc compressed. How many
bytes a chunk decompresses to is known from masks before it is read: memory is allocated for that number, and for no other.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .vdb_bytes import VdbBytes, VdbError

ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4  # flags of compression
FLAGS = ZIP | ACTIVE_MASK | BLOSC

# What precedes a node's values, where B is the background: the inactive values are all B, all -B, all one other value, ...
BACKGROUND, MINUS_BACKGROUND, ONE_VALUE = 0, 1, 2
# ... one of two, chosen by a mask: -B or B, a value or B, two values, ...
MINUS_OR_PLUS, VALUE_OR_BACKGROUND, TWO_VALUES = 3, 4, 5
ALL_VALUES = 6  # ... or stored like the active ones

Array = npt.NDArray[Any]
Bits = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ValueType:
    """A grid's type of values: `width` numbers of `dtype`, which chunks of values hold as `stored` (halves, or the same)."""

    name: str
    dtype: np.dtype[Any]
    width: int
    stored: np.dtype[Any]

    @property
    def bytes_of_one(self) -> int:
        return self.dtype.itemsize * self.width

    @property
    def stored_bytes_of_one(self) -> int:
        return self.stored.itemsize * self.width

    @property
    def is_bool(self) -> bool:
        return self.dtype == np.bool_

    @property
    def omits_empty_chunks(self) -> bool:
        """Whether nodes without stored values have no chunk at all: what OpenVDB writes as halves."""
        return self.stored != self.dtype

    def negated(self, values: Array) -> Array:
        return ~values if self.is_bool else -values


_HALF = np.dtype("<f2")
_TYPES = {
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


def value_type(name: str, is_half: bool) -> ValueType | None:
    """Return the type of the values of a "float", "vec3s", ... tree; None where it is not supported.

    The flag for halves has no effect on types other than single and double precision.
    """
    if name not in _TYPES:
        return None
    code, width = _TYPES[name]
    dtype = np.dtype(code)
    return ValueType(name, dtype, width, _HALF if is_half and code in ("<f4", "<f8") else dtype)


def bits_of(mask: bytes | Array) -> Bits:
    """Return a mask's bits in the order of a node's offsets: (8 n,) for n bytes, (m, 8 n) for (m, n)."""
    found = np.frombuffer(mask, np.uint8) if isinstance(mask, bytes) else mask
    return np.unpackbits(found, axis=-1, bitorder="little").view(np.bool_)


@dataclass(frozen=True)
class Inactive:
    """The two inactive values (width,) of a node, and the mask that chooses the second one, None where all are the first."""

    first: Array
    second: Array
    chosen: bytes | None = None


def read_inactive(source: VdbBytes, code: int, kind: ValueType, background: Array, mask_bytes: int) -> Inactive:
    """Return what a node's code says of its inactive values, reading the values and the mask that follow it."""
    if code > ALL_VALUES:
        raise source.error(f"the code of its inactive values is {code}, not one from 0 to {ALL_VALUES}")
    first = background if code in (BACKGROUND, ALL_VALUES) else kind.negated(background)
    second = background
    if code in (ONE_VALUE, VALUE_OR_BACKGROUND, TWO_VALUES):
        first = read_value(source, kind, "an inactive value")
    if code == TWO_VALUES:
        second = read_value(source, kind, "the second inactive value")
    chosen = source.take(mask_bytes, "the mask of inactive values") if MINUS_OR_PLUS <= code <= TWO_VALUES else None
    return Inactive(first, second, chosen)


def read_value(source: VdbBytes, kind: ValueType, what: str) -> Array:
    """Return one value (width,), which is never a half in the file unless the type is."""
    return values_in(source.take(kind.bytes_of_one, what), kind.dtype)


def values_in(data: bytes, dtype: np.dtype[Any]) -> Array:
    """Return bytes as numbers; any byte but 0 is a true bool, as memory must not hold others."""
    return np.frombuffer(data, np.uint8) != 0 if dtype == np.bool_ else np.frombuffer(data, dtype)


# (file, active mask of n / 8 bytes, type, flags of compression, background) -> values (n, width) of an internal node
NodeReader = Callable[[VdbBytes, bytes, ValueType, int, Array], Array]


def read_node_values(source: VdbBytes, active: bytes, kind: ValueType, compression: int, background: Array) -> Array:
    """Return the values of an internal node; those in the places of its children mean nothing."""
    data, inactive, bits = _node_chunk(source, active, kind, compression, background, chunk_reader(kind, compression))
    stored = values_in(data, kind.stored).reshape(-1, kind.width).astype(kind.dtype)
    if len(stored) == len(bits):
        return stored
    values = np.empty((len(bits), kind.width), kind.dtype)
    values[:] = inactive.first
    if inactive.chosen is not None:
        values[bits_of(inactive.chosen)] = inactive.second
    values[bits] = stored
    return values


def skip_node_values(source: VdbBytes, active: bytes, kind: ValueType, compression: int, background: Array) -> Array:
    """Step over the values of an internal node, and return the background in place of all of them."""
    _node_chunk(source, active, kind, compression, background, chunk_skipper(kind, compression))
    return np.broadcast_to(background, (8 * len(active), kind.width))


def _node_chunk(
    source: VdbBytes, active: bytes, kind: ValueType, compression: int, background: Array, reader: ChunkReader
) -> tuple[bytes, Inactive, Bits]:
    """Return a node's chunk, its inactive values and which of its values are active."""
    code = source.byte("the code of its inactive values")
    inactive = read_inactive(source, code, kind, background, len(active))
    bits = bits_of(active)
    is_partial = bool(compression & ACTIVE_MASK) and code != ALL_VALUES
    count = int(np.count_nonzero(bits)) if is_partial else len(bits)
    try:
        data, source.at = reader(source.data, source.at, source.end, count * kind.stored_bytes_of_one)
    except VdbError as error:
        raise type(error)(f"{source.place}: {error}") from None
    return data, inactive, bits


# (file, position, end, bytes that it decompresses to) -> (those bytes, position behind the chunk)
ChunkReader = Callable[[bytes, int, int, int], tuple[bytes, int]]
_SIZE = struct.Struct("<q")
_BLOSC_HEADER = struct.Struct("<BBBBIII")  # versions, flags, size of a number, bytes, bytes of a block, compressed bytes


def chunk_reader(kind: ValueType, compression: int) -> ChunkReader:
    """Return the function that reads a chunk of values in a grid with these flags; it raises VdbError without a place."""
    if not compression & (ZIP | BLOSC):
        return _raw
    reader = _sized(_blosc_decompress() if compression & BLOSC else _unzip)
    if not kind.omits_empty_chunks:
        return reader
    return lambda data, at, end, wanted: reader(data, at, end, wanted) if wanted else (b"", at)


def chunk_skipper(kind: ValueType, compression: int) -> ChunkReader:
    """Return a function like that of chunk_reader, which steps over a chunk and returns no bytes."""
    if not compression & (ZIP | BLOSC):
        return lambda data, at, end, wanted: (b"", _behind(at, wanted, end))
    reader = _sized(lambda data, wanted: b"")
    if not kind.omits_empty_chunks:
        return reader
    return lambda data, at, end, wanted: reader(data, at, end, wanted) if wanted else (b"", at)


def _raw(data: bytes, at: int, end: int, wanted: int) -> tuple[bytes, int]:
    behind = _behind(at, wanted, end)
    return data[at:behind], behind


def _behind(at: int, count: int, end: int) -> int:
    if count > end - at:
        raise VdbError(f"its values would have {count} bytes, but only {max(end - at, 0)} are left")
    return at + count


def _sized(decompress: Callable[[bytes, int], bytes]) -> ChunkReader:
    """Return a reader of chunks that begin with their size, which is zero or negative where they are not compressed."""
    unpack = _SIZE.unpack_from

    def read(data: bytes, at: int, end: int, wanted: int) -> tuple[bytes, int]:
        behind = _behind(at, 8, end)
        (size,) = unpack(data, at)
        if size <= 0:
            if size != -wanted:
                raise VdbError(f"its values have {-size} bytes, not the {wanted} that its masks give")
            return _raw(data, behind, end, wanted)
        at = behind
        behind = _behind(at, size, end)
        return decompress(data[at:behind], wanted), behind

    return read


def _unzip(chunk: bytes, wanted: int) -> bytes:
    stream = zlib.decompressobj()
    try:
        found = stream.decompress(chunk, wanted + 1)  # one more than wanted shows that there is more; 0 would be no limit
    except zlib.error as error:
        raise VdbError(f"its values cannot be decompressed ({error})") from None
    if len(found) != wanted or not stream.eof:
        raise VdbError(f"its values do not decompress to {wanted} bytes")
    return found


def _blosc_decompress() -> Callable[[bytes, int], bytes]:
    """Return a decompressor of Blosc chunks, which checks their header: the package trusts it."""
    import blosc

    unpack = _BLOSC_HEADER.unpack_from
    header = _BLOSC_HEADER.size

    def decompress(chunk: bytes, wanted: int) -> bytes:
        if len(chunk) < header:
            raise VdbError(f"its values are a Blosc chunk of {len(chunk)} bytes, which is too short for its header")
        _, _, _, number, size, block, compressed = unpack(chunk)
        if size != wanted or compressed != len(chunk):
            raise VdbError(f"its Blosc chunk of {len(chunk)} bytes for {wanted} is said to have {compressed} bytes for {size}")
        if not wanted:
            return b""
        if not number or not 0 < block <= size:
            raise VdbError(f"its Blosc chunk has numbers of {number} bytes in blocks of {block}")
        try:
            found: bytes = blosc.decompress(chunk)
        except Exception as error:  # blosc_extension.error, which has no public name
            raise VdbError(f"its values cannot be decompressed ({error})") from None
        return found

    return decompress


@contextmanager
def one_blosc_thread(compression: int) -> Iterator[None]:
    """Decompress on the calling thread for as long as this lasts: chunks are too small to divide them among Blosc's threads."""
    if not compression & BLOSC:
        yield
        return
    import blosc

    threads = blosc.set_nthreads(1)
    try:
        yield
    finally:
        blosc.set_nthreads(threads)
