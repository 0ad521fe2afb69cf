"""Parts of a multi-part EXR: AOVs and derived pictures, written after the picture in the first part and read back."""

from __future__ import annotations

import json
import os
from collections.abc import Container, Mapping
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..aovs import Stored, light_path_of
from ..errors import SettingsError
from ..textures.image_errors import last_error
from .aov import DIFFERENCE, STDERR, Aov, Values

if TYPE_CHECKING:
    import OpenImageIO as oiio


PICTURE_PART = "rgba"
MADE_OF_PICTURE = ("denoised", "diffused")  # sources of parts that are derived from the picture and are not AOVs
VIEW = "view"  # header attribute of a stereo pair's parts
# Limits of a part's table of ids, in entries and in characters; the rest is only counted.
MOST_IDS, MOST_TEXT = 1 << 16, 1 << 22
CRYPTOMATTE = "cryptomatte/"
COLORS = ("albedo", "emission", "guide_albedo")  # colour AOVs, besides light path expressions
LIGHTS_OF_PART = "primray:lights"  # of a part that holds the light of some lights: their prims, as a JSON list
IDS, SOURCE, MEANING, SAMPLES = "primray:ids", "primray:source", "primray:meaning", "primray:aov_samples"


Parts = list[tuple[Any, Values]]  # an OIIO ImageSpec and the values of each


def parts_of(picture: Any, aovs: Mapping[str, Aov]) -> Parts:
    """Return an OIIO ImageSpec and values for each AOV.

    `picture` is the spec of the first part, whose windows the others share; it is given a part name.
    """
    import OpenImageIO as oiio

    if not aovs:
        return []
    types = {"float": oiio.FLOAT, "half": oiio.HALF, "uint": oiio.UINT32}
    found: Parts = []
    for name, aov in aovs.items():
        part = oiio.ImageSpec(picture)
        channels, values = aov.channels, np.asarray(aov.values, np.uint32 if aov.stored == "uint" else np.float32)
        if aov.errors is not None:
            channels, values = (*channels, *aov.error_channels), np.concatenate([values, aov.errors], axis=2)
        if aov.differences is not None:
            channels, values = (*channels, *aov.difference_channels), np.concatenate([values, aov.differences], axis=2)
        part.nchannels, part.channelnames, part.channelformats = len(channels), channels, ()
        part.set_format(types[aov.stored])
        part.alpha_channel = part.z_channel = -1
        for attribute in [a.name for a in picture.extra_attribs if a.name.startswith("primray:")]:
            part.erase_attribute(attribute)
        part.attribute("oiio:subimagename", name)
        part.attribute(SOURCE, aov.source)
        part.attribute(MEANING, aov.meaning)
        if aov.ids:
            part.attribute(IDS, ids_text(aov.ids))
        if aov.samples is not None:
            part.attribute(SAMPLES, aov.samples)
        for key, value in aov.metadata.items():
            part.attribute(key, value)
        if aov.source not in COLORS and light_path_of(aov.source) is None:
            part.attribute("oiio:ColorSpace", "data")
            part.attribute("colorInteropID", "data")
            part.erase_attribute("chromaticities")
        found.append((part, values))
    picture.attribute("oiio:subimagename", PICTURE_PART)
    return found


def ids_text(ids: Mapping[int, str]) -> str:
    """Return ids as JSON, {"1": "/World/a"}; the entry "" counts those beyond the limits."""
    kept: dict[str, str] = {}
    size = 0
    for number, path in ids.items():
        size += len(path) + 16
        if len(kept) == MOST_IDS or size > MOST_TEXT:
            kept[""] = f"and {len(ids) - len(kept)} more"
            break
        kept[str(number)] = path
    return json.dumps(kept, ensure_ascii=False)


def record_part(file: oiio.ImageInput, view: str = "") -> int | None:
    """Return the number of the part with the rendered picture, or None.

    `view` selects one view of a stereo pair. The file of a product without colour outputs has no such part.
    """
    for number in count():
        if not file.seek_subimage(number, 0):
            return None
        spec = file.spec(number)
        if not spec.get_string_attribute(SOURCE) and view in ("", spec.get_string_attribute(VIEW)):
            return number
    raise AssertionError


def read_aovs(path: str | os.PathLike[str], picture: int | None = None) -> dict[str, Aov]:
    """Return the AOVs of an EXR written by `Image.save`, by name, for the view of part `picture` (None: of the record).

    SettingsError if there is no such file, or it is damaged.
    """
    import OpenImageIO as oiio

    name = os.fspath(path)
    file = open_picture(name)
    found: dict[str, Aov] = {}
    try:
        picture = record_part(file) if picture is None else picture
        file.seek_subimage(picture or 0, 0)
        view = file.spec(picture or 0).get_string_attribute(VIEW)
        for number in count():
            if not file.seek_subimage(number, 0):
                break
            spec = file.spec(number)
            if number == picture or spec.get_string_attribute(VIEW) != view:
                continue
            values = file.read_image(number, 0, 0, spec.nchannels, oiio.UNKNOWN)
            if values is None:
                raise SettingsError(f"the picture is damaged: {last_error(file)}", where=name, code="image-unreadable")
            values = np.asarray(values).reshape(spec.height, spec.width, spec.nchannels)
            name_of_part = spec.get_string_attribute("oiio:subimagename", str(number))
            found[name_of_part.removesuffix(f".{view}") if view else name_of_part] = _aov(spec, values)
    finally:
        file.close()
    return found


def _aov(spec: Any, values: Values) -> Aov:
    kinds: dict[str, Stored] = {"uint32": "uint", "float16": "half"}
    stored = kinds.get(values.dtype.name, "float")
    text = spec.get_string_attribute(IDS)
    ids = {int(number): path for number, path in json.loads(text).items() if number} if text else {}
    values = values if stored == "uint" else values.astype(np.float32)
    source, meaning = spec.get_string_attribute(SOURCE), spec.get_string_attribute(MEANING)
    own = {a.name: str(a.value) for a in spec.extra_attribs if a.name.startswith(CRYPTOMATTE) or a.name == LIGHTS_OF_PART}
    channels = tuple(spec.channelnames)
    samples = spec.get_int_attribute(SAMPLES) or None
    held: dict[str, Values] = {}
    if source not in MADE_OF_PICTURE:
        layers = [next((layer for layer in (DIFFERENCE, STDERR) if layer in channel.split(".")), "") for channel in channels]
        own_channels = layers.count("")
        for layer in (DIFFERENCE, STDERR):
            if 0 < layers.count(layer) <= own_channels:
                held[layer] = values[..., [number for number, each in enumerate(layers) if each == layer]]
        left = [number for number, each in enumerate(layers) if each not in held]
        channels, values = tuple(channels[number] for number in left), values[..., left]
    return Aov(
        values=values,
        channels=channels,
        source=source,
        meaning=meaning,
        stored=stored,
        ids=ids,
        metadata=own,
        errors=held.get(STDERR),
        samples=samples,
        differences=held.get(DIFFERENCE),
    )


def open_picture(name: str) -> oiio.ImageInput:
    """Open a picture file; SettingsError if there is no such file, or it is not a picture."""
    import OpenImageIO as oiio

    if not Path(name).is_file():
        raise SettingsError("there is no such picture", where=name, code="image-missing")
    file = oiio.ImageInput.open(name)
    if file is None:
        raise SettingsError(f"the picture cannot be read: {last_error(oiio)}", where=name, code="image-unreadable")
    return file


DIFFUSED, DENOISED = "diffused", "denoised"
SAYS = {
    DIFFUSED: "the picture with lens diffusion; errors of neighbouring pixels are not independent",
    DENOISED: "the denoised picture: biased, for viewing; its error is in the header and the report",
}


def picture_beside(
    name: str, picture: Any, values: Values, metadata: Mapping[str, str | int | float], taken: Container[str]
) -> tuple[Any, Values]:
    """Return an OIIO ImageSpec and values with channels "diffused.R" to "diffused.stderr.B", as many as there are.

    `picture` is the spec of the record, which is given a part name.
    """
    import OpenImageIO as oiio

    part = oiio.ImageSpec(picture)
    part.nchannels = values.shape[2]
    part.channelnames = tuple(f"{name}.{channel}" for channel in picture.channelnames[: values.shape[2]])
    for attribute in [a.name for a in picture.extra_attribs if a.name.startswith("primray:")]:
        part.erase_attribute(attribute)
    part.attribute("oiio:subimagename", name if name not in taken else f"primray.{name}")
    part.attribute(SOURCE, name)
    part.attribute(MEANING, SAYS[name])
    for key, value in metadata.items():
        part.attribute(f"primray:{key}", value)
    picture.attribute("oiio:subimagename", PICTURE_PART)
    return part, values
