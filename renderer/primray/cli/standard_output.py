"""Outputs on standard output: "-" writes an EXR there, "png:-" a PNG; messages then go to stderr.

This module does not import Typer (see quick.py).
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import PrimrayError, SettingsError

if TYPE_CHECKING:
    from collections.abc import Callable

DASH = "-"


def is_standard(output: str) -> bool:
    kind, colon, rest = output.rpartition(":")
    return rest == DASH and (not colon or kind.isalnum())


def suffix_of(output: str) -> str:
    """Return the suffix of the output's file, or of the equivalent file: ".exr" for "-"."""
    if not is_standard(output):
        return Path(output).suffix
    kind = output.rpartition(":")[0]
    return f".{kind or 'exr'}"


def check_standard(outputs: Sequence[str], as_json: bool) -> None:
    """Raise SettingsError if several outputs, or JSON lines as well, would go to standard output."""
    standard = [output for output in outputs if is_standard(output)]
    if len(standard) > 1 or (standard and as_json):
        beside = "JSON lines" if as_json else "another picture"
        sentence = f"standard output can hold only the picture, not {beside} as well"
        raise SettingsError(sentence, where=standard[0], code="standard-output")
    for output in standard:
        from ..images.image import EXTENSIONS

        if suffix_of(output) not in EXTENSIONS:
            known = ", ".join(extension[1:] for extension in EXTENSIONS)
            sentence = f"formats for standard output are {known}, such as png:-"
            raise SettingsError(sentence, where=output, code="unknown-extension")


def write_standard(write: Callable[[Path], object], output: str) -> None:
    """Write the file that `write` makes to standard output. A temporary file is used because formats need to seek."""
    with tempfile.TemporaryDirectory(prefix="primray-") as folder:
        path = Path(folder, f"picture{suffix_of(output)}")
        write(path)
        try:
            sys.stdout.flush()
            sys.stdout.buffer.write(path.read_bytes())
            sys.stdout.buffer.flush()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            sentence = f"the picture cannot be written: {reason}"
            raise PrimrayError(sentence, where="standard output", code="write-failed") from error
