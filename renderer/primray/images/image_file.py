"""Reader of EXRs written by `Image.save`: the picture, the standard error of every pixel, and the header."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Floats
from ..description import Frame, PixelWindow
from ..errors import SettingsError
from ..textures.image_errors import fault_of_pixels, last_error
from .aov_parts import record_part
from .opened_picture import open_picture

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


def read_image(path: str | os.PathLike[str], part: int | None = None) -> MeasuredImage:
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
