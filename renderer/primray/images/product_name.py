"""File names for products: a stage says how its pictures are called, never where they lie."""

from __future__ import annotations

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
LONGEST = 180  # bytes of the stem in UTF-8; file systems hold 255, and temporary names and frame numbers need some


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
