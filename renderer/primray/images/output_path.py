"""Output paths: checks before rendering, folders, and symbolic links, which are kept while their target is replaced."""

from __future__ import annotations

import errno
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import PrimrayError, SettingsError
from ..read_files import note_output


def through_links(path: Path) -> Path:
    """Return the target of `path` if it is a symbolic link; it need not exist."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


LONGEST_BESIDE = 200  # bytes of a file's name used in the name of its temporary file; file systems allow 255 in all


def name_beside(name: str) -> str:
    """Return a file's name for use in the name of a temporary file beside it, truncated with a checksum if it is long."""
    text = os.fsencode(name)
    if len(text) <= LONGEST_BESIDE:
        return name
    return f"{text[: LONGEST_BESIDE - 9].decode('utf-8', 'ignore')}.{zlib.crc32(text):08x}"


def too_long(error: OSError, where: str) -> SettingsError | None:
    """Return a SettingsError if the system's error says that a file name is too long, else None."""
    if error.errno != errno.ENAMETOOLONG:
        return None
    return SettingsError("the file name is too long for the file system", where=where, code="name-too-long")


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


def not_written(error: OSError, where: str) -> PrimrayError | None:
    """Return the error of a file for which there is no room, or that is on a file system that is only read; else None."""
    if error.errno not in _FULL:
        return None
    return PrimrayError(f"the file cannot be written: {error.strerror}", where=where, code="write-failed")


@contextmanager
def refusing_long_names(path: Path) -> Iterator[None]:
    """Raise SettingsError if the system rejects a file name in the block as too long."""
    try:
        yield
    except OSError as error:
        raise too_long(error, str(path)) or error from None


def check_folder(path: Path) -> None:
    """Raise SettingsError unless a file can be written at `path`, or at the target of the link there.

    Anything else that exists there is not replaced, nor is a file that a command reads.
    """
    with refusing_long_names(path):
        _check_folder(path)
    note_output(path)


def _check_folder(path: Path) -> None:
    target = through_links(path)
    if not target.parent.is_dir():
        raise SettingsError(f"the folder {target.parent} does not exist", where=str(path), code="output-folder")
    replaceable = target.is_file() or not (target.exists() or target.is_symlink())  # not a folder, device or cyclic link
    if not replaceable or not os.access(target.parent, os.W_OK | os.X_OK):
        sentence = "the file cannot be written: it is not a file, or its folder is not writable"
        raise SettingsError(sentence, where=str(path), code="output-folder")


def make_folder(path: Path) -> None:
    """Create the folder of an output file, and those above it; SettingsError if that fails."""
    folder = path.parent
    try:
        folder = through_links(path).parent
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if (long := too_long(error, str(path))) is not None:
            raise long from None
        sentence = f"the folder {folder} cannot be made: {error.strerror}"
        raise SettingsError(sentence, where=str(path), code="output-folder") from None
