"""Why OpenImageIO could not read or write something: its messages quote the file, whose bytes need not be text.

JPEGs need a closer look. libjpeg fills what is missing of one with grey and only warns, which OpenImageIO keeps as an error
beside pixels that it gives: of the other formats it gives none.
"""

from __future__ import annotations

import tempfile
from typing import Any

from .jpeg_scan import zeroed_part

END_OF_JPEG = b"\xff\xd9"  # the marker EOI: ITU-T T.81, B.2.1
# Messages of libjpeg (jerror.h) about what is beside the pixels, or read as it was meant.
_HARMLESS = (
    "extraneous bytes before marker",
    "unknown JFIF revision number",
    "Unknown Adobe color transform code",
    "Invalid SOS parameters for sequential JPEG",
    "bad ICC marker",
)
_ENDS_EARLY = "Premature end of JPEG file"


def last_error(source: Any) -> str:
    """Of OpenImageIO itself or one of its objects, on one line; forgotten there afterwards."""
    try:
        return "; ".join(map(str.strip, str(source.geterror()).strip().splitlines()))
    except UnicodeDecodeError:
        return "its header holds bytes that are no text"


def fault_of_pixels(image: Any, path: str) -> str:
    """Why the pixels that `image` just gave are not those of the file; "" where they are. Forgotten there afterwards.

    `image` is an OpenImageIO ImageInput. Progressive JPEGs are decoded as it is opened, so errors since then count.
    """
    if not image.has_error:
        return _hole(path) if image.format_name() == "jpeg" else ""
    message = last_error(image)
    if image.format_name() != "jpeg":
        return message
    if _ENDS_EARLY in message:
        return _hole(path) if _lacks_only_its_end(path) else message
    if any(harmless in message for harmless in _HARMLESS):
        return _hole(path) if _has_end(path) else _ENDS_EARLY  # the first warning alone is kept
    return message


def _hole(path: str) -> str:
    with open(path, "rb") as file:
        at = zeroed_part(file.read())
    return "" if at is None else f"its coefficients are zeros from byte {at} on"


def _has_end(path: str) -> bool:
    with open(path, "rb") as file:
        return END_OF_JPEG in file.read()[-4096:]


def _lacks_only_its_end(path: str) -> bool:
    """Whether all pixels of a JPEG are there, and only the two bytes that end it are not: some cameras leave them out."""
    import OpenImageIO as oiio

    with open(path, "rb") as file, tempfile.NamedTemporaryFile(suffix=".jpg") as whole:
        whole.write(file.read() + END_OF_JPEG)
        whole.flush()
        again = oiio.ImageInput.open(whole.name)
        if again is None:
            last_error(oiio)
            return False
        try:
            return again.read_image(0, 0, 0, again.spec().nchannels, oiio.UINT8) is not None and not again.has_error
        finally:
            again.close()
