"""Cache of contents on a node: each is transferred once, kept for the next chunk that needs it, and evicted when space is
needed.

cache/<hash>        a file, or a folder with files in it
cache/<hash>.lock   its size; locked exclusively while it is fetched, shared while it is used. Its mtime is the time of last use
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from .transfer import Content

KEPT_BYTES = 32 * 2**30
KEPT_PART = 0.25  # share of the disk
Read = Callable[[Any], bytes]  # reads a block by its ref


def node_folder() -> Path:
    """Return this node's folder: $PRIMRAY_NODE_DIR, or a folder of this user's in the temporary directory."""
    named = os.environ.get("PRIMRAY_NODE_DIR")
    folder = Path(named) if named else Path(tempfile.gettempdir(), f"primray-node-{os.getuid()}")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    if folder.is_symlink() or os.lstat(folder).st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to another user")
    return folder


class Held:
    """A content while it is in use."""

    def __init__(self, path: Path, lock: int, *, was_there: bool, keep: bool) -> None:
        self.path = path
        self.was_there = was_there
        self._lock = lock
        self._keep = keep

    def release(self) -> None:
        if not self._keep:
            _remove(self.path)
        os.close(self._lock)


class NodeCache:
    def __init__(self, folder: Path, kept_bytes: int | None = None) -> None:
        folder.mkdir(exist_ok=True, mode=0o700)
        self._folder = folder
        self._kept_bytes = kept_bytes or min(KEPT_BYTES, int(KEPT_PART * shutil.disk_usage(folder).total))

    def hold(self, content: Content, read: Read) -> Held:
        """Fetch the content unless it is cached; blocks. Raises ValueError if the bytes do not match its hash."""
        name = content.sha256 if content.keep else f"{content.sha256}-{os.getpid()}"
        path = self._folder / name
        was_there = True
        while True:
            lock = self._locked(path)
            try:
                if not path.exists():
                    was_there = False
                    self._fetch(content, path, read)
                    os.ftruncate(lock, 0)
                    os.pwrite(lock, str(content.bytes).encode(), 0)
                os.utime(lock)
                fcntl.flock(lock, fcntl.LOCK_SH)
            except BaseException:
                os.close(lock)
                raise
            if path.exists():
                break
            os.close(lock)  # it was removed between the two locks
        if not was_there:
            self._make_room(path)
        return Held(path, lock, was_there=was_there, keep=content.keep)

    def _locked(self, path: Path) -> int:
        """Return the exclusively locked lock file, at the path where other processes find it."""
        file = path.with_name(f"{path.name}.lock")
        while True:
            lock = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(lock, fcntl.LOCK_SH if path.exists() else fcntl.LOCK_EX)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(lock), os.stat(file)):
                    return lock
            os.close(lock)  # it was removed meanwhile

    def _fetch(self, content: Content, path: Path, read: Read) -> None:
        partial = Path(tempfile.mkdtemp(prefix=".partial-", dir=self._folder))
        try:
            stream = _Stream(content, read)
            if content.is_folder:
                _unpack(stream, partial / "it")
            else:
                with open(partial / "it", "xb") as file:
                    while data := stream.next_part():
                        file.write(data)
            stream.require_whole()
            os.rename(partial / "it", path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def _make_room(self, but: Path) -> None:
        """Evict contents that are not in use, least recently used first."""
        found = sorted(self._sizes(), key=lambda entry: entry[0])
        total = sum(size for _, size, _ in found)
        for _, size, lock_file in found:
            path = lock_file.with_suffix("")
            if total <= self._kept_bytes:
                return
            if path != but and _remove_if_unused(path, lock_file):
                total -= size

    def _sizes(self) -> Iterator[tuple[float, int, Path]]:
        for lock_file in self._folder.glob("*.lock"):
            with suppress(OSError, ValueError):
                yield lock_file.stat().st_mtime, int(lock_file.read_text("ascii")), lock_file


def _remove_if_unused(path: Path, lock_file: Path) -> bool:
    lock = os.open(lock_file, os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    else:
        _remove(path)
        return True
    finally:
        os.close(lock)


def _remove(path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)
    path.unlink(missing_ok=True)
    path.with_name(f"{path.name}.lock").unlink(missing_ok=True)


class _Stream:
    """The blocks of a content as one readable file."""

    def __init__(self, content: Content, read: Read) -> None:
        self._content = content
        self._read = read
        self._refs = iter(content.parts)
        self._part = memoryview(b"")
        self._sha256 = hashlib.sha256()

    def next_part(self) -> bytes:
        """Return the next block, or nothing at the end."""
        ref = next(self._refs, None)
        if ref is None:
            return b""
        data = self._read(ref)
        self._sha256.update(data)
        return data

    def read(self, size: int) -> bytes:
        if not self._part:
            self._part = memoryview(self.next_part())
        found, self._part = self._part[:size], self._part[size:]
        return bytes(found)

    def require_whole(self) -> None:
        while self.read(2**20):
            continue  # an archive's end may be padded
        if self._sha256.hexdigest() != self._content.sha256:
            raise ValueError("a content was changed in transit")


def _unpack(stream: _Stream, folder: Path) -> None:
    """Unpack plain files below the folder, nothing else."""
    folder.mkdir()
    with tarfile.open(fileobj=stream, mode="r|") as archive:  # type: ignore[call-overload]
        for member in archive:
            name = PurePosixPath(member.name)
            source = archive.extractfile(member) if member.isreg() else None
            if source is None or name.is_absolute() or ".." in name.parts or not name.parts:
                raise ValueError(f"{member.name!r} is not a plain file of a scene")
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(target, "xb") as file:
                shutil.copyfileobj(source, file, 2**20)
