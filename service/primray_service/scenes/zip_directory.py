"""Members of a zip: read from its directory, and refused for their names or kinds. Nothing is unpacked here.

The central directory and every local header must agree. The standard library's reader is not used: it trusts the central
directory, keeps all of it in memory whatever its size, and renames members. Layout: PKWARE APPNOTE 6.3.10, sections 4.3 to 4.5.
Nothing is renamed, so that the sender learns of a name that is refused.
"""

from __future__ import annotations

import os
import re
import stat
import struct
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO

from ..limits import Limits
from ..problems import Problem

LOCAL, CENTRAL, END = b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"
END64, END64_LOCATOR = b"PK\x06\x06", b"PK\x06\x07"
STORED, DEFLATED = 0, 8
ENCRYPTED, DESCRIPTOR, STRONG, UTF8, MASKED = 1 << 0, 1 << 3, 1 << 6, 1 << 11, 1 << 13
EXTRA_ZIP64, EXTRA_UNICODE_PATH = 0x0001, 0x7075
ALL16, ALL32 = 0xFFFF, 0xFFFFFFFF
MAX_EXTRA_BYTES = 1024  # average per member; usual ones take some 30


@dataclass(frozen=True)
class Member:
    raw_name: bytes
    name: str
    flags: int
    method: int
    crc: int
    packed_bytes: int
    bytes: int
    unix_mode: int  # 0 if it was not made on Unix
    dos_attributes: int
    header_at: int
    data_at: int

    @property
    def is_folder(self) -> bool:
        return self.name.endswith("/")


def unsafe(detail: str, member: str | bytes | None = None) -> Problem:
    name = shown(member) if member is not None else None
    return Problem("package-unsafe", detail, member=name)


def shown(name: str | bytes) -> str:
    """Return a member's name for a message, with unprintable characters escaped."""
    text = name.decode("utf-8", "backslashreplace") if isinstance(name, bytes) else name
    return "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)[:300]


def read_directory(file: BinaryIO, limits: Limits) -> list[Member]:
    """Return the members in the order of the directory. Problem for anything inconsistent, encrypted, or unsupported."""
    total = file.seek(0, os.SEEK_END)
    count, size, start = _end_record(file, total)
    if count > limits.package_entries:
        raise unsafe(f"The package has {count} members; at most {limits.package_entries} are allowed.")
    if size > count * (46 + limits.path_bytes + MAX_EXTRA_BYTES):
        raise unsafe(f"The package's directory of {size} bytes is too large for {count} members.")
    file.seek(start)
    members = list(_members(file, file.read(size), count, start))
    _refuse_overlaps(members, start)
    return members


def _end_record(file: BinaryIO, total: int) -> tuple[int, int, int]:
    """Return number of members, size and offset of the central directory."""
    tail_at = max(0, total - 22 - ALL16)
    file.seek(tail_at)
    tail = file.read(total - tail_at)
    at = len(tail) - 22
    # The record's comment must end where the file ends; search from the back, as all readers do.
    while at >= 0 and not (
        tail[at : at + 4] == END and at + 22 + int.from_bytes(tail[at + 20 : at + 22], "little") == len(tail)
    ):
        at = tail.rfind(END, 0, at + 3) if at else -1
    if at < 0:
        raise unsafe("The zip file has no directory at its end: it was cut off, or something was appended to it.")
    disk, first_disk, here, count, size, start = struct.unpack_from("<HHHHII", tail, at + 4)
    end_at = tail_at + at
    if ALL16 in (disk, first_disk, here, count) or ALL32 in (size, start):
        disk, first_disk, here, count, size, start, end_at = _end_record_64(file, end_at)
    if disk or first_disk or here != count:
        raise unsafe("The zip file is one part of several.")
    if start + size != end_at:
        raise unsafe("The zip file's directory is not where its end record says.")
    return count, size, start


def _end_record_64(file: BinaryIO, end_at: int) -> tuple[int, int, int, int, int, int, int]:
    broken = unsafe("The zip file's zip64 end record is damaged.")
    if end_at < 20 + 56:
        raise broken
    file.seek(end_at - 20)
    signature, _, record_at, disks = struct.unpack("<4sIQI", file.read(20))
    if signature != END64_LOCATOR or disks != 1 or record_at > end_at - 20 - 56:
        raise broken
    file.seek(record_at)
    record = file.read(56)
    signature, size, _, _, disk, first_disk, here, count, directory, start = struct.unpack("<4sQHHIIQQQQ", record)
    if signature != END64 or record_at + 12 + size != end_at - 20:
        raise broken
    return disk, first_disk, here, count, directory, start, record_at


def _members(file: BinaryIO, directory: bytes, count: int, directory_at: int) -> Iterator[Member]:
    at = 0
    for _ in range(count):
        if directory[at : at + 4] != CENTRAL or at + 46 > len(directory):
            raise unsafe("The zip file's directory is damaged.")
        fields = struct.unpack_from("<BBHHHHHIIIHHHHHII", directory, at + 4)
        made_by, flags, method, crc, packed, size = fields[1], fields[3], fields[4], fields[7], fields[8], fields[9]
        name_bytes, extra_bytes, comment_bytes, disk, attributes, header_at = *fields[10:14], fields[15], fields[16]
        end = at + 46 + name_bytes + extra_bytes + comment_bytes
        if end > len(directory):
            raise unsafe("The zip file's directory is damaged.")
        raw_name = directory[at + 46 : at + 46 + name_bytes]
        extra = directory[at + 46 + name_bytes : at + 46 + name_bytes + extra_bytes]
        size, packed, header_at, disk = _large(extra, size, packed, header_at, disk, raw_name)
        if disk:
            raise unsafe("The zip file is one part of several.", raw_name)
        name = _decode(raw_name, flags, extra)
        _refuse_unreadable(name, flags, method, size, packed)
        if header_at + 30 > directory_at:
            raise unsafe("The member's offset is outside the file.", name)
        mode = attributes >> 16 if made_by in (3, 19) or attributes >> 16 else 0  # Unix, macOS, or with a mode all the same
        member = Member(
            raw_name=raw_name,
            name=name,
            flags=flags,
            method=method,
            crc=crc,
            packed_bytes=packed,
            bytes=size,
            unix_mode=mode,
            dos_attributes=attributes & 0xFF,
            header_at=header_at,
            data_at=0,
        )
        yield _with_local_header(file, member, directory_at)
        at = end
    if at != len(directory):
        raise unsafe("The zip file's directory has more members than its end record says.")


def _large(extra: bytes, size: int, packed: int, header_at: int, disk: int, name: bytes) -> tuple[int, int, int, int]:
    """Return sizes and offset from the zip64 field, if the 32-bit fields refer to it (4.5.3)."""
    field = dict(_extra_fields(extra, name)).get(EXTRA_ZIP64, b"")
    values = []
    at = 0
    for value, all_ones, width in ((size, ALL32, 8), (packed, ALL32, 8), (header_at, ALL32, 8), (disk, ALL16, 4)):
        if value == all_ones:
            if at + width > len(field):
                raise unsafe("The member's zip64 field is damaged.", name)
            value = int.from_bytes(field[at : at + width], "little")
            at += width
        values.append(value)
    return values[0], values[1], values[2], values[3]


def _extra_fields(extra: bytes, name: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(extra):
        kind, size = struct.unpack_from("<HH", extra, at)
        if at + 4 + size > len(extra):
            raise unsafe("The member's extra fields are damaged.", name)
        yield kind, extra[at + 4 : at + 4 + size]
        at += 4 + size  # a remainder shorter than a field's head is padding by alignment tools


def _decode(raw_name: bytes, flags: int, extra: bytes) -> str:
    """Return a member's name. Flag 11 says UTF-8; some writers use UTF-8 without it. Old code pages cannot be distinguished:
    refused."""
    try:
        name = raw_name.decode("utf-8")
    except UnicodeDecodeError:
        said = "although it says so" if flags & UTF8 else "nor ASCII; make the zip with UTF-8 names"
        raise unsafe(f"The member's name is not UTF-8, {said}.", raw_name) from None
    # An Info-ZIP field with another name would be used by some readers and not by others (4.6.9).
    other = dict(_extra_fields(extra, raw_name)).get(EXTRA_UNICODE_PATH)
    if other is not None and other[5:] != raw_name:
        raise unsafe("The member has two different names.", name)
    return name


def _refuse_unreadable(name: str, flags: int, method: int, size: int, packed: int) -> None:
    if flags & (ENCRYPTED | STRONG | MASKED):
        raise unsafe("The member is encrypted.", name)
    if method not in (STORED, DEFLATED):
        raise unsafe(f"The member is compressed by method {method}; only stored and deflated members are supported.", name)
    if method == STORED and size != packed:
        raise unsafe("The member is stored, but its two sizes differ.", name)


def _with_local_header(file: BinaryIO, member: Member, directory_at: int) -> Member:
    """Return the member with the offset of its data; its local header must match the directory (4.3.7)."""
    file.seek(member.header_at)
    head = file.read(30)
    if len(head) < 30 or head[:4] != LOCAL:
        raise unsafe("There is no member at the offset in the directory.", member.name)
    flags, method, _, _, crc, packed, size, name_bytes, extra_bytes = struct.unpack_from("<HHHHIIIHH", head, 6)
    raw_name, extra = file.read(name_bytes), file.read(extra_bytes)
    data_at = member.header_at + 30 + name_bytes + extra_bytes
    if data_at + member.packed_bytes > directory_at:
        raise unsafe("The member extends beyond the beginning of the directory.", member.name)
    size, packed, _, _ = _large(extra, size, packed, 0, 0, raw_name)
    differs = [what for what, there, here in (
        ("name", raw_name, member.raw_name), ("method", method, member.method), ("flags", flags, member.flags),
    ) if there != here]  # fmt: skip
    # If flag 3 is set, sizes and sum follow the data; the header then holds zeros, or the same values.
    sums = (("sum", crc, member.crc), ("packed size", packed, member.packed_bytes), ("size", size, member.bytes))
    differs += [what for what, there, here in sums if there != here and not (flags & DESCRIPTOR and there == 0)]
    if differs:
        raise unsafe(f"The member's own header and the directory disagree about its {' and '.join(differs)}.", member.name)
    _decode(raw_name, flags, extra)
    return Member(**{**member.__dict__, "data_at": data_at})


def _refuse_overlaps(members: list[Member], directory_at: int) -> None:
    """Refuse members that share bytes, by which a small zip becomes petabytes (Fifield, "A better zip bomb", 2019)."""
    end = 0
    for member in sorted(members, key=lambda m: m.header_at):
        if member.header_at < end:
            raise unsafe("The member shares bytes with another.", member.name)
        end = member.data_at + member.packed_bytes
    if end > directory_at:
        raise unsafe("The last member overlaps the directory.")


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
