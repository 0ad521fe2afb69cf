"""Reader of an Image with errors and AOVs from the EXR that `Image.save` wrote."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Literal

import numpy as np

from ..color.color_space import REC709, ColorSpace, linear_spaces
from ..description.picture_file import PictureFile
from ..errors import SettingsError
from ..settings import Eye
from .aov import Aov
from .aov_parts import read_aovs, record_part
from .exposure import needs_alpha
from .files.exr_header import chromaticities_of
from .image import BACKGROUND, CHANNELS, LIT, Image
from .image_file import FLOATS
from .image_file import read_image as read_measured
from .opened_picture import open_picture
from .pictures_beside import DENOISED, DIFFUSED

SAME = 1e-4  # tolerance of chromaticities: files have floats, and some programs write few digits


def read_image(path: str | os.PathLike[str], eye: Eye | Literal["left", "right"] | None = None) -> Image:
    """Return the image in a scene-linear file, or one `eye` of a stereo pair.

    It has pixels (H, W, 4), errors, AOVs, frame, colour space, and the header as `metadata`.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=4, aovs=["depth"])
    >>> image.save("shot.exr").name
    'shot.exr'
    >>> again = primray.read_image("shot.exr")
    >>> bool((again.pixels == image.pixels).all()), bool((again.errors == image.errors).all()), list(again.aovs)
    (True, True, ['depth'])

    The report and the camera are not in a file. Without an alpha channel a picture is opaque; colours of a file that names no
    colour space are assumed to be Rec.709. SettingsError for a file that is missing, damaged, or has display values (a PNG).
    """
    name = os.fspath(path)
    _check_linear(name)
    part = _record_part(name, None if eye is None else Eye(eye))
    found = read_measured(name, part)
    alpha = np.ones(found.pixels.shape[:2], np.float32) if found.alpha is None else found.alpha
    parts = read_aovs(name, part)
    pixels = np.concatenate([found.pixels, alpha[..., None]], axis=2)
    metadata = dict(found.metadata)
    said = metadata.pop(BACKGROUND.removeprefix("primray:"), None)
    image = Image(
        pixels,
        file=PictureFile(lit_behind=said == LIT if said is not None else not needs_alpha(np.nan_to_num(pixels))),
        metadata=metadata,
        errors=found.stderr,
        color_space=space_of(found.chromaticities),
        frame=found.frame,
        aovs={key: aov for key, aov in parts.items() if aov.source not in (DENOISED, DIFFUSED)},
    )
    made = {aov.source: _picture_of(aov, image) for aov in parts.values() if aov.source in (DENOISED, DIFFUSED)}
    return replace(image, denoised=made.get(DENOISED), diffused=made.get(DIFFUSED))


def _picture_of(part: Aov, record: Image) -> Image:
    values = part.values
    if len(part.channels) == 3:  # the product orders no alpha
        values = np.concatenate([values, record.pixels[..., 3:]], axis=2)
    pixels, errors = np.split(values, [len(CHANNELS)], axis=2)
    told = errors if errors.shape[2] else None
    return Image(pixels, errors=told, color_space=record.color_space, frame=record.frame, file=record.file.beside())


def _record_part(name: str, eye: Eye | None) -> int:
    file = open_picture(name)
    try:
        part = record_part(file, "" if eye is None else eye.value)
    finally:
        file.close()
    if part is None and eye is not None:
        raise SettingsError(f"the picture has no view {eye.value}", where=name, code="stereo-view")
    return part or 0


def _check_linear(name: str) -> None:
    file = open_picture(name)
    try:
        floats = str(file.spec().format) in FLOATS
    finally:
        file.close()
    if not floats:
        sentence = "it has display values in whole numbers, which are no scene-linear picture; the EXR of the render has it"
        raise SettingsError(sentence, where=name, code="image-display")


def space_of(chromaticities: tuple[float, ...] | None) -> ColorSpace:
    if chromaticities is None:
        return REC709
    for space in linear_spaces():
        if np.allclose(chromaticities, chromaticities_of(space), atol=SAME):
            return space
    x = chromaticities
    return ColorSpace("from_chromaticities", (x[0], x[1]), (x[2], x[3]), (x[4], x[5]), (x[6], x[7]))
