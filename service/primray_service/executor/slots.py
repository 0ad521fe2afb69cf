"""Private folders of workers, slots/<executor>-<n>/{job,out}, and their removal, including those of a dead server.

A server locks slots/<executor>.lock as long as it lives; whoever gets the lock may remove its folders.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..files import make_held

NO_LINKS = {errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP, errno.ENOSYS}


@dataclass(frozen=True)
class Slot:
    """Folders of one worker. `job`: its read-only inputs; `out`: its outputs; the log is outside of both."""

    root: Path

    @property
    def job(self) -> Path:
        return self.root / "job"

    @property
    def out(self) -> Path:
        return self.root / "out"

    @property
    def log(self) -> Path:
        return self.root / "log.txt"

    def remove(self) -> None:
        shutil.rmtree(self.root, ignore_errors=True)


class Slots:
    """The folders of one executor's workers."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder
        self._name = name
        self._made = 0
        self._lock: int | None = None

    def open(self) -> None:
        """Remove what dead servers left, and begin."""
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        for lock in self.folder.glob("*.lock"):
            _remove_if_dead(lock)
        for slot in self.folder.iterdir():
            if slot.is_dir() and not self.folder.joinpath(f"{slot.name.rsplit('-', 1)[0]}.lock").exists():
                shutil.rmtree(slot, ignore_errors=True)
        _, self._lock = make_held(self._make_lock)

    def _make_lock(self) -> tuple[Path, int]:
        path = self.folder / f"{self._name}.lock"
        return path, os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)

    def make(self) -> Slot:
        self._made += 1
        slot = Slot(self.folder / f"{self._name}-{self._made}")
        slot.root.mkdir(mode=0o700)
        slot.job.mkdir(mode=0o700)
        slot.out.mkdir(mode=0o700)
        return slot

    def close(self) -> None:
        """Remove all folders that are left."""
        for slot in self.folder.glob(f"{self._name}-*"):
            shutil.rmtree(slot, ignore_errors=True)
        if self._lock is not None:
            (self.folder / f"{self._name}.lock").unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = None


def _remove_if_dead(lock: Path) -> None:
    try:
        handle = os.open(lock, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return  # its server lives
    else:
        for slot in lock.parent.glob(f"{lock.stem}-*"):
            shutil.rmtree(slot, ignore_errors=True)
        lock.unlink(missing_ok=True)
    finally:
        os.close(handle)


def fill(job: Path, inputs: Mapping[str, Path], folders: Mapping[str, Path]) -> None:
    """Give the job folder its files: hard links, or copies where links are impossible."""
    for name, source in inputs.items():
        _put(source, _below(job, name))
    for name, folder in folders.items():
        begin = _below(job, name)
        begin.mkdir(parents=True, exist_ok=True)
        for inside, _, files in os.walk(folder):
            to = begin / Path(inside).relative_to(folder)
            to.mkdir(parents=True, exist_ok=True)
            for file in files:
                _put(Path(inside, file), to / file)


def take_out(job: Path, names: Iterable[str]) -> None:
    """Remove files that `fill` added."""
    for name in names:
        _below(job, name).unlink(missing_ok=True)


def _below(job: Path, name: str) -> Path:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or not path.parts:
        raise ValueError(f"{name!r} is not a path in a job's folder")
    return job / path


def _put(source: Path, target: Path) -> None:
    """Link or copy a plain file; a link in a package would lead out of the folder."""
    if not stat.S_ISREG(os.lstat(source).st_mode):
        raise ValueError(f"{source.name} is not a plain file")
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        shutil.copyfile(source, target, follow_symlinks=False)
