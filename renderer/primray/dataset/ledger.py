"""The ledger of a data set: its folder `samples`, in which a sample is done when its own folder is there.

A sample is written to a folder beside, whose name begins with a dot; files and folder are flushed to the disk, and the folder
is renamed. Whoever renders a sample twice, as Ray may, finds the name taken: the same pixels are let go, others are an error.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import InternalError, PrimrayError, SettingsError

SAMPLES, RECORD, LOCK = "samples", "sample.json", ".lock"
_NAME = re.compile(r"\d{6,}")
_PARTIAL = re.compile(r"\.\d{6,}\..*")


def sample_name(index: int) -> str:
    return f"{index:06d}"


def sample_folder(folder: Path, index: int) -> Path:
    return folder / SAMPLES / sample_name(index)


def finished(folder: Path) -> list[int]:
    """Return the indices of the samples that are done, in order."""
    try:
        names = os.listdir(folder / SAMPLES)
    except FileNotFoundError:
        return []
    return sorted(int(name) for name in names if _NAME.fullmatch(name))


def record_of(folder: Path, index: int) -> dict[str, Any]:
    """Return the record of a sample that is done."""
    path = sample_folder(folder, index) / RECORD
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise PrimrayError(f"the sample's record cannot be read: {error}", where=str(path), code="dataset-damaged") from None
    return found


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a data set; SettingsError, dataset-busy, while another process makes it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SAMPLES).mkdir(exist_ok=True)
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SettingsError("another process is making this data set", where=str(folder), code="dataset-busy") from None
        yield
    finally:
        os.close(handle)


def remove_leftovers(folder: Path) -> None:
    """Remove what killed processes left of samples that they did not finish. The data set must be locked."""
    for name in os.listdir(folder / SAMPLES):
        if _PARTIAL.fullmatch(name):
            shutil.rmtree(folder / SAMPLES / name, ignore_errors=True)


@contextmanager
def new_sample(folder: Path, index: int) -> Iterator[Path]:
    """Yield an empty folder for a sample's files; put it into place, on the disk, when the block ends without an error."""
    target = sample_folder(folder, index)
    partial = target.with_name(f".{target.name}.{os.getpid()}.{os.urandom(4).hex()}")
    partial.mkdir(parents=True)
    try:
        yield partial
        for file in partial.iterdir():
            flush(file)
        flush(partial)
        _put_into_place(partial, target)
        flush(target.parent)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _put_into_place(partial: Path, target: Path) -> None:
    try:
        os.rename(partial, target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise PrimrayError(
                f"the sample cannot be written: {error.strerror}", where=str(target), code="write-failed"
            ) from error
        ours, theirs = (json.loads((each / RECORD).read_text(encoding="utf-8")) for each in (partial, target))
        if hashes_of(ours) != hashes_of(theirs):
            raise InternalError(
                "two renders of one sample have other pixels; please report it, with the config", where=str(target)
            ) from None


def hashes_of(record: Mapping[str, Any]) -> dict[str, str]:
    """Return the hashes of a sample's pixels by what they are of: the picture, if there is one, and each AOV."""
    picture = {} if record["pixels_sha256"] is None else {"picture": record["pixels_sha256"]}
    return {**picture, **record["aovs_sha256"]}


def flush(path: Path) -> None:
    """Have what a file or folder holds on the disk."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_durably(path: Path, text: str) -> None:
    """Write a text file whole or not at all, on the disk when this returns."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(text, encoding="utf-8")
    flush(partial)
    os.replace(partial, path)
    flush(path.parent)
