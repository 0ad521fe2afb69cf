"""The parts of an EXR as a stage's render product orders them: selection, compression and header attributes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...aov_names import CRYPTOMATTES
from ...description.picture_file import LOSSY, Contents, HeaderValue, PictureFile
from .encoding import Part

SOURCE = "primray:source"  # header attribute of an AOV's part
DENOISED, DIFFUSED = "denoised", "diffused"
COLORS = ("R", "G", "B", "A")


def as_ordered(parts: Sequence[Part], contents: Contents) -> list[Part]:
    """Return the parts that a product orders, or all if none are.

    The picture comes first, preceded by the denoised one, since viewers open the first part.
    """
    (picture, values), *beside = parts
    made = {spec.get_string_attribute(SOURCE): (spec, own) for spec, own in beside}
    outputs = [(spec, own) for spec, own in beside if spec.get_string_attribute(SOURCE) not in (DENOISED, DIFFUSED)]
    wanted = [name for name in picture.channelnames if name.partition(".")[0] in contents.picture]
    found = list[Part]()
    if any(name in COLORS for name in wanted):
        if DENOISED in made:
            found.append(_denoised_first(*made[DENOISED], wanted))
        found.append(_with_channels(picture, values, wanted))
    elif wanted:
        found.append(_with_channels(picture, values, wanted))
    found += outputs
    if DIFFUSED in made and any(name in COLORS for name in wanted):
        found.append(made[DIFFUSED])
    if not found:
        return list(parts)
    if not wanted:
        _copy_header(picture, [spec for spec, _ in found])
    return found


def _denoised_first(spec: Any, values: npt.NDArray[Any], wanted: Sequence[str]) -> Part:
    """Return the denoised part with the channel names of a picture."""
    spec, values = _with_channels(spec, values, [f"{DENOISED}.{name}" for name in wanted if name in COLORS])
    spec.channelnames = tuple(name.removeprefix(f"{DENOISED}.") for name in spec.channelnames)
    return spec, values


def _with_channels(spec: Any, values: npt.NDArray[Any], names: Sequence[str]) -> Part:
    import OpenImageIO as oiio

    numbers = [spec.channelnames.index(name) for name in names if name in spec.channelnames]
    made = oiio.ImageSpec(spec)
    made.nchannels, made.channelnames, made.channelformats = len(numbers), tuple(spec.channelnames[n] for n in numbers), ()
    made.alpha_channel = made.channelnames.index("A") if "A" in made.channelnames else -1
    return made, np.ascontiguousarray(values[..., numbers])


def _copy_header(picture: Any, specs: Sequence[Any]) -> None:
    """Copy the render's header entries from the picture's part to the first of `specs`.

    Chromaticities are copied too if another part has them, since OpenEXR then requires them in the first part.
    """
    first, own = specs[0], {attribute.name for attribute in specs[0].extra_attribs}
    is_colored = any(spec.getattribute("chromaticities") is not None for spec in specs)
    for attribute in picture.extra_attribs:
        is_wanted = attribute.name.startswith("primray:") or (is_colored and attribute.name == "chromaticities")
        if is_wanted and attribute.name not in own:
            first.attribute(attribute.name, attribute.type, attribute.value)


def store_as_product(parts: Sequence[Part], file: PictureFile) -> None:
    """Set compression and header attributes in the specs.

    Ids (Cryptomatte and integers) are never stored with lossy compression.
    """
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
