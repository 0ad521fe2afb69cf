"""Where an output is written: through symbolic links, so that a link stays one and its target gets the file."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import SettingsError


def through_links(path: Path) -> Path:
    """The path that `path` leads to; it need not exist."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def check_folder(path: Path) -> None:
    """SettingsError unless a file can be put at `path`, or where it leads as a link: nothing else is replaced by one."""
    target = through_links(path)
    if not target.parent.is_dir():
        raise SettingsError(f"the folder {target.parent} does not exist", where=str(path), code="output-folder")
    replaceable = target.is_file() or not (target.exists() or target.is_symlink())  # no folder, device, or link in a circle
    if not replaceable or not os.access(target.parent, os.W_OK | os.X_OK):
        raise SettingsError("a file cannot be written there", where=str(path), code="output-folder")


def make_folder(path: Path) -> None:
    """The folder of a file that is to be written, and those above it; SettingsError where that cannot be made."""
    folder = through_links(path).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sentence = f"the folder {folder} cannot be made: {error.strerror}"
        raise SettingsError(sentence, where=str(path), code="output-folder") from None
