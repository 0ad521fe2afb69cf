"""A package as a list of its files: paths, digests and sizes. Pure.

The scene's id is the digest of the list in canonical form: equal files at equal paths are one scene, whoever sends them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..limits import Limits
from ..problems import Problem
from .entries import candidates
from .zip_directory import STORED, Member, shown
from .zip_names import refuse_names

EMPTY = hashlib.sha256(b"").hexdigest()
FORMAT = "primray-package-1"


@dataclass(frozen=True)
class Part:
    sha256: str
    bytes: int


@dataclass(frozen=True)
class FileOfPackage:
    """A file of a package. `parts`: byte ranges that are sent separately, in order, as a usdz is split at its members; none: it
    is sent whole."""

    path: str
    sha256: str
    bytes: int
    parts: Sequence[Part] = ()

    @property
    def sent(self) -> Sequence[Part]:
        """Return what is sent of the file: its parts, or itself; nothing for an empty file."""
        if self.parts:
            return self.parts
        return (Part(self.sha256, self.bytes),) if self.bytes else ()


@dataclass(frozen=True)
class Manifest:
    """A package's list; its files are in order of their paths."""

    files: Sequence[FileOfPackage]
    name: str = ""
    text: bytes = field(default=b"", repr=False)

    @property
    def scene_id(self) -> str:
        return f"sha256:{hashlib.sha256(self.text).hexdigest()}"

    @property
    def bytes(self) -> int:
        return sum(file.bytes for file in self.files)

    @property
    def sizes(self) -> Mapping[str, int]:
        """Return the sizes of everything that is sent, by digest."""
        return {part.sha256: part.bytes for file in self.files for part in file.sent}

    @property
    def joined_bytes(self) -> int:
        """Return the bytes of files that are joined from parts, and so stored in addition to them."""
        return sum(file.bytes for file in self.files if file.parts)


def manifest_of(files: Sequence[FileOfPackage], name: str, limits: Limits) -> Manifest:
    """Return the manifest; raises Problem for a list that no package could have, by the same rules as for a zip's directory."""
    count = sum(max(len(file.parts), 1) for file in files)
    if count > limits.package_entries:
        raise Problem(
            "package-unsafe", f"The package has {count} files or parts; at most {limits.package_entries} are allowed."
        )
    refuse_names([_member(file) for file in files], limits)
    sizes: dict[str, int] = {}
    for file in files:
        for part in (Part(file.sha256, file.bytes), *file.parts):
            if sizes.setdefault(part.sha256, part.bytes) != part.bytes or (part.sha256 == EMPTY) != (part.bytes == 0):
                raise Problem("invalid-request", f"The file {shown(file.path)!r} has a size that its digest cannot have.")
        if file.parts and sum(part.bytes for part in file.parts) != file.bytes:
            raise Problem("invalid-request", f"The parts of the file {shown(file.path)!r} do not add up to its size.")
        if file.bytes > limits.upload_bytes:
            raise Problem(
                "upload-too-large", f"A file may have at most {limits.upload_bytes} bytes.", limit=limits.upload_bytes
            )
    total = sum(file.bytes for file in files)
    if total > limits.unpacked_bytes:
        sentence = f"The package has {total} bytes; at most {limits.unpacked_bytes} are allowed."
        raise Problem("package-too-large", sentence, limit=limits.unpacked_bytes)
    if not candidates([file.path for file in files]):
        raise Problem("not-usd", f"None of the package's {len(files)} files is a usd, usda, usdc or usdz layer.")
    ordered = sorted(files, key=lambda file: file.path)
    return Manifest(ordered, name, _text(ordered))


def read_manifest(text: bytes, name: str = "") -> Manifest:
    """Return a manifest from the text that `manifest_of` wrote."""
    rows = json.loads(text)["files"]
    files = [FileOfPackage(path, sha256, size, [Part(*part) for part in parts]) for path, sha256, size, *parts in rows]
    return Manifest(files, name, text)


def _text(files: Sequence[FileOfPackage]) -> bytes:
    rows = [[file.path, file.sha256, file.bytes, *([part.sha256, part.bytes] for part in file.parts)] for file in files]
    return json.dumps({"format": FORMAT, "files": rows}, separators=(",", ":"), ensure_ascii=False).encode()


def _member(file: FileOfPackage) -> Member:
    raw = file.path.encode()
    return Member(
        raw_name=raw,
        name=file.path,
        flags=0,
        method=STORED,
        crc=0,
        packed_bytes=file.bytes,
        bytes=file.bytes,
        unix_mode=0,
        dos_attributes=0,
        header_at=0,
        data_at=0,
    )
