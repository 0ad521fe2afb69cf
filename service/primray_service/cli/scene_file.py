"""Packaging of a scene for upload: one file as it is, or packed with the files it refers to.

    files beside or below it, or reached by ../  -> a package of their common folder, every file unchanged
    files named by absolute or searched paths    -> a usdz, in which USD rewrites the paths

A package is uploaded by content, or as a zip if the server does not support that. Packages of equal files make equal zips, so
that one that the server has is not sent again.
"""

from __future__ import annotations

import os
import shutil
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from .exits import SCENE_REJECTED, USAGE, CommandError

PACKAGES = (".zip", ".usdz")
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that zip can store
_MOST_NAMED = 10


@dataclass(frozen=True)
class SceneFile:
    path: Path  # file to send
    name: str
    entry: str | None = None
    files: int = 1
    notes: list[str] = field(default_factory=list)  # notes for the user
    members: Mapping[str, Path] | None = None  # of a package that is not written to `path` yet

    def write(self) -> None:
        """Write the package of these members as a zip to `path`."""
        if self.members is not None:
            write_zip(self.path, self.members)


def scene_file(scene: Path, scratch: Path) -> SceneFile:
    """Return the file to send for a scene; packages are written into `scratch`."""
    if not scene.is_file():
        raise CommandError("no-scene", "there is no such file", SCENE_REJECTED, where=str(scene))
    if scene.suffix.lower() in PACKAGES:
        return SceneFile(scene, scene.name)
    from primray import usd

    found = usd.dependencies(str(scene))
    notes = _notes("not found; the render will report it as missing", list(found.missing))
    if found.fixed:
        target = scratch / f"{scene.stem}.usdz"
        usd.write_usdz(str(scene), str(target))
        forget_times(target)
        named = [f"{asset} (in {os.path.relpath(layer)})" for layer, asset in found.fixed]
        notes = _notes("is a path of this machine; the scene is sent as a usdz with rewritten paths", named) + notes
        return SceneFile(target, target.name, None, len(found.files), notes)
    if len(found.files) == 1:
        return SceneFile(scene, scene.name, None, 1, notes)
    root = Path(os.path.commonpath([os.path.dirname(file) for file in found.files]))
    folder = os.path.dirname(os.path.abspath(scene))
    outside = [os.path.relpath(file, folder) for file in found.files if not Path(file).is_relative_to(folder)]
    notes = _notes("is outside the scene's folder; it is sent as well", outside) + notes
    target = scratch / f"{scene.stem}.zip"
    members = {Path(file).relative_to(root).as_posix(): Path(file) for file in found.files}
    entry = Path(found.files[0]).relative_to(root).as_posix()
    return SceneFile(path=target, name=target.name, entry=entry, files=len(found.files), notes=notes, members=members)


def with_images(sent: SceneFile, scratch: Path, images: Mapping[str, Path]) -> tuple[SceneFile, dict[str, str]]:
    """Return the scene with these settings' images in its package, and each setting's path within the package.

    An image that the scene itself refers to keeps its path. Raises CommandError for a file that does not exist.
    """
    members = dict(sent.members or {sent.name: sent.path})
    own = {os.path.realpath(file): name for name, file in members.items()}
    names: dict[str, str] = {}
    for setting, image in images.items():
        if not image.is_file():
            raise CommandError("no-such-file", f"--{setting}: there is no such file", USAGE, where=str(image))
        names[setting] = own.get(os.path.realpath(image)) or _free(f"{setting}/{image.name}", members)
        members[names[setting]] = image
    if not set(names.values()) - set(own.values()):
        return sent, names
    path = scratch / f"{Path(sent.name).stem}.zip"
    return replace(sent, path=path, name=path.name, entry=sent.entry or sent.name, files=len(members), members=members), names


def _free(name: str, members: Mapping[str, Path]) -> str:
    folder, file = name.split("/", 1)
    while f"{folder}/{file}" in members:
        folder += "_"
    return f"{folder}/{file}"


def _notes(what: str, named: list[str]) -> list[str]:
    notes = [f"{name}: {what}" for name in named[:_MOST_NAMED]]
    return notes + ([f"... and {len(named) - _MOST_NAMED} more"] if len(named) > _MOST_NAMED else [])


def write_zip(target: Path, members: Mapping[str, Path]) -> None:
    """Write the members uncompressed, in order of their names and without their times."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED, allowZip64=True) as package:
        for name, file in sorted(members.items()):
            member = zipfile.ZipInfo(name, EPOCH)
            member.external_attr = 0o644 << 16
            try:
                with file.open("rb") as source, package.open(member, "w", force_zip64=file.stat().st_size >= 2**31) as place:
                    shutil.copyfileobj(source, place, 2**20)
            except OSError as error:
                raise CommandError(
                    "unreadable-file", f"it cannot be read: {error.strerror}", SCENE_REJECTED, where=str(file)
                ) from None


def forget_times(package: Path) -> None:
    """Set the same time for every member of a zip, in place, so that a usdz keeps its alignment.

    APPNOTE.TXT 4.3.7 and 4.3.12: time and date are 4 bytes, 10 into a local header and 12 into a central one.
    """
    time = struct.pack("<HH", 0, 1 << 5 | 1)
    with zipfile.ZipFile(package) as members:
        headers, directory = [member.header_offset for member in members.infolist()], members.start_dir
    with package.open("r+b") as file:
        for offset in headers:
            file.seek(offset + 10)
            file.write(time)
        for _ in headers:
            file.seek(directory)
            header = file.read(46)
            if header[:4] != b"PK\x01\x02":
                raise ValueError("not a central directory")
            file.seek(directory + 12)
            file.write(time)
            directory += 46 + sum(struct.unpack("<HHH", header[28:34]))
