"""Errors of OpenImageIO while reading or writing; its messages quote the file, whose bytes may not be text.

JPEGs need a closer look. libjpeg fills missing parts with grey and only warns, which OpenImageIO stores as an error although
it returns pixels: for other formats it returns none.
"""

from __future__ import annotations

import tempfile
from typing import Any

from .jpeg_scan import zeroed_part

END_OF_JPEG = b"\xff\xd9"  # the marker EOI: ITU-T T.81, B.2.1
# Warnings of libjpeg (jerror.h) that do not affect pixels.
_HARMLESS = (
    "extraneous bytes before marker",
    "unknown JFIF revision number",
    "Unknown Adobe color transform code",
    "Invalid SOS parameters for sequential JPEG",
    "bad ICC marker",
)
_ENDS_EARLY = "Premature end of JPEG file"


def last_error(source: Any) -> str:
    """Return the error of OpenImageIO, or of one of its objects, on one line; this clears it."""
    try:
        return "; ".join(map(str.strip, str(source.geterror()).strip().splitlines()))
    except UnicodeDecodeError:
        return "its header contains bytes that are not text"


def fault_of_pixels(image: Any, path: str) -> str:
    """Return why the pixels that `image` just returned are not the file's, "" where they are; this clears its error.

    `image` is an OpenImageIO ImageInput. Progressive JPEGs are decoded when they are opened, so errors since then count.
    """
    if not image.has_error:
        return _hole(path) if image.format_name() == "jpeg" else ""
    message = last_error(image)
    if image.format_name() != "jpeg":
        return message
    if _ENDS_EARLY in message:
        return _hole(path) if _lacks_only_its_end(path) else message
    if any(harmless in message for harmless in _HARMLESS):
        return _hole(path) if _has_end(path) else _ENDS_EARLY  # OpenImageIO keeps only the first warning
    return message


def _hole(path: str) -> str:
    with open(path, "rb") as file:
        at = zeroed_part(file.read())
    return "" if at is None else f"its coefficients are zeros from byte {at} on"


def _has_end(path: str) -> bool:
    with open(path, "rb") as file:
        return END_OF_JPEG in file.read()[-4096:]


def _lacks_only_its_end(path: str) -> bool:
    """Return whether all pixels of a JPEG exist and only its end marker is missing: some cameras omit it."""
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
