"""Preparation of a staged upload for storage: it is recognised, unpacked, described and synced; and the lock of scenes/.

A folder in scenes/ appears complete, by one rename, after everything in it was synced; the row follows. So a crash leaves at
worst a folder without a row, which a sweep removes. The lock keeps an upload from relying on bytes about to be removed.
It is a lock of a file open for writing, since servers on several machines may share a data directory (staging.py). Zips are
extracted member by member, counting the output: sizes in headers are compared, never trusted.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..files import DataDirectory
from ..jobs import Json, Scene, SceneState
from ..limits import Limits, MiB
from ..problems import Problem, problem_of
from .receive import Received
from .recognize import HEAD_BYTES, called_usdz, candidates, recognize, without_layers, wrong_as_usdz
from .zip_directory import ARCHIVE_HEAD_BYTES, DEFLATED, Member, archive_kind, read_directory, refuse_names, shown, unsafe

ABOUT = "about.json"  # description from unpacking, for the next tenant who sends the same bytes
LIBC = ctypes.CDLL(None, use_errno=True)


def set_aside(scene_id: str, data: DataDirectory) -> Path | None:
    """Rename the scene's folder out of scenes/ at once, since its deletion may take long."""
    gone = Path(tempfile.mkdtemp(prefix="gone-", dir=data.incoming))
    try:
        os.rename(data.scene(scene_id), gone)
    except FileNotFoundError:
        shutil.rmtree(gone, ignore_errors=True)
        return None
    return gone


@contextmanager
def locked(data: DataDirectory) -> Iterator[None]:
    lock = os.open(data.root / "scenes.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def prepare(received: Received, data: DataDirectory, limits: Limits) -> Json:
    """Recognise, unpack and describe the upload, and sync all of it."""
    staged = received.path.parent
    with received.path.open("rb") as file:
        kind: str = recognize(file.read(HEAD_BYTES), received.name)
        about: Json = {"kind": kind, "files": 1, "unpacked_bytes": 0}
        if kind == "zip":
            members = read_directory(file, limits)
            refuse_names(members, limits)
            wrong = wrong_as_usdz(members)
            if wrong is None:
                about["kind"] = "usdz"
            else:
                about["no_usdz_because"] = wrong.as_json()
                refuse_as_usdz(received, about)
                paths = [member.name for member in members if not member.is_folder]
                if not candidates(paths):
                    raise without_layers(paths)
                unpacked = unpack(file, members, staged / "package", limits, data.free_bytes)
                about |= {"files": unpacked.files, "unpacked_bytes": unpacked.bytes}
    (staged / ABOUT).write_text(json.dumps(about))
    sync_all(staged)
    return about


def refuse_as_usdz(received: Received, about: Json) -> None:
    """Raise Problem for a zip that was sent as a usdz, but is not one."""
    if about["kind"] == "zip" and called_usdz(received.media_type, received.name):
        raise problem_of(about["no_usdz_because"])


def sync_all(folder: Path) -> None:
    """Sync all files of a folder by one call for the whole file system, since a package may have thousands."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        if LIBC.syncfs(handle):  # syncfs(2)
            raise OSError(ctypes.get_errno(), "syncfs failed")
    finally:
        os.close(handle)


def scene_row(received: Received, tenant: str, about: Json, now: float) -> Scene:
    return Scene(
        id=received.scene_id,
        tenant=tenant,
        state=SceneState.CHECKING,
        kind=about["kind"],
        name=received.name,
        bytes=received.bytes,
        stored_bytes=received.bytes + about["unpacked_bytes"],
        created_at=now,
        used_at=now,
    )


READ_BYTES = 256 * 1024
WRITE_BYTES = 1 * MiB
RATIO_FROM_BYTES = 1 * MiB  # smaller texts may well exceed the limit's ratio


@dataclass(frozen=True)
class Unpacked:
    files: int
    bytes: int


def unpack(file: BinaryIO, members: list[Member], folder: Path, limits: Limits, free_bytes: Callable[[], int]) -> Unpacked:
    """Unpack members whose names were checked. If refused, nothing is left behind."""
    folder.mkdir(mode=0o700)
    total = 0
    packed = sum(member.packed_bytes for member in members)
    files = [member for member in members if not member.is_folder]
    try:
        for member in members:
            if member.is_folder and any(_content(file, member)):
                raise unsafe("The member is a folder, but has content.", member.name)
        for member in files:
            target = folder / member.name
            target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            total += _unpack_member(file, member, target, limits, total, packed, free_bytes)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return Unpacked(len(files), total)


def _unpack_member(
    file: BinaryIO, member: Member, target: Path, limits: Limits, before: int, packed: int, free_bytes: Callable[[], int]
) -> int:
    written, checksum = 0, 0
    with target.open("xb", buffering=0) as output:
        for data in _content(file, member):
            if written == 0:
                _refuse_archive(data[:ARCHIVE_HEAD_BYTES], member)
            written += len(data)
            _refuse_too_large(member, written, before, packed, limits)
            if free_bytes() < limits.free_disk_bytes + len(data):
                raise Problem("storage-full", "The server's disk has no room for what the package unpacks to.")
            checksum = zlib.crc32(data, checksum)
            output.write(data)
    if written != member.bytes:
        raise unsafe(f"The member has {written} bytes; its header says {member.bytes}.", member.name)
    if checksum != member.crc:
        raise unsafe("The member is damaged: its checksum differs from its header's.", member.name)
    os.chmod(target, 0o600)
    return written


def _content(file: BinaryIO, member: Member) -> Iterator[bytes]:
    """Yield the member's inflated bytes, at most WRITE_BYTES at a time. A stream that ends early or late is refused."""
    file.seek(member.data_at)
    left = member.packed_bytes
    inflate = zlib.decompressobj(-zlib.MAX_WBITS) if member.method == DEFLATED else None
    while left:
        data = file.read(min(left, READ_BYTES))
        if not data:
            raise unsafe("The member is cut off.", member.name)
        left -= len(data)
        if inflate is None:
            yield data
            continue
        while data:
            try:
                out = inflate.decompress(data, WRITE_BYTES)
            except zlib.error:
                raise unsafe("The member is damaged: it cannot be inflated.", member.name) from None
            if out:
                yield out
            data = inflate.unconsumed_tail
            if inflate.eof and (inflate.unused_data or left):
                raise unsafe("The member's compressed data end too early.", member.name)
    if inflate is not None:
        # A limited inflate may hold back output without input left to give it.
        while out := inflate.decompress(b"", WRITE_BYTES):
            yield out
        if not inflate.eof:
            raise unsafe("The member's compressed data are cut off.", member.name)


def _refuse_archive(head: bytes, member: Member) -> None:
    kind = archive_kind(head)
    if kind is not None and not (kind == "zip" and member.name.lower().endswith(".usdz")):
        raise unsafe(f"The member is an archive ({kind}); only usdz archives are allowed in a package.", member.name)


def _refuse_too_large(member: Member, written: int, before: int, packed: int, limits: Limits) -> None:
    if before + written > limits.unpacked_bytes:
        raise _too_large(f"The package unpacks to more than {limits.unpacked_bytes} bytes.", member, limits.unpacked_bytes)
    for what, size, of in (("member", written, member.packed_bytes), ("package", before + written, packed)):
        if size > RATIO_FROM_BYTES and size > limits.unpack_ratio * max(of, 1):
            sentence = f"The {what} unpacks to more than {limits.unpack_ratio:g} times its {of} bytes."
            raise _too_large(sentence, member, limits.unpack_ratio)


def _too_large(detail: str, member: Member, limit: float) -> Problem:
    return Problem("package-too-large", detail, member=shown(member.name), limit=limit)
