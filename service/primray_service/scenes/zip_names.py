"""Members of a package that are refused for their name or kind. Nothing is renamed, so that the sender learns of it."""

from __future__ import annotations

import re
import stat
import unicodedata
from collections.abc import Sequence

from ..limits import Limits
from .zip_directory import DEFLATED, Member, unsafe

# Bytes of a deflated folder, which holds nothing: the smallest stream of no bytes has two (RFC 1951, an empty block of fixed
# codes), as Java and Python write it; an empty stored block has five, and a flush before it as many again.
MOST_OF_NOTHING = 12
DOS_FOLDER = 0x10
# Reserved on Windows with any suffix; packages are shared between systems, and nobody needs these names.
DEVICE_NAMES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
MAX_DEPTH = 64
MAX_PART_BYTES = 255  # limit of file systems

# First bytes of archives, to refuse those in a package: their members would escape all checks.
ARCHIVES = {
    b"PK\x03\x04": "zip", b"PK\x05\x06": "zip", b"PK\x07\x08": "zip", b"Rar!\x1a\x07": "rar", b"7z\xbc\xaf\x27\x1c": "7-Zip",
    b"\x1f\x8b\x08": "gzip", b"BZh": "bzip2", b"\xfd7zXZ\x00": "xz", b"\x28\xb5\x2f\xfd": "zstd", b"MSCF": "cabinet",
}  # fmt: skip
TAR_AT, TAR = 257, b"ustar"
ARCHIVE_HEAD_BYTES = 264


def refuse_names(members: Sequence[Member], limits: Limits) -> None:
    """Raise Problem("package-unsafe") for the first member that is not a plain file or folder at a plain relative path."""
    for member in members:
        why = wrong_with_path(member.name, limits.path_bytes) or _wrong_with_kind(member)
        if why:
            raise unsafe(why, member.name)
    _refuse_clashes(members)


def wrong_with_path(name: str, most_bytes: int) -> str | None:
    """Return the objection to a path, or None if it is relative and means the same on every file system."""
    if len(name.encode()) > most_bytes:
        return f"The member's path has more than {most_bytes} bytes."
    parts = name.removesuffix("/").split("/")
    if len(parts) > MAX_DEPTH:
        return f"The member is more than {MAX_DEPTH} folders deep."
    if "\0" in name:
        return "The member's name contains NUL."
    if "\\" in name:
        return "The member's name contains a backslash."
    if name.startswith("/"):
        return "The member's path is absolute."
    if re.match(r"[A-Za-z]:", name):
        return "The member's path begins with a drive letter."
    for part in parts:
        if part in ("", ".", ".."):
            return f"The member's path has the part {part!r}."
        if any(unicodedata.category(char) in ("Cc", "Cf", "Cs") for char in part):
            return "The member's name contains invisible characters."
        if len(part.encode()) > MAX_PART_BYTES:
            return f"A part of the member's path has more than {MAX_PART_BYTES} bytes."
        if part.endswith((".", " ")) or ":" in part or DEVICE_NAMES.fullmatch(part):
            return f"The part {part!r} of the member's path has another meaning on other systems."
    return None


def _wrong_with_kind(member: Member) -> str | None:
    kind = stat.S_IFMT(member.unix_mode)
    if kind == stat.S_IFLNK:
        return "The member is a symbolic link."
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "The member is a device, a pipe or a socket."
    is_folder = kind == stat.S_IFDIR or (kind == 0 and bool(member.dos_attributes & DOS_FOLDER))
    if is_folder != member.is_folder and (kind or is_folder):
        return "The member's name and its attributes disagree on whether it is a folder."
    if member.is_folder and (member.bytes or member.packed_bytes > (MOST_OF_NOTHING if member.method == DEFLATED else 0)):
        return "The member is a folder, but has content."
    return None


def _refuse_clashes(members: Sequence[Member]) -> None:
    """Refuse paths that are one file on a system that ignores case or Unicode's forms, or a file where others need a folder."""
    seen: dict[str, tuple[str, bool]] = {}  # by folded path: path as written, whether a folder
    written: set[str] = set()
    for member in members:
        path = member.name.removesuffix("/")
        if path in written:
            raise unsafe("The package has two members with this name.", member.name)
        written.add(path)
        parts = path.split("/")
        for depth in range(1, len(parts) + 1):
            here = "/".join(parts[:depth])
            is_folder = depth < len(parts) or member.is_folder
            before, before_is_folder = seen.setdefault(folded(here), (here, is_folder))
            if before != here:
                raise unsafe(f"The names {before!r} and {here!r} differ only in case or in Unicode form.", member.name)
            if before_is_folder != is_folder:
                raise unsafe(f"The path {here!r} is both a file and a folder.", member.name)


def folded(path: str) -> str:
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", path).casefold())


def archive_kind(head: bytes) -> str | None:
    """Return the name of the archive format whose first bytes these are."""
    if head[TAR_AT : TAR_AT + len(TAR)] == TAR:
        return "tar"
    return next((kind for start, kind in ARCHIVES.items() if head.startswith(start)), None)
