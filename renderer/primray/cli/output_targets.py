"""Outputs that are not files: standard output and tev. This module does not import Typer (see quick.py).

"-" writes an EXR to standard output, "png:-" a PNG; messages then go to stderr. "tev://HOST:PORT" shows the picture in a tev.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import PrimrayError, SettingsError
from ..render.frames import FrameName, frame_name

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..images.image import Image
    from ..images.tev import TevPicture


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


EVERY_S = 0.25  # seconds between two updates
MOST_SHARE = 0.1  # largest share of the render time spent on updates


def is_tev(output: str) -> bool:
    return output[:6].lower() == "tev://"


def output_name(output: str, stem: str, many: bool) -> FrameName:
    """Return an output's name in every frame. A picture in tev is named after its stage by default."""
    rest = output[len("tev://") :]
    if not is_tev(output) or rest.partition("/")[2]:
        return frame_name(output)
    return FrameName(f"{output.rstrip('/')}/{stem}", ".####" if many else "")


class TevOutputs:
    """The tev pictures of one command; connections are opened when first needed."""

    def __init__(self) -> None:
        self._open: dict[str, TevPicture] = {}
        self._lost: set[str] = set()

    def check(self, output: str) -> None:
        """Raise SettingsError unless a tev listens at the output's address."""
        self._picture(output)
        self._open.pop(output).close()

    def show_so_far(self, image: Image, outputs: list[str]) -> None:
        """Update the pictures. A failure is reported once; rendering continues, and the picture is sent again at the end."""
        for output in outputs:
            if output in self._lost:
                continue
            try:
                self._show(image, output)
            except PrimrayError as error:
                self._lost.add(output)
                print(f"warning: the unfinished picture could not be shown: {error}", file=sys.stderr)

    def show(self, image: Image, output: str) -> None:
        """Show the finished picture; PrimrayError ("write-failed") if it cannot be sent."""
        self._show(image, output)
        self._open.pop(output).close()

    def _show(self, image: Image, output: str) -> None:
        try:
            self._picture(output).show(image)
        except PrimrayError as error:
            broken = self._open.pop(output, None)
            if broken is not None:
                broken.close()
            if isinstance(error, SettingsError):  # the connection existed before
                raise PrimrayError(error.message, where=output, code="write-failed") from error
            raise

    def _picture(self, output: str) -> TevPicture:
        from ..images.tev import TevPicture

        if output not in self._open:
            self._open[output] = TevPicture(output)
        return self._open[output]
