"""Reading of pictures written by `Image.save`: as an `Image` with errors and AOVs, or as a `MeasuredImage` for comparisons."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ..arrays import Floats
from ..color.color_space import REC709, ColorSpace, linear_spaces
from ..description import Frame, PixelWindow
from ..description.picture_file import PictureFile
from ..errors import SettingsError
from ..settings import Eye
from ..textures.image_errors import fault_of_pixels, last_error
from .aov import Aov
from .exposure import needs_alpha
from .exr_parts import DENOISED, DIFFUSED, open_picture, read_aovs, record_part
from .image import BACKGROUND, CHANNELS, LIT, Image
from .writers import chromaticities_of

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
        sentence = "it has integer display values, not scene-linear ones; read the EXR of the render instead"
        raise SettingsError(sentence, where=name, code="image-display")


def space_of(chromaticities: tuple[float, ...] | None) -> ColorSpace:
    if chromaticities is None:
        return REC709
    for space in linear_spaces():
        if np.allclose(chromaticities, chromaticities_of(space), atol=SAME):
            return space
    x = chromaticities
    return ColorSpace("from_chromaticities", (x[0], x[1]), (x[2], x[3]), (x[4], x[5]), (x[6], x[7]))


COLORS = ("R", "G", "B")
ERROR_CHANNELS = tuple(f"stderr.{name}" for name in COLORS)
HEADER_PREFIX = "primray:"
FLOATS = ("half", "float", "double")


@dataclass(frozen=True, eq=False)
class MeasuredImage:
    """A picture with the standard error of each pixel's mean, from two replicates: |a - b| / 2, one degree of freedom."""

    pixels: Floats  # (H, W, 3), scene-linear R, G, B
    alpha: Floats | None  # (H, W)
    stderr: Floats | None  # (H, W, 3); +inf: no estimate. None: the picture is assumed exact
    metadata: Mapping[str, Any] = field(default_factory=dict)  # header attributes primray:<name>, by name
    name: str = ""
    chromaticities: tuple[float, ...] | None = None  # x, y of red, green, blue and white; None: the file does not say
    frame: Frame | None = None  # position of the pixels in the frame; None: they are the whole frame
    stored: str = "float"  # OpenImageIO's name of the data type in the file

    @property
    def is_display(self) -> bool:
        """Whether the values are display values: integers, as in PNG and JPEG."""
        return self.stored not in FLOATS

    @property
    def resolution(self) -> tuple[int, int]:
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def samples(self) -> float | None:
        """Samples per pixel, the mean if pixels differ; None if the header does not say."""
        span = self.sample_span
        if span is None:
            return None
        total = _number(self.metadata.get("samples"))
        return total / (self.resolution[0] * self.resolution[1]) if total and span[0] != span[1] else sum(span) / 2

    @property
    def sample_span(self) -> tuple[float, float] | None:
        """The fewest and the most samples of a pixel, or None if the header does not say."""
        numbers = [_number(word) for word in str(self.metadata.get("samples_per_pixel", "")).split()]
        if len(numbers) != 2 or numbers[0] is None or numbers[1] is None or not 0 < numbers[0] <= numbers[1]:
            return None
        return numbers[0], numbers[1]


def same_color_space(a: MeasuredImage, b: MeasuredImage) -> bool:
    """Return whether two pictures may share a colour space; one without chromaticities may be in any."""
    if a.chromaticities is None or b.chromaticities is None:
        return True
    return bool(np.allclose(a.chromaticities, b.chromaticities, atol=1e-4))


def _number(value: object) -> float | None:
    try:
        number = float(str(value))
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def read_measured(path: str | os.PathLike[str], part: int | None = None) -> MeasuredImage:
    """Return the picture at `path`, from its first part that is neither denoised nor diffused, or from `part`.

    SettingsError if it cannot be read, or if its channels do not match.
    """
    import OpenImageIO as oiio

    name = os.fspath(path)
    file = open_picture(name)
    try:
        part = record_part(file) or 0 if part is None else part
        file.seek_subimage(part, 0)
        spec = file.spec()
        channels = tuple(spec.channelnames)
        missing = [channel for channel in COLORS if channel not in channels]
        if spec.deep or missing:
            why = "is deep" if spec.deep else f"has no channel {', '.join(missing)}; it has {', '.join(channels)}"
            raise SettingsError(f"the picture {why}", where=name, code="image-channels")
        values = file.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
        fault = last_error(file) if values is None else fault_of_pixels(file, name)
        if fault or values is None:
            raise SettingsError(f"the picture is damaged: {fault}", where=name, code="image-unreadable")
        values = np.asarray(values).reshape(spec.height, spec.width, spec.nchannels)
        metadata = {
            attribute.name.removeprefix(HEADER_PREFIX): attribute.value
            for attribute in spec.extra_attribs
            if attribute.name.startswith(HEADER_PREFIX)
        }
        stored = str(spec.channelformat(channels.index("R")))
        said = spec.getattribute("chromaticities")
        primaries = tuple(map(float, said)) if said is not None and len(said) == 8 else None
    finally:
        file.close()
    if str(spec.getattribute("compression") or "").startswith("dwa"):  # DWA compression rings around 0
        errors = [channels.index(channel) for channel in ERROR_CHANNELS if channel in channels]
        values[..., errors] = np.maximum(values[..., errors], 0)
    return replace(_measured(values, channels, metadata, name), frame=_frame(spec), chromaticities=primaries, stored=stored)


def _frame(spec: Any) -> Frame:
    """Return the frame of the file. Unlike in files written by primray, the display window's corner may be anywhere."""
    pixels = PixelWindow(spec.x - spec.full_x, spec.y - spec.full_y, spec.width, spec.height)
    return Frame((spec.full_width, spec.full_height), pixels, spec.get_float_attribute("PixelAspectRatio", 1.0))


def _measured(values: np.ndarray[Any, Any], channels: tuple[str, ...], metadata: Mapping[str, Any], name: str) -> MeasuredImage:
    def take(names: tuple[str, ...]) -> Floats:
        return np.ascontiguousarray(values[..., [channels.index(channel) for channel in names]], np.float32)

    present = [channel for channel in ERROR_CHANNELS if channel in channels]
    if present and len(present) < len(ERROR_CHANNELS):
        sentence = f"of the error channels it has only {', '.join(present)}"
        raise SettingsError(sentence, where=name, code="image-channels")
    stderr = take(ERROR_CHANNELS) if present else None
    if stderr is not None and not (stderr >= 0).all():
        raise SettingsError("its error channels hold negative values or NaN", where=name, code="image-channels")
    alpha = take(("A",))[..., 0] if "A" in channels else None
    return MeasuredImage(take(COLORS), alpha, stderr, metadata, name)
