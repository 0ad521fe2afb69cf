"""File paths of render products: productName made safe for any file system."""

from __future__ import annotations

import posixpath
import re
import unicodedata
from pathlib import PurePosixPath

from .image import EXTENSIONS

# Picture extensions that are not supported and become .exr. Any other suffix is part of the name ("shot.0001", "key.v2").
OTHER_PICTURES = frozenset(
    f".{name}"
    for name in (
        *("bmp", "dpx", "gif", "heic", "iff", "jp2", "j2k", "pfm", "pic", "ppm", "psd"),
        *("rat", "rgbe", "sgi", "tga", "tx", "webp"),
    )
)
# Device names reserved by Windows, whatever their extension.
RESERVED = frozenset(["con", "prn", "aux", "nul", *(f"{device}{n}" for device in ("com", "lpt") for n in "0123456789¹²³")])
_SCHEME = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]+):/+(?P<rest>.*)", re.DOTALL)
_DRIVE = re.compile(r"[A-Za-z]:")
LONGEST = 180  # bytes of the stem in UTF-8; file systems allow 255, less temporary suffixes and frame numbers


def product_path(name: str, default: str) -> str:
    """Return the path of a productName's file: safe folders and `safe_product_name`.

    A relative path is below the folder that the caller chooses. Windows drives and URL schemes (`place_left_out`) are dropped.
    """
    text = _folders_of(name)
    folder, slash, own = text.rpartition("/")
    parts = [_safe_folder(part) for part in folder.split("/") if part not in ("", ".")]
    root = "/" if slash and text.startswith("/") else ""
    return posixpath.normpath(root + "/".join([*parts, safe_product_name(own, default)]))


def changes_of(name: str) -> list[str]:
    """Return how `product_path` differs from a productName, in clauses; spelling such as \\ and <F4> does not count."""
    found = []
    if place := place_left_out(name):
        found.append(f"{place} is not supported and is left out; the rest is a relative path")
    *folders, own = _folders_of(name).split("/")
    plain = _last_part(own)
    stem, _ = _split(plain)
    suffix = PurePosixPath(plain).suffix
    if suffix.lower() in OTHER_PICTURES:
        found.append(f"{suffix} is not supported, and an EXR is written instead")
    parts = [part for part in folders if part not in ("", ".", "..")]
    if any(len(part.encode("utf-8", "replace")) > LONGEST for part in (*parts, stem)):
        found.append(f"names are cut to {LONGEST} bytes")
    kept = [_safe_folder(part) == _cut(_spelled(part)) for part in parts] + [
        plain == _spelled(own),
        _safe_stem(stem) == _cut(stem),
    ]
    if own.strip(".") and not all(kept):
        found.append("characters that file systems refuse or interpret are replaced or left out")
    return found


def place_left_out(name: str) -> str:
    """Return the Windows drive or URL scheme that `product_path` drops from a productName, or ""."""
    name = name.strip()
    if (scheme := _SCHEME.match(name)) is not None and len(scheme["scheme"]) > 1:
        return "" if scheme["scheme"].lower() == "file" else f"{scheme['scheme']}:"
    return name[:2] if _DRIVE.match(name) else ""


def _folders_of(name: str) -> str:
    """Return the name with / between folders; a path below a drive or scheme becomes relative."""
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
    """Return a file name without folders for a productName, with an extension that can be written.

    `default` is the stem if nothing is left of the name; it is made safe as well.
    """
    for text in (name, default):
        stem, extension = _split(_last_part(text))
        stem = _safe_stem(stem)
        if stem:
            return stem + extension
    return "picture.exr"


def _last_part(text: str) -> str:
    """Return the last part of a Unix or Windows path, without control and reserved characters."""
    part = re.sub(r"^[A-Za-z]:", "", re.split(r"[/\\]", text)[-1])
    part = _spelled(part)
    return "".join("_" if unicodedata.category(c)[0] == "C" or c in '<>:"|?*' else c for c in part)


def _spelled(text: str) -> str:
    """Return the text in normalized spelling: composed characters, $F4 for <F4>."""
    composed = unicodedata.normalize("NFC", text.encode("utf-8", "replace").decode("utf-8"))
    return re.sub(r"<F(F|\d*)>", r"$F\1", composed)  # no reserved characters


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
    """Return a stem that is not a hidden file, a command option or a device; "" if nothing is left."""
    stem = stem.lstrip(" .-~").rstrip(". ")
    stem = _cut(stem).strip(". ")
    return f"_{stem}" if stem.split(".")[0].strip().lower() in RESERVED else stem
