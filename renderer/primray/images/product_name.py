"""Paths of products' files: a productName says where its picture is written, in names that any file system holds."""

from __future__ import annotations

import posixpath
import re
import unicodedata
from pathlib import PurePosixPath

from .image import EXTENSIONS

# Extensions of pictures that are not written here: .exr takes their place. Others are part of the name ("shot.0001", "key.v2").
OTHER_PICTURES = frozenset(
    f".{name}"
    for name in (
        *("bmp", "dpx", "gif", "heic", "iff", "jp2", "j2k", "pfm", "pic", "ppm", "psd"),
        *("rat", "rgbe", "sgi", "tga", "tx", "webp"),
    )
)
# Names that Windows keeps for devices, whatever their extension.
RESERVED = frozenset(["con", "prn", "aux", "nul", *(f"{device}{n}" for device in ("com", "lpt") for n in "0123456789¹²³")])
_SCHEME = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]+):/+(?P<rest>.*)", re.DOTALL)
_DRIVE = re.compile(r"[A-Za-z]:")
LONGEST = 180  # bytes of the stem in UTF-8; file systems hold 255, and temporary names and frame numbers need some


def product_path(name: str, default: str) -> str:
    """The path of a productName's file: its folders, as they are but for letters that file systems refuse, and
    `safe_product_name`. A relative one is below the folder that its caller chooses.

    Drives of Windows and places that are no files' (`place_left_out`) are left out of it.
    """
    text = _folders_of(name)
    folder, slash, own = text.rpartition("/")
    parts = [_safe_folder(part) for part in folder.split("/") if part not in ("", ".")]
    root = "/" if slash and text.startswith("/") else ""
    return posixpath.normpath(root + "/".join([*parts, safe_product_name(own, default)]))


def changes_of(name: str) -> list[str]:
    """Return what `product_path` makes other than a productName says, in clauses; spelling such as \\ and <F4> is none."""
    found = []
    if place := place_left_out(name):
        found.append(f"{place} is no folder here and is left out; the rest is a relative path")
    *folders, own = _folders_of(name).split("/")
    plain = _last_part(own)
    stem, _ = _split(plain)
    suffix = PurePosixPath(plain).suffix
    if suffix.lower() in OTHER_PICTURES:
        found.append(f"{suffix} is not written here, and an EXR is")
    parts = [part for part in folders if part not in ("", ".", "..")]
    if any(len(part.encode("utf-8", "replace")) > LONGEST for part in (*parts, stem)):
        found.append(f"names are cut to {LONGEST} bytes")
    kept = [_safe_folder(part) == _cut(_spelled(part)) for part in parts] + [
        plain == _spelled(own),
        _safe_stem(stem) == _cut(stem),
    ]
    if own.strip(".") and not all(kept):
        found.append("letters that file systems refuse, or take for something else, are replaced or left out")
    return found


def place_left_out(name: str) -> str:
    """The drive of Windows, or the scheme of a URL, that `product_path` leaves out of a productName; "": none."""
    name = name.strip()
    if (scheme := _SCHEME.match(name)) is not None and len(scheme["scheme"]) > 1:
        return "" if scheme["scheme"].lower() == "file" else f"{scheme['scheme']}:"
    return name[:2] if _DRIVE.match(name) else ""


def _folders_of(name: str) -> str:
    """With / between folders. What is below a drive or another place becomes relative."""
    text = name.strip().replace("\\", "/")
    left_out = place_left_out(name)
    if left_out:
        return text[len(left_out) :].lstrip("/")
    if (scheme := _SCHEME.match(text)) is not None:
        return f"/{scheme['rest']}"
    return text


def _safe_folder(part: str) -> str:
    if part == "..":
        return part
    cleaned = _cut(_last_part(part)).rstrip(" ")
    return re.sub(r"^~", "_", cleaned) or "_"


def safe_product_name(name: str, default: str) -> str:
    """A file name without folders for a productName, ending in an extension that can be written.

    `default`: a stem for where nothing is left of the name; it is made safe as well.
    """
    for text in (name, default):
        stem, extension = _split(_last_part(text))
        stem = _safe_stem(stem)
        if stem:
            return stem + extension
    return "picture.exr"


def _last_part(text: str) -> str:
    """Without the folders of Unix and Windows, without what no file system shows."""
    part = re.sub(r"^[A-Za-z]:", "", re.split(r"[/\\]", text)[-1])
    part = _spelled(part)
    return "".join("_" if unicodedata.category(c)[0] == "C" or c in '<>:"|?*' else c for c in part)


def _spelled(text: str) -> str:
    """Return the text in the spelling that parts of a path have here: composed letters, $F4 for <F4>."""
    composed = unicodedata.normalize("NFC", text.encode("utf-8", "replace").decode("utf-8"))
    return re.sub(r"<F(F|\d*)>", r"$F\1", composed)  # needs no brackets


def _cut(text: str) -> str:
    return text.encode()[:LONGEST].decode("utf-8", "ignore")


def _split(part: str) -> tuple[str, str]:
    suffix = PurePosixPath(part).suffix
    if suffix.lower() in EXTENSIONS:
        return part[: -len(suffix)], suffix
    if suffix.lower() in OTHER_PICTURES:
        return part[: -len(suffix)], ".exr"
    return part, ".exr"


def _safe_stem(stem: str) -> str:
    """No hidden file, no option of a command, no device; "" where nothing is left."""
    stem = stem.lstrip(" .-~").rstrip(". ")
    stem = _cut(stem).strip(". ")
    return f"_{stem}" if stem.split(".")[0].strip().lower() in RESERVED else stem
