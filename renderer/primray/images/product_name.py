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
    cleaned = _last_part(part).encode()[:LONGEST].decode("utf-8", "ignore").rstrip(" ")
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
    text = unicodedata.normalize("NFC", text.encode("utf-8", "replace").decode("utf-8"))
    part = re.split(r"[/\\]", text)[-1]
    part = re.sub(r"^[A-Za-z]:", "", part)
    part = re.sub(r"<F(F|\d*)>", r"$F\1", part)  # a frame's number, in the spelling that needs no brackets
    return "".join("_" if unicodedata.category(c)[0] == "C" or c in '<>:"|?*' else c for c in part)


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
    stem = stem.encode()[:LONGEST].decode("utf-8", "ignore").strip(". ")
    return f"_{stem}" if stem.split(".")[0].strip().lower() in RESERVED else stem
