"""Files on their way to nodes: each content is put into Ray's object store once, under its hash, in blocks.

A folder is one content: its files as a tar archive whose members have only names and bytes, so that equal folders have equal
hashes. References are kept while the store's share for them lasts; evicted contents are put there again.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tarfile
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from ..node.transfer import PART_BYTES, Content

KEPT_BYTES = 8 * 2**30
Put = Callable[[bytes], Any]  # stores bytes in the object store and returns the ref
_Key = tuple[Any, ...]


class Contents:
    """Contents in the object store. Thread-safe; threads wait for one another."""

    def __init__(self, put: Put, kept_bytes: int = KEPT_BYTES) -> None:
        self._put = put
        self._kept_bytes = kept_bytes
        self._lock = threading.Lock()
        self._hashes: dict[_Key, str] = {}  # of files that were read before and have not changed
        self._kept: OrderedDict[str, Content] = OrderedDict()  # the last used one is last

    def of_file(self, path: Path, *, keep: bool) -> Content:
        """Return the file's content; `keep`: nodes and this process should cache it."""
        return self._content(_key_of([path]), lambda parts: _send_file(path, parts), is_folder=False, keep=keep)

    def of_folder(self, path: Path) -> Content:
        files = sorted(_files(path))
        return self._content(_key_of(files), lambda parts: _send_folder(path, files, parts), is_folder=True, keep=True)

    def _content(self, key: _Key, send: Callable[[_Parts], None], *, is_folder: bool, keep: bool) -> Content:
        with self._lock:
            known = self._kept.get(self._hashes.get(key, ""))
            if known is not None:
                self._kept.move_to_end(known.sha256)
                return known
            parts = _Parts(self._put)
            send(parts)
            parts.end()
            content = Content(parts.sha256.hexdigest(), parts.bytes, is_folder, keep, tuple(parts.refs))
            if keep:
                content = self._kept.setdefault(content.sha256, content)
                self._hashes[key] = content.sha256
                self._forget()
            return content

    def _forget(self) -> None:
        while len(self._kept) > 1 and sum(content.bytes for content in self._kept.values()) > self._kept_bytes:
            gone, _ = self._kept.popitem(last=False)
            self._hashes = {key: sha256 for key, sha256 in self._hashes.items() if sha256 != gone}


class _Parts:
    """A writable file whose bytes go into the object store."""

    def __init__(self, put: Put) -> None:
        self._put = put
        self._part = bytearray()
        self.sha256 = hashlib.sha256()
        self.bytes = 0
        self.refs: list[Any] = []

    def add(self, data: bytes) -> None:
        """Store one full block, or the last one; no writes may follow it."""
        self.sha256.update(data)
        self.bytes += len(data)
        self.refs.append(self._put(data))

    def write(self, data: bytes) -> int:
        self.sha256.update(data)
        self.bytes += len(data)
        self._part += data
        while len(self._part) >= PART_BYTES:
            self._send(PART_BYTES)
        return len(data)

    def end(self) -> None:
        if self._part:
            self._send(len(self._part))

    def _send(self, size: int) -> None:
        self.refs.append(self._put(bytes(self._part[:size])))
        del self._part[:size]


def _send_file(path: Path, parts: _Parts) -> None:
    with _opened(path) as file:
        while data := file.read(PART_BYTES):
            parts.add(data)


def _send_folder(folder: Path, files: list[Path], parts: _Parts) -> None:
    with tarfile.open(fileobj=parts, mode="w|", format=tarfile.PAX_FORMAT) as archive:  # type: ignore[call-overload]
        for path in files:
            with _opened(path) as file:
                member = tarfile.TarInfo(path.relative_to(folder).as_posix())
                member.size = os.fstat(file.fileno()).st_size
                archive.addfile(member, file)


def _opened(path: Path) -> BinaryIO:
    """Open a plain file; a link would lead out of the upload."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise ValueError(f"{path.name} is not a plain file")
    return os.fdopen(handle, "rb")


def _files(folder: Path) -> Iterator[Path]:
    for inside, _, names in os.walk(folder):
        yield from (Path(inside, name) for name in names)


def _key_of(files: list[Path]) -> _Key:
    """Return the key that detects a change."""
    found = ((path, os.lstat(path)) for path in files)
    return tuple((str(path), s.st_ino, s.st_size, s.st_mtime_ns) for path, s in found)
