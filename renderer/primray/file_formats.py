"""Files that USD cannot read: scenes in other formats, with the command that converts each to USD, Git LFS pointers, and files
that this user may not read.

The command line, the library and the service give the same advice. Both commands were tried (docs/converting.md). Files are
named without their folders, since a user who uploads to a service knows only the file name.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from pathlib import PurePath

CODE = "stage-format"  # error code of a stage in another format
HEAD_BYTES = 256

_CONVERTER = "uvx --python 3.12 usd-convert-asset -i {file} -o {made} --preview-surface"


@dataclass(frozen=True)
class Format:
    """A scene file format that is not USD, with how to recognize and convert it."""

    called: str
    suffixes: tuple[str, ...]
    starts: tuple[bytes, ...] = ()
    python: str | None = None  # Blender call that imports it; "": Blender opens it directly; None: usd-convert-asset reads it
    advice: str | None = None  # replaces the conversion command


_EXPORT = "export USD from it"
_FORMATS = (
    Format("glTF", (".glb", ".gltf"), (b"glTF",)),
    Format("FBX", (".fbx",), (b"Kaydara FBX", b"; FBX")),
    Format("Wavefront OBJ", (".obj",)),
    Format("STL", (".stl",)),
    Format("PLY", (".ply",), (b"ply\n", b"ply\r\n")),
    Format("Alembic", (".abc",), (b"Ogawa", b"\x89HDF"), "bpy.ops.wm.alembic_import(filepath={file!r})"),
    Format("a Blender scene", (".blend",), (b"BLENDER",), ""),
    Format("a Maya scene", (".ma", ".mb"), (b"//Maya",), advice=f"In Maya, {_EXPORT}."),
    Format("a 3ds Max scene", (".max",), advice=f"In 3ds Max, {_EXPORT}."),
    Format("a Cinema 4D scene", (".c4d",), advice=f"In Cinema 4D, {_EXPORT}."),
    Format("a Houdini scene", (".hip", ".hiplc", ".hipnc"), advice=f"In Houdini, {_EXPORT} (a USD ROP)."),
    Format(
        "an OpenVDB volume",
        (".vdb",),
        advice="Reference it as a field (OpenVDBAsset) of a Volume prim, and render that stage.",
    ),
)
SUFFIXES = tuple(suffix for each in _FORMATS for suffix in each.suffixes)


def advice_for(name: str, head: bytes = b"") -> str | None:
    """Return what a file that is not USD is, and how to convert it; None for an unknown format.

    `head` holds the file's first bytes, which take precedence over its extension.
    """
    name = PurePath(name.replace("\\", "/")).name
    suffix = PurePath(name).suffix.lower()
    found = next((each for each in _FORMATS if any(head.startswith(start) for start in each.starts)), None)
    if found is None and head.startswith(b"{") and b'"asset"' in head:
        found = _FORMATS[0]
    found = found or next((each for each in _FORMATS if suffix in each.suffixes), None)
    return None if found is None else f"It is {found.called}, not USD. {found.advice or _command(found, name or 'model')}"


def advice_for_file(path: str) -> str | None:
    """Return `advice_for` of a file on disk, by its name alone if it cannot be read."""
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD_BYTES)
    except (OSError, ValueError):
        head = b""
    return advice_for(path, head)


def refers_to_other_format(path: str) -> bool:
    """Return whether a path has the extension of one of these formats."""
    return PurePath(path).suffix.lower() in SUFFIXES


def _command(found: Format, name: str) -> str:
    made = str(PurePath(name).with_suffix(".usdz" if found.python is None else ".usdc"))
    file, made = (f"./{each}" if each.startswith("-") else each for each in (name, made))
    if found.python is None:
        command = _CONVERTER.format(file=shlex.quote(file), made=shlex.quote(made))
        return f"To convert it, in its folder: {command}"
    words = ["blender", "--background", *([file] if not found.python else []), "--python-expr"]
    importing = "bpy.ops.wm.read_factory_settings(use_empty=True); " + found.python.format(file=file) if found.python else ""
    exporting = f"bpy.ops.wm.usd_export(filepath={made!r})"
    script = "; ".join(filter(None, ("import bpy", importing, exporting)))
    return f"To convert it, in its folder: {shlex.join([*words, script])}"


_FIRST_LINE = b"version https://git-lfs.github.com/spec/v1"
WHAT_IT_IS = "it is a Git LFS pointer, not the file: run git lfs pull"


def is_pointer(content: bytes) -> bool:
    """Return whether a file's first bytes are those of a Git LFS pointer."""
    return content.startswith(_FIRST_LINE)


def is_pointer_file(path: str) -> bool:
    """Return whether a file that could not be used is a Git LFS pointer; False if it cannot be read at all."""
    try:
        with open(path, "rb") as file:
            return is_pointer(file.read(len(_FIRST_LINE)))
    except (OSError, ValueError):
        return False


LOCKED = "this user may not read it (permission denied)"
BEHIND_LOCK = "this user may not enter a folder above it (permission denied)"


def why_locked(path: str) -> str | None:
    """Return what keeps this user from a file or folder; None if permissions do not, also where nothing is there.

    Python and USD say of a file below a folder that the user may not enter that it does not exist.
    """
    try:
        os.stat(path)
    except PermissionError:
        return BEHIND_LOCK
    except (OSError, ValueError):
        return None
    return None if os.access(path, os.R_OK) else LOCKED
