"""Files of a stage as inputs of a chunk: one file, or a folder with all that it refers to."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..cli.exits import SCENE_REJECTED, CommandError
from ..cli.scene_file import scene_file

LOG = logging.getLogger("primray")
PACKAGE = "package"


@dataclass(frozen=True)
class Packed:
    """A packed stage; `root` is its path in a chunk's job folder."""

    root: str
    inputs: Mapping[str, Path] = field(default_factory=dict)
    folders: Mapping[str, Path] = field(default_factory=dict)


def packed(stage: Path, scratch: Path) -> Packed:
    """Pack a stage; raises PrimrayError if a file cannot be read. Notes about files go to the log."""
    found = scene_file(stage, scratch)
    for note in found.notes:
        LOG.warning(note)
    if found.members is None or found.entry is None:
        # A copy: nodes must not get half of a file that is saved while the frame is rendered.
        copy = scratch / f"root{found.path.suffix.lower()}"
        shutil.copyfile(found.path, copy)
        return Packed(found.name, {found.name: copy})
    folder = scratch / PACKAGE
    for name, file in found.members.items():
        copy = folder / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(file, copy)
        except OSError as error:
            raise CommandError(
                "unreadable-file", f"it cannot be read: {error.strerror}", SCENE_REJECTED, where=str(file)
            ) from None
    return Packed(f"{PACKAGE}/{found.entry}", {}, {PACKAGE: folder})
