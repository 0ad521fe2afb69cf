"""The data directory: storage of all bytes outside the database. Files are written under a temporary name, synced, and renamed.

scenes/<hex>/upload         a scene as sent; scenes/<hex>/package/... a zip's members (nothing else is unpacked)
jobs/<id>/outputs/...       outputs of a job; jobs/<id>/frames/<n>/ checkpoint-<k>.prc, preview.raw, log.txt, and
                            part-<first>-<k>.prc of frames that are rendered as parts
contents/<tenant>/<sha256>  files of packages that were uploaded by content; those packages' members are links to them
slots/<id>/job, out         the two folders that a worker sees; removed when it is done
incoming/                   uploads in progress

If several servers share an object store (`objects`), each has its own folder: permanent files are in the store under the same
names, except for outputs, whose names begin with their digests, and packages, which are unpacked where they are needed; the
folder holds files in use, and a cache.

File locks are of folders and files that their owner holds; a sweep removes those that nobody holds.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import stat
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from .objects import Objects, ObjectStoreFailed
from .problems import Problem
from .shared_roots import SharedRoots


def make_held(make: Callable[[], tuple[Path, int]]) -> tuple[Path, int]:
    """Create a path by `make` (which returns the path and an open handle), and lock it. A sweep may remove it before it is
    locked: then another is made. `make` raises FileNotFoundError if it was removed before it was opened."""
    while True:
        try:
            path, handle = make()
        except FileNotFoundError as error:
            if error.filename is not None and not Path(error.filename).parent.is_dir():
                raise
            continue
        fcntl.flock(handle, fcntl.LOCK_EX)
        if _is_at(path, handle):
            return path, handle
        os.close(handle)


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(handle))
    except FileNotFoundError:
        return False


COPY_BYTES = 2**20


@dataclass(frozen=True)
class DataDirectory:
    """The data directory. `objects`: the store that servers share, if they do not share the folder; `shared_roots`: read-only
    shared storage."""

    root: Path
    objects: Objects | None = None
    shared_roots: SharedRoots = field(default_factory=SharedRoots)

    def create(self) -> None:
        for folder in (self.root, self.scenes, self.contents, self.jobs, self.slots, self.incoming):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)

    @property
    def scenes(self) -> Path:
        return self.root / "scenes"

    @property
    def contents(self) -> Path:
        return self.root / "contents"

    def content(self, tenant: str, sha256: str) -> Path:
        """Return a content's path in a folder whose name begins with the tenant's digest, since tenants' names may differ in
        case alone."""
        return self.contents / f"{hashlib.sha256(tenant.encode()).hexdigest()[:16]}-{tenant}" / _hex_of(sha256)

    @property
    def jobs(self) -> Path:
        return self.root / "jobs"

    @property
    def slots(self) -> Path:
        return self.root / "slots"

    @property
    def incoming(self) -> Path:
        return self.root / "incoming"

    def scene(self, scene_id: str) -> Path:
        return self.scenes / _hex_of(scene_id)

    def job(self, job_id: str) -> Path:
        return self.jobs / _plain(job_id)

    def outputs(self, job_id: str) -> Path:
        return self.job(job_id) / "outputs"

    def output(self, job_id: str, name: str, sha256: str) -> Path:
        """Return an output's path. Nothing in the store is overwritten: a server that wrongly believes it dispatches puts
        different bytes under another name."""
        return self.outputs(job_id) / (name if self.objects is None else f"{sha256}-{name}")

    def frame(self, job_id: str, number: int) -> Path:
        return self.job(job_id) / "frames" / str(number)

    def free_bytes(self) -> int:
        return shutil.disk_usage(self.root).free

    def name_of(self, path: Path) -> str:
        """Return the name in the object store."""
        return path.relative_to(self.root).as_posix()

    def share(self, path: Path) -> None:
        """Make a complete local file permanent, independent of this server."""
        if self.objects is not None:
            self.objects.put(path, self.name_of(path))

    def bring(self, path: Path) -> bool:
        """Fetch a file that never changes; return whether it is here now."""
        if path.is_file() or self.objects is None:
            return path.is_file()
        try:
            self.objects.get(self.name_of(path), path)
        except FileNotFoundError:
            return False
        return True

    def bring_newest(self, path: Path) -> None:
        """Fetch the current version of a file that changes, if there is one."""
        if self.objects is not None:
            self.objects.get_newest(self.name_of(path), path)

    def has(self, path: Path) -> bool:
        """Return whether the file exists, or may exist: if the store is away, that shows when the file is needed."""
        if path.is_file() or self.objects is None:
            return path.is_file()
        try:
            return self.objects.has(self.name_of(path))
        except ObjectStoreFailed:
            return True

    def remove(self, path: Path) -> None:
        """Remove a file. If the store is away, what stays there is removed with its job."""
        path.unlink(missing_ok=True)
        if self.objects is not None:
            with suppress(ObjectStoreFailed):
                self.objects.remove(self.name_of(path))

    def remove_below(self, folder: Path, keep: Collection[Path]) -> None:
        """Remove files directly in the folder, and all below it in the store, like `remove`."""
        for path in folder.iterdir() if folder.is_dir() else ():
            if path not in keep:
                path.unlink(missing_ok=True)
        if self.objects is not None:
            with suppress(ObjectStoreFailed):
                self.objects.remove_below(self.name_of(folder), [self.name_of(path) for path in keep])

    def remove_job(self, job_id: str) -> None:
        shutil.rmtree(self.job(job_id), ignore_errors=True)
        if self.objects is not None:
            self.objects.remove_below(self.name_of(self.job(job_id)))


def _hex_of(scene_id: str) -> str:
    digest = scene_id.removeprefix("sha256:")
    if len(digest) != 64 or set(digest) - set("0123456789abcdef"):
        raise Problem("not-found", "A scene's id must be sha256: and 64 hexadecimal digits.")
    return digest


def _plain(name: str) -> str:
    if not name or not name.replace("_", "").isalnum() or not name.isascii():
        raise ValueError(f"{name!r} is not a valid folder name")
    return name


def adopt(source: Path, target: Path, most_bytes: int) -> int:
    """Take over a file that a worker left, durably, and return its size; ValueError unless it is a plain file of at most
    `most_bytes`.

    It is renamed, not copied: both paths are on one file system, and the worker must not continue to write to it.
    """
    found = os.lstat(source)
    _require_plain(source, found, most_bytes)
    target.parent.mkdir(parents=True, exist_ok=True)
    sync(source)
    os.replace(source, target)
    sync(target.parent)
    return found.st_size


def adopt_copy(source: Path, target: Path, most_bytes: int) -> int:
    """Adopt a copy of a running worker's file, like `adopt`: if the worker still has it open, it writes to a file that nobody
    reads."""
    # checked before opening: a link fails to open, and would not be a plain file
    _require_plain(source, os.lstat(source), most_bytes)
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f"{target.name}.new")
    handle = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file, open(beside, "wb") as copy:
        found = os.fstat(handle)
        _require_plain(source, found, most_bytes)
        left = found.st_size  # bytes appended meanwhile are not taken
        while left > 0 and (part := file.read(min(left, COPY_BYTES))):
            left -= copy.write(part)
        copy.flush()
        os.fsync(copy.fileno())
    os.replace(beside, target)
    sync(target.parent)
    source.unlink(missing_ok=True)
    return found.st_size - left


def _require_plain(source: Path, found: os.stat_result, most_bytes: int) -> None:
    if not stat.S_ISREG(found.st_mode) or found.st_nlink != 1 or found.st_size > most_bytes:
        raise ValueError(f"{source.name} is not a plain file of at most {most_bytes} bytes")


def sync(path: Path) -> None:
    """Flush a file's content, or a folder's renames, to the disk."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
