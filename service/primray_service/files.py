"""The data directory: where bytes lie that are not rows. Files are written beside their place, synced, and renamed into it.

scenes/<hex>/upload         a scene as sent; scenes/<hex>/package/... a zip's members (nothing else is unpacked)
jobs/<id>/outputs/...       what a job made; jobs/<id>/frames/<n>/ checkpoint-<k>.prc, preview.raw, log.txt, and
                            part-<first>-<k>.prc of frames that are rendered in parts
contents/<tenant>/<sha256>  files of packages that were uploaded by content; those packages' members are links to them
slots/<id>/job, out         the two folders that a worker sees; removed when it is done
incoming/                   uploads under way

Where several servers share an object store (`objects`), the folder is each one's own: what is kept lies in the store under the
same names, but for outputs, whose names begin with their digests, and packages, which are unpacked where they are needed; here
is what is in use, and copies of what was.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from .objects import Objects, ObjectStoreFailed
from .problems import Problem
from .shared_roots import SharedRoots

COPY_BYTES = 2**20


@dataclass(frozen=True)
class DataDirectory:
    """`objects`: the store that servers share, where the folder is not what they share; `shared_roots`: of shared storage,
    which is only read."""

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
        """In a folder whose name begins with the tenant's digest: names of tenants may differ in case alone."""
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
        """In the store nothing is written over: who believes to dispatch still puts other bytes under another name."""
        return self.outputs(job_id) / (name if self.objects is None else f"{sha256}-{name}")

    def frame(self, job_id: str, number: int) -> Path:
        return self.job(job_id) / "frames" / str(number)

    def free_bytes(self) -> int:
        return shutil.disk_usage(self.root).free

    def name_of(self, path: Path) -> str:
        """In the object store."""
        return path.relative_to(self.root).as_posix()

    def share(self, path: Path) -> None:
        """A file that is here whole is kept from now on, whatever becomes of this server."""
        if self.objects is not None:
            self.objects.put(path, self.name_of(path))

    def bring(self, path: Path) -> bool:
        """Whether a file that never changes is here now."""
        if path.is_file() or self.objects is None:
            return path.is_file()
        try:
            self.objects.get(self.name_of(path), path)
        except FileNotFoundError:
            return False
        return True

    def bring_newest(self, path: Path) -> None:
        """A file that changes is here as it is now, if there is one."""
        if self.objects is not None:
            self.objects.get_newest(self.name_of(path), path)

    def has(self, path: Path) -> bool:
        """Or may have: where the store is away, whoever needs the file finds that out."""
        if path.is_file() or self.objects is None:
            return path.is_file()
        try:
            return self.objects.has(self.name_of(path))
        except ObjectStoreFailed:
            return True

    def remove(self, path: Path) -> None:
        """What stays in a store that is away goes with its job."""
        path.unlink(missing_ok=True)
        if self.objects is not None:
            with suppress(ObjectStoreFailed):
                self.objects.remove(self.name_of(path))

    def remove_below(self, folder: Path, keep: Collection[Path]) -> None:
        """Files right in it, and all below it in the store; as `remove`."""
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
        raise Problem("not-found", "A scene's id is sha256: and 64 hexadecimal digits.")
    return digest


def _plain(name: str) -> str:
    if not name or not name.replace("_", "").isalnum() or not name.isascii():
        raise ValueError(f"{name!r} is no name of a folder")
    return name


def adopt(source: Path, target: Path, most_bytes: int) -> int:
    """Take a file that a worker left, durably, and tell its size; ValueError unless it is a plain file of at most so many
    bytes.

    It is renamed, not copied: the two lie on one file system, and the worker must not go on writing to it.
    """
    found = os.lstat(source)
    _require_plain(source, found, most_bytes)
    target.parent.mkdir(parents=True, exist_ok=True)
    sync(source)
    os.replace(source, target)
    sync(target.parent)
    return found.st_size


def adopt_copy(source: Path, target: Path, most_bytes: int) -> int:
    """As `adopt`, of a worker that lives: it may have the file open still, and writes then to one that nobody reads."""
    _require_plain(source, os.lstat(source), most_bytes)  # before it is opened: a link cannot be, and would be no plain file
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f"{target.name}.new")
    handle = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file, open(beside, "wb") as copy:
        found = os.fstat(handle)
        _require_plain(source, found, most_bytes)
        left = found.st_size  # what is added meanwhile is not taken
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
    """What was written to a file, or renamed in a folder, is on the disk afterwards."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
