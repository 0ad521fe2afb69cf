"""The specs of an EXR's parts as the stage's product asks for them: compression and attributes of the header."""

from __future__ import annotations

from collections.abc import Sequence

from ...aov_names import CRYPTOMATTES
from ...description.picture_file import LOSSY, HeaderValue, PictureFile
from .encoding import Part

SOURCE = "primray:source"  # of an AOV's part


def store_as_product(parts: Sequence[Part], file: PictureFile) -> None:
    """Say so in the specs. Numbers that stand for something, of Cryptomatte and of ids, are never stored with losses."""
    text = file.compression or "zip"
    if file.level is not None:
        text += f":{file.level:g}"
    for spec, values in parts:
        exact = values.dtype.kind != "f" or spec.get_string_attribute(SOURCE) in CRYPTOMATTES
        if not (exact and file.compression in LOSSY):
            spec.attribute("compression", text)
        for name, value in file.header:
            _add(spec, name, value)


def _add(spec: object, name: str, value: HeaderValue) -> None:
    import OpenImageIO as oiio

    assert isinstance(spec, oiio.ImageSpec)
    if isinstance(value, tuple):
        is_whole = len(value) < 4 and all(
            isinstance(number, int) for number in value
        )  # OpenEXR has no vectors of four integers
        spec.attribute(name, oiio.TypeDesc(f"{'int' if is_whole else 'float'}[{len(value)}]"), value)
    else:
        spec.attribute(name, value)
