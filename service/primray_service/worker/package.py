"""The files of a scene as its check sees them: those of the job's folder, and inside each usdz those in its directory; and the
resolution of asset paths by their text: to a file of the scene, to one that was not uploaded, or outside.

Nothing is unpacked: members of a usdz are stored, so they are byte ranges of the file, which USD opens as
`package.usdz[member]`. Paths may go up as long as they stay in the upload; the sandbox enforces that boundary, and here it
becomes a clear message.
"""

from __future__ import annotations

import io
import os
import posixpath
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from ..limits import Limits
from ..problems import Problem
from ..scenes.recognize import layers as layers_of
from ..scenes.recognize import wrong_as_usdz
from ..scenes.zip_directory import Member, read_directory, refuse_names

IMAGES = {".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".tga", ".bmp", ".webp", ".tx", ".psd", ".avif"}
# Extensions of plug-ins and scripts, which are never loaded.
PROGRAMS = {".py", ".pyc", ".pyd", ".so", ".dll", ".dylib", ".sh", ".exe", ".lua"}
_MAGIC = ((b"#usda ", "usda"), (b"#sdf ", "usda"), (b"PXR-USDC", "usdc"), (b"PK\x03\x04", "usdz"))
_SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}


@dataclass(frozen=True)
class File:
    name: str  # in its container, with /
    kind: str  # usda, usdc, usdz (by their first bytes), image, program, other; "?": named like USD, but is not
    bytes: int
    path: Path  # the file on disk that contains it, from `at` on
    at: int

    def open(self) -> BinaryIO:
        return cast(BinaryIO, io.BufferedReader(_Stretch(self.path, self.at, self.bytes)))


@dataclass
class Container:
    """A folder or the inside of a usdz. `prefix` and `suffix` surround a member's name to make its name from outside."""

    prefix: str = ""
    suffix: str = ""
    files: dict[str, File] = field(default_factory=dict)
    inner: dict[str, Container] = field(default_factory=dict)  # by usdz file in it
    is_one_file: bool = False  # the scene is its only file

    def shown(self, name: str) -> str:
        return f"{self.prefix}{name}{self.suffix}"

    def walk(self) -> Iterator[tuple[Container, File]]:
        for file in self.files.values():
            yield self, file
            if file.name in self.inner:
                yield from self.inner[file.name].walk()


def read_folder(folder: Path, limits: Limits) -> Container:
    """Read everything below a folder. Problem for special files, and for invalid packages."""
    found = Container()
    for path in sorted(_plain_files(folder)):
        name = path.relative_to(folder).as_posix()
        _add(found, _file(name, path, 0, path.stat().st_size), limits, depth=1)
    return found


def read_file(path: Path, limits: Limits) -> Container:
    """Read one file without a folder."""
    found = Container(is_one_file=True)
    _add(found, _file(path.name, path, 0, path.stat().st_size), limits, depth=1)
    return found


def _plain_files(folder: Path) -> Iterator[Path]:
    for inside, folders, names in os.walk(folder, onerror=_raise):
        for name in (*folders, *names):
            path = Path(inside, name)
            mode = path.lstat().st_mode
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                member = path.relative_to(folder).as_posix()
                raise Problem("package-unsafe", "A member of the package is not a plain file.", member=member)
            if stat.S_ISREG(mode):
                yield path


def _raise(error: OSError) -> None:
    raise error


def _add(container: Container, file: File, limits: Limits, depth: int) -> None:
    container.files[file.name] = file
    if file.kind != "usdz":
        return
    shown = container.shown(file.name)
    if depth > limits.usdz_depth:
        raise Problem("package-unsafe", f"Packages are nested more than {limits.usdz_depth} levels deep.", member=shown)
    opening, closing = ("[", "]") if not container.suffix else ("[", "]" + container.suffix)
    inside = Container(f"{container.prefix}{file.name}{opening}", closing)
    container.inner[file.name] = inside
    for member in _members(file, limits, None if container.is_one_file else inside):
        start = file.at + member.data_at
        _add(inside, _file(member.name, file.path, start, member.bytes), limits, depth + 1)


def _members(file: File, limits: Limits, inside: Container | None) -> list[Member]:
    """Return the members of a usdz; problems name the member, as seen from outside unless the usdz is all that was sent."""
    try:
        with file.open() as opened:
            members = read_directory(opened, limits)
        refuse_names(members, limits)
        wrong = wrong_as_usdz(members)
    except Problem as problem:
        wrong = problem
    if wrong is not None:
        member = wrong.extra.get("member")
        name = (inside.shown(member) if member else inside.prefix.removesuffix("[")) if inside else member or file.name
        raise Problem("package-unsafe", wrong.detail, **{**wrong.extra, "member": name})
    return [member for member in members if not member.is_folder]


def _file(name: str, path: Path, at: int, size: int) -> File:
    suffix = PurePosixPath(name).suffix.lower()
    if suffix in _SUFFIXES:
        with path.open("rb") as opened:
            opened.seek(at)
            head = opened.read(min(size, 8))
        kind = next((kind for magic, kind in _MAGIC if head.startswith(magic)), "?")
        # .usd may be text or binary; the others must be what they are named.
        fits = kind in {".usd": ("usda", "usdc"), ".usda": ("usda",), ".usdc": ("usdc",), ".usdz": ("usdz",)}[suffix]
        return File(name, kind if fits else "?", size, path, at)
    if suffix in PROGRAMS or PurePosixPath(name).name.lower() == "pluginfo.json":
        return File(name, "program", size, path, at)
    return File(name, "image" if suffix in IMAGES else "other", size, path, at)


def scene_layers(container: Container) -> list[tuple[Container, File]]:
    """Return all layers, including those in packages; not what macOS leaves in zips, nor hidden files."""
    named = set(layers_of(container.files))
    return [
        (inside, file)
        for inside, file in container.walk()
        if file.kind in ("usda", "usdc", "?") and (inside is not container or file.name in named)
    ]


class _Stretch(io.RawIOBase):
    """A byte range of a file, as a file object."""

    def __init__(self, path: Path, at: int, size: int) -> None:
        self._file = path.open("rb", buffering=0)
        self._start, self._size, self._place = at, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = max(0, base + offset)
        return self._place

    def tell(self) -> int:
        return self._place

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        wanted = min(len(buffer), max(0, self._size - self._place))
        self._file.seek(self._start + self._place)
        data = self._file.read(wanted)
        buffer[: len(data)] = data
        self._place += len(data)
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()


SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]*:")
_LITERAL = re.compile(r"\"((?:[^\"\\]|\\.)*)\"|'((?:[^'\\]|\\.)*)'")
_VARIABLE = re.compile(r"\$\{[^}]*\}")


@dataclass(frozen=True)
class Found:
    container: Container
    file: File

    @property
    def name(self) -> str:
        return self.container.shown(self.file.name)


def find(container: Container, layer: str, asset_path: str) -> Found | None:
    """Return the file that an asset path of a layer refers to; None if it was not uploaded. Problem if it leads outside.

    Paths are relative to the layer; inside a usdz also to the package, as its specification says.
    """
    shown = container.shown(layer)
    outer, inner = split_package(asset_path)
    if leads_out(posixpath.dirname(layer), outer):
        raise Problem(
            "asset-path-outside-job",
            f"The layer {shown!r} names {asset_path!r}, which is outside the upload.",
            layer=shown,
            asset_path=asset_path,
        )
    places = [posixpath.dirname(layer)]
    if container.prefix and not outer.startswith(("./", "../")):
        places.append("")
    for place in places:
        for name in _names(container, posixpath.normpath(posixpath.join(place, outer))):
            return _inside(Found(container, container.files[name]), inner, shown, asset_path)
    _inside(None, inner, shown, asset_path)
    return None


def refuse_expression(container: Container, layer: str, expression: str) -> None:
    """Raise Problem if the literal parts of an expression lead outside for any values of its variables."""
    for literal in _LITERAL.finditer(expression):
        text = literal[1] if literal[1] is not None else literal[2]
        if leads_out(posixpath.dirname(layer), _VARIABLE.sub("x", text)):
            shown = container.shown(layer)
            raise Problem(
                "asset-path-outside-job",
                f"The layer {shown!r} names `{expression}`, which is outside the upload.",
                layer=shown,
                asset_path=f"`{expression}`",
            )


def leads_out(folder: str, path: str) -> bool:
    """Return whether a path leads outside: absolute, with a scheme or a drive, or further up than the folder's root."""
    plain = path.replace("\\", "/")
    if plain.startswith("/") or SCHEME.match(plain):
        return True
    return posixpath.normpath(posixpath.join(folder, plain)).split("/")[0] == ".."


def split_package(path: str) -> tuple[str, str | None]:
    """Return `a.usdz[b.usdz[c]]` as (`a.usdz`, `b.usdz[c]`)."""
    if path.endswith("]") and "[" in path:
        outer, _, inner = path[:-1].partition("[")
        return outer, inner
    return path, None


def _inside(outer: Found | None, inner: str | None, layer: str, asset_path: str) -> Found | None:
    """Return the member of a package; Problem if its name leads out of it, whether the package exists or not."""
    if inner is None:
        return outer
    name, further = split_package(inner)
    if leads_out("", name):
        raise Problem(
            "package-unsafe",
            f"The layer {layer!r} names {asset_path!r}, a member outside its package.",
            member=asset_path,
            layer=layer,
            asset_path=asset_path,
        )
    container = outer.container.inner.get(outer.file.name) if outer is not None else None
    file = container.files.get(posixpath.normpath(name)) if container is not None else None
    return _inside(Found(container, file) if container is not None and file is not None else None, further, layer, asset_path)


def _names(container: Container, path: str) -> Iterator[str]:
    """Yield the names of the file with this path, or of the first tile of a UDIM pattern."""
    if path in container.files:
        yield path
    elif "<UDIM>" in path:
        pattern = re.compile("".join(r"\d{4}" if part == "<UDIM>" else re.escape(part) for part in re.split("(<UDIM>)", path)))
        yield from (name for name in container.files if pattern.fullmatch(name))
