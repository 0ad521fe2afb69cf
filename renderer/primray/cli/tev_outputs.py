"""Outputs shown in tev: their names, and the connections of one command.

This module does not import Typer (see quick.py).
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ..errors import PrimrayError, SettingsError
from ..render.frame_names import FrameName, frame_name

if TYPE_CHECKING:
    from ..images.image import Image
    from ..images.tev import TevPicture

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
