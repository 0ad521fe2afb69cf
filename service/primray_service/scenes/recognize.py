"""Recognition of files: the kind by the first bytes and, for usdz or zip, by the layout of the members; names of scenes; and
the layers of a package that can be its root."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath
from typing import Literal
from urllib.parse import unquote

from primray.errors import StageOpenError
from primray.file_formats import CODE as OTHER_FORMAT
from primray.file_formats import WHAT_IT_IS, advice_for, is_pointer, refers_to_other_format

from ..problems import Problem
from .zip_directory import STORED, Member, unsafe

SceneKind = Literal["usda", "usdc", "usdz", "zip"]

HEAD_BYTES = 4096
USDZ_ALIGNMENT = 64  # of a member's data in a usdz: https://openusd.org/release/spec_usdz.html
LAYER_SUFFIXES = (".usd", ".usda", ".usdc")
MEDIA_TYPES = {
    "usda": "model/vnd.usda",
    "usdc": "model/vnd.usdc",
    "usdz": "model/vnd.usdz+zip",
    "zip": "application/zip",
}
MAX_NAME_CHARS = 255


def recognize(head: bytes, name: str = "") -> SceneKind:
    """Return the kind of a file. `head`: its first HEAD_BYTES, or all. A usdz is "zip" here: see is_usdz. Problem("not-usd")
    for anything else, with the command that converts it if `name` or the bytes reveal what it is."""
    if head.startswith(b"#usda "):
        return "usda"
    if head.startswith(b"PXR-USDC"):
        return "usdc"
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "zip"
    if is_pointer(head):
        # the same code as opening it would give
        raise Problem("not-usd", f"USD cannot open it: {WHAT_IT_IS}.", code=StageOpenError.code)
    advice = advice_for(name, head)
    if advice is not None:
        raise Problem("not-usd", advice, code=OTHER_FORMAT)
    raise Problem(
        "not-usd",
        "The file begins neither with #usda, nor with PXR-USDC, nor as a zip or usdz does; "
        f"its first bytes are {head[:8].hex(' ')}{_guess(head)}.",
    )


def without_layers(paths: Sequence[str]) -> Problem:
    """Return the problem of a package without a layer, with how to convert its contents."""
    sentence = f"None of the package's {len(paths)} files is a usd, usda, usdc or usdz layer."
    other = next((path for path in paths if refers_to_other_format(path)), None)
    if other is None:
        return Problem("not-usd", sentence)
    return Problem("not-usd", f"{sentence} {other}: {advice_for(other)}", code=OTHER_FORMAT)


def called_usdz(media_type: str, name: str) -> bool:
    return media_type.partition(";")[0].strip().lower() == MEDIA_TYPES["usdz"] or name.lower().endswith(".usdz")


def wrong_as_usdz(members: Sequence[Member]) -> Problem | None:
    """Return why a zip is no usdz, or None if it is one. The answer depends on the bytes alone, so that equal bytes are always
    the same kind of scene, whatever they were called."""
    if not members:
        return unsafe("A usdz without members is not USD.")
    first = min(members, key=lambda member: member.header_at)
    for member in members:
        if member.is_folder:
            continue
        if member.method != STORED:
            return unsafe("The members of a usdz must not be compressed; this one is.", member.name)
        if member.data_at % USDZ_ALIGNMENT:
            return unsafe(
                f"The members of a usdz must begin at multiples of {USDZ_ALIGNMENT} bytes; this one does not.", member.name
            )
    if not first.name.lower().endswith(LAYER_SUFFIXES):
        return unsafe("The first member of a usdz must be its root layer; this one is not a layer.", first.name)
    return None


def _guess(head: bytes) -> str:
    known = {
        b"\xef\xbb\xbf#usda": "a usda file with a byte order mark; save it without one",
        b"\x89PNG": "a PNG image",
        b"v/1\x01": "an OpenEXR image",
        b"\x1f\x8b": "gzip",
        b"7z\xbc\xaf": "7-Zip",
        b"<?xml": "XML",
        b"{": "perhaps JSON",
        b"--": "perhaps multipart form data sent without its Content-Type",
    }
    found = next((what for start, what in known.items() if head.startswith(start)), None)
    return f" ({found})" if found else ""


def display_name(given: str) -> str:
    """Return a file name for display, never for opening: without folders and control characters, at most 255 characters."""
    name = unicodedata.normalize("NFC", given).replace("\\", "/").rpartition("/")[2]
    # Category C: control, format (including bidirectional overrides), surrogates, private use.
    name = "".join(char for char in name if not unicodedata.category(char).startswith("C")).strip()
    return "" if name in (".", "..") else name[:MAX_NAME_CHARS]


def disposition_name(value: str) -> str:
    """Return the file name in a Content-Disposition header (RFC 6266); "" if there is none."""
    extended = re.search(r"filename\*\s*=\s*utf-8'[^']*'([^;\s]+)", value, re.IGNORECASE)
    if extended:
        return display_name(unquote(extended.group(1), errors="replace"))
    plain = re.search(r'filename\s*=\s*(?:"((?:[^"\\]|\\.)*)"|([^;\s]+))', value, re.IGNORECASE)
    if plain is None:
        return ""
    quoted = plain.group(1)
    # Browsers send backslashes and quotes of names percent-encoded or escaped; both decode to the same name.
    return display_name(re.sub(r'\\(["\\])', r"\1", quoted) if quoted is not None else plain.group(2))


MOST_CHARS = 120  # of a file's name
MOST_NAME_CHARS = 255  # of a job's
# No separators, nothing with a meaning in USD paths (@, brackets, colons, quotes), no hidden files.
_PLAIN = re.compile(r"[^\W_][^/\\\x00-\x1f\x7f@<>\[\]\"'`:${}]*")
_SUFFIXES = {"usda": (".usda", ".usd"), "usdc": (".usdc", ".usd"), "usdz": (".usdz",)}


def job_name(scene: str, entry: str | None, camera: str | None, frames: str | None) -> str:
    """Return the name for a job that was given none: its scene's or layer's, with what distinguishes it from others of the same
    scene."""
    stem = PurePosixPath(entry or scene or "scene").stem
    camera = PurePosixPath(camera).name if camera else None
    return " ".join(filter(None, (stem, camera, frames)))[:MOST_NAME_CHARS]


def file_name(name: str, kind: str) -> str:
    """Return a plain file name for a scene that was sent as `name`, with a suffix of its kind; scene.KIND if the name is not
    plain."""
    path = PurePosixPath(name.replace("\\", "/"))
    stem = path.stem if path.suffix.lower() in (".usda", ".usdc", ".usdz", ".usd", ".zip") else path.name
    if len(stem.encode()) > MOST_CHARS or not _PLAIN.fullmatch(stem):
        return f"scene.{kind}"
    return f"{stem}{path.suffix if path.suffix in _SUFFIXES[kind] else f'.{kind}'}"


ROOT_SUFFIXES = (*LAYER_SUFFIXES, ".usdz")
SHOWN = 50


def layers(paths: Iterable[str]) -> list[str]:
    """Return the layers that can be a job's entry."""
    return sorted(path for path in paths if path.lower().endswith(ROOT_SUFFIXES) and not _is_left_over(path))


def candidates(paths: Iterable[str]) -> list[str]:
    """Return the layers in the outermost folder that has any: those further in are referenced by them."""
    found = layers(paths)
    outermost = min((path.count("/") for path in found), default=0)
    return [path for path in found if path.count("/") == outermost]


def choose(entry: str | None, roots: Sequence[str], known: Sequence[str] | None = None) -> str | None:
    """Return a job's entry: the requested one, or the only candidate. None if nothing is known of the package yet.

    `roots`: candidates; `known`: all layers (None: those in `roots`).
    """
    if entry is not None:
        choice = known if known is not None else roots
        if choice and entry not in choice:
            raise Problem("entry-missing", f"The package has no layer {entry!r}.", candidates=list(roots[:SHOWN]))
        return entry
    if len(roots) > 1:
        raise Problem(
            "ambiguous-entry",
            f"The package has {len(roots)} layers that can be its root; name one of them as the scene's `entry`.",
            candidates=list(roots[:SHOWN]),
        )
    return roots[0] if roots else None


def _is_left_over(path: str) -> bool:
    """Return whether the path is one that macOS adds to zips, or a hidden file."""
    return any(part == "__MACOSX" or part.startswith(".") for part in path.split("/"))
