"""Outputs on standard output: "-" is an EXR there, "png:-" a PNG. What is told goes to stderr then.

Nothing of Typer is imported here (see quick.py).
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
    """Of the file that an output is, or would be: ".exr" for "-"."""
    if not is_standard(output):
        return Path(output).suffix
    kind = output.rpartition(":")[0]
    return f".{kind or 'exr'}"


def check_standard(outputs: Sequence[str], as_json: bool) -> None:
    """SettingsError where several outputs, or JSON lines too, would be on standard output."""
    standard = [output for output in outputs if is_standard(output)]
    if len(standard) > 1 or (standard and as_json):
        beside = "JSON lines" if as_json else "another picture"
        sentence = f"standard output holds the picture alone, not {beside} as well"
        raise SettingsError(sentence, where=standard[0], code="standard-output")
    for output in standard:
        from ..images.image import EXTENSIONS

        if suffix_of(output) not in EXTENSIONS:
            known = ", ".join(extension[1:] for extension in EXTENSIONS)
            sentence = f"on standard output there can be {known}, like png:-"
            raise SettingsError(sentence, where=output, code="unknown-extension")


def write_standard(write: Callable[[Path], object], output: str) -> None:
    """What `write` makes of a file, on standard output: formats are written back and forth, which a pipe is not."""
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
