"""File format of a checkpoint: a JSON header and plain arrays, written atomically and verified when read.

    "primray checkpoint 1\\n", the header's length (8 bytes), the header (UTF-8 JSON), SHA-256 of all this;
    the arrays that the header's "arrays" lists, little-endian and C-contiguous; SHA-256 of them.

Sizes in the header are compared with the file's size before anything is allocated: no file costs more memory than its size.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import math
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..errors import CheckpointError, PrimrayError
from ..images.output_path import name_beside, through_links

FORMAT = 3
_NAME = b"primray checkpoint "
_MAGIC = _NAME + b"%d\n" % FORMAT
_DIGEST_BYTES = 32
_KINDS = ("<i8", "|i1", "<u4", "<f4", "<f8")

Arrays = dict[str, npt.NDArray[Any]]


def write_checkpoint(path: Path, header: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write the file at `path` atomically: if anything goes wrong, the previous file is unchanged."""
    plain = {name: np.ascontiguousarray(array, array.dtype.newbyteorder("<")) for name, array in arrays.items()}
    table = [[name, array.dtype.str, list(array.shape)] for name, array in plain.items()]
    text = json.dumps({**header, "arrays": table}).encode()
    try:
        with _replacing(path) as file:
            head = _MAGIC + struct.pack("<Q", len(text)) + text
            file.write(head + hashlib.sha256(head).digest())
            digest = hashlib.sha256()
            for array in plain.values():
                view = array.reshape(-1).view(np.uint8).data
                digest.update(view)
                file.write(view)
            file.write(digest.digest())
    except OSError as error:
        raise PrimrayError(
            f"the checkpoint cannot be written: {error.strerror}", where=str(path), code="write-failed"
        ) from error


@contextmanager
def _replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file that replaces `path` when the block ends without an error and the data is on disk.

    The temporary file has a fixed name, so that killed processes leave at most one behind; a lock shows whether its writer is
    alive.
    """
    path = through_links(path)
    partial = path.with_name(f".{name_beside(path.name)}.partial")
    with _locked(path, partial) as file:
        file.truncate(0)
        try:
            yield file
            file.flush()
            os.fsync(file.fileno())
            os.replace(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _locked(path: Path, partial: Path) -> BinaryIO:
    while True:
        file = open(os.open(partial, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666), "wb")  # noqa: SIM115 - the caller closes it
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            raise PrimrayError("another process is writing this checkpoint", where=str(path), code="write-failed") from None
        except OSError:
            return file  # a file system without locks
        # The previous owner of the lock may have renamed this file to `path` since it was opened here.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), os.stat(partial)):
                return file
        file.close()


def read_header(path: Path) -> dict[str, Any]:
    """Return the header; CheckpointError unless the header is intact and the file has the size that it states."""
    with _opened(path) as file:
        return _header(path, file)


def read_checkpoint(path: Path) -> tuple[dict[str, Any], Arrays]:
    """Return header and arrays; CheckpointError unless all checksums match."""
    with _opened(path) as file:
        header = _header(path, file)
        digest = hashlib.sha256()
        arrays: Arrays = {}
        for name, kind, shape in header["arrays"]:
            array = np.empty(shape, kind)
            view = array.reshape(-1).view(np.uint8).data
            if file.readinto(view) != len(view):
                raise _damaged(path, "it ends early")
            digest.update(view)
            arrays[name] = array
        if file.read(_DIGEST_BYTES) != digest.digest():
            raise _damaged(path, "its data does not match its checksum")
        return header, arrays


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        if not path.is_file():
            raise CheckpointError("there is no such checkpoint", where=str(path), code="checkpoint-missing")
        with open(path, "rb") as file:
            yield file
    except OSError as error:
        raise CheckpointError(
            f"the checkpoint cannot be read: {error.strerror}", where=str(path), code="checkpoint-missing"
        ) from error


def _header(path: Path, file: BinaryIO) -> dict[str, Any]:
    size = os.fstat(file.fileno()).st_size
    magic = file.readline(len(_MAGIC) + 10)
    if magic != _MAGIC:
        number = magic[len(_NAME) :].strip()
        if magic.startswith(_NAME) and magic.endswith(b"\n") and number.isdigit():
            raise CheckpointError(
                f"the checkpoint has format {int(number)}, and this version of primray reads {FORMAT}",
                where=str(path),
                code="checkpoint-format",
            )
        raise _damaged(path, "it does not start with a checkpoint's signature")
    length_bytes = file.read(8)
    length = struct.unpack("<Q", length_bytes)[0] if len(length_bytes) == 8 else size
    if length > size - len(_MAGIC) - 8 - 2 * _DIGEST_BYTES:
        raise _damaged(path, "it ends early")
    text = file.read(length)
    if file.read(_DIGEST_BYTES) != hashlib.sha256(magic + length_bytes + text).digest():
        raise _damaged(path, "its header does not match its checksum")
    try:
        header = json.loads(text)
        left = size - file.tell() - _DIGEST_BYTES
        if sum(_array_bytes(*row) for row in header["arrays"]) != left:
            raise _damaged(path, "its size differs from the one in its header")
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise _damaged(path, "its header is not valid") from error
    found: dict[str, Any] = header
    return found


def _array_bytes(name: str, kind: str, shape: list[int]) -> int:
    if not isinstance(name, str) or kind not in _KINDS:
        raise ValueError(kind)
    if len(shape) > 8 or not all(type(n) is int and 0 <= n < 2**40 for n in shape):
        raise ValueError(shape)
    return math.prod(shape) * np.dtype(kind).itemsize


def _damaged(path: Path, how: str) -> CheckpointError:
    return CheckpointError(f"the checkpoint is damaged: {how}", where=str(path), code="checkpoint-damaged")
