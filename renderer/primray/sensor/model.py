"""A sensor: from a rendered picture to the whole numbers that a camera writes, with the noise that light and electronics bring.

EMVA 1288 (release 4, Linear) names the quantities. A pixel's mean is mu_y = black + K (mu_e + mu_dark), its variance
K^2 (mu_e + mu_dark + read_noise^2) + 1/12, in digital numbers (DN); K is DN per electron.

Electrons come from the camera's exposure. A picture holds v = L t S / (100 N^2) for a luminance L (cd/m^2), exposure time t,
ISO speed S and f-number N (UsdGeomCamera's exposure attributes, without compensation). The focal plane gets
H = 0.65 L t / N^2 lux seconds (ISO 2720's constant with usual vignetting), and ISO 12232's saturation-based speed is 78 / H.
So the sensor is full at v = 0.78 / 0.65 = 1.2, whatever the speed; above the base speed it is full by fewer electrons.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..color.color_space import LUMINANCE_WEIGHTS, REC709, converted
from ..errors import SettingsError, did_you_mean
from ..images.image import Image
from .noise import Draws

MOSAICS = ("RGGB", "GRBG", "BGGR", "GBRG", "MONO")
SATURATED_AT = 78 / 65
SMALL_SHARE = 0.01  # of a pixel's variance: render noise below it is below 0.5 % of the standard deviation
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Whole = npt.NDArray[np.uint16]
Rows = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class SensorModel:
    """A sensor behind a colour filter array.

    `full_well`, `read_noise` (standard deviation) are in electrons, `dark_current` in electrons a second, `exposure_time` in
    seconds (for dark current alone), `black_level` in DN of `bits`. `iso` and `base_iso` decide the gain. `mosaic` names the
    upper left 2 x 2 pixels; MONO has no filters. `camera_from_rec709` turns linear Rec.709 into the filters' colours;
    `saturation` is the picture's value at which the sensor is full.

    >>> model = primray.SensorModel(full_well=20000, read_noise=3, bits=12, black_level=256)
    >>> raw = model.expose(primray.render("shot.usda", resolution=(32, 18), spp=16))
    >>> raw.values.shape, raw.values.dtype.name
    ((18, 32), 'uint16')
    >>> raw.save("shot.dng").name
    'shot.dng'

    SettingsError `sensor` for values that no sensor has.
    """

    full_well: float = 30000.0
    read_noise: float = 3.0
    dark_current: float = 0.0
    exposure_time: float = 0.0
    iso: float = 100.0
    base_iso: float = 100.0
    bits: int = 14
    black_level: int = 512
    mosaic: str = "RGGB"
    camera_from_rec709: Rows = IDENTITY
    saturation: float = SATURATED_AT
    seed: int = 0

    def __post_init__(self) -> None:
        def need(holds: bool, sentence: str, where: str) -> None:
            if not holds:
                raise SettingsError(sentence, where=where, code="sensor")

        for name in ("full_well", "iso", "base_iso", "saturation"):
            need(0 < getattr(self, name) < math.inf, f"{name} must be above 0, not {getattr(self, name)!r}", name)
        for name in ("read_noise", "dark_current", "exposure_time"):
            need(0 <= getattr(self, name) < math.inf, f"{name} must be 0 or more, not {getattr(self, name)!r}", name)
        need(self.bits in range(8, 17), f"bits must be 8 to 16, not {self.bits!r}", "bits")
        need(0 <= self.black_level < self.white_level, f"black_level must be below {self.white_level}", "black_level")
        need(self.mosaic in MOSAICS, f"mosaic must be one of {', '.join(MOSAICS)}, not {self.mosaic!r}", "mosaic")
        need(self.iso >= self.base_iso, "iso must be the base speed or more: a sensor holds no more than its well", "iso")
        need(0 <= self.seed < 1 << 64, "seed must be a whole number from 0 below 2^64", "seed")
        rows = np.asarray(self.camera_from_rec709, np.float64)
        need(
            rows.shape == (3, 3) and bool(np.isfinite(rows).all()),
            "camera_from_rec709 must be 3 rows of 3 numbers",
            "camera_from_rec709",
        )
        object.__setattr__(self, "camera_from_rec709", tuple(tuple(map(float, row)) for row in rows))

    @classmethod
    def read(cls, file: str | os.PathLike[str]) -> SensorModel:
        """Return the model in a JSON file of these fields; SettingsError `sensor` if it has others, or is not JSON."""
        name = os.fspath(file)
        try:
            values = json.loads(Path(name).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise SettingsError("there is no such file", where=name, code="sensor") from None
        except (OSError, ValueError) as error:
            raise SettingsError(f"the sensor cannot be read: {error}", where=name, code="sensor") from None
        return cls.of(values, name)

    @classmethod
    def of(cls, values: Mapping[str, Any], where: str = "") -> SensorModel:
        """Return the model with these fields."""
        known = {one.name: one for one in fields(cls)}
        if not isinstance(values, Mapping):
            raise SettingsError("a sensor is an object with fields such as full_well", where=where, code="sensor")
        for name, value in values.items():
            if name not in known:
                near = did_you_mean(str(name), known)
                raise SettingsError(
                    f"a sensor has no {name!r}; {near or 'it has ' + ', '.join(known)}", where=where, code="sensor"
                )
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            kinds: dict[str, Any] = {
                "bits": int,
                "black_level": int,
                "seed": int,
                "mosaic": str,
                "camera_from_rec709": (list, tuple),
            }
            if not (is_number if name not in kinds else isinstance(value, kinds[name]) and not isinstance(value, bool)):
                raise SettingsError(f"{name} cannot be {value!r}", where=where, code="sensor")
        return cls(**values)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    @property
    def white_level(self) -> int:
        """The largest number."""
        return (1 << self.bits) - 1

    @property
    def electrons_per_unit(self) -> float:
        """Electrons of a value of 1 in the picture."""
        return self.full_well * self.base_iso / self.iso / self.saturation

    @property
    def gain(self) -> float:
        """K, DN per electron: the picture's value `saturation` becomes the largest number."""
        return (self.white_level - self.black_level) / (self.electrons_per_unit * self.saturation)

    @property
    def dark(self) -> float:
        """Mean electrons of dark current."""
        return self.dark_current * self.exposure_time

    def error_of(self, electrons: float) -> float:
        """Return the RMSE of a picture whose error is this many electrons, for `target_error` with the metric "rmse"."""
        if not 0 < electrons < math.inf:
            raise SettingsError("an error in electrons must be above 0", where="electrons", code="sensor")
        return electrons / self.electrons_per_unit

    def electrons(self, image: Image) -> Doubles:
        """Return the mean electrons (H, W) that light frees below each pixel's filter; negative light is none."""
        return self._electrons_of(self._camera_values(image))

    def expose(self, image: Image, frame: int = 0) -> RawImage:
        """Return the picture as the sensor reads it. Each `frame` has its own noise, a function of seed, frame and pixel."""
        values = self._camera_values(image)
        mean = self._electrons_of(values)
        if not np.isfinite(mean).all():
            raise SettingsError("the picture has pixels that are not finite", where="image", code="sensor")
        draws = Draws(self.seed, frame)
        held = draws.poisson(mean + self.dark)
        if self.read_noise > 0:
            held = held + self.read_noise * draws.normal(held.size).reshape(held.shape)
        numbers = np.rint(np.minimum(held, self.full_well) * self.gain + self.black_level)
        read = np.clip(numbers, 0, self.white_level).astype(np.uint16)
        return RawImage(read, self, frame, self._render_share(image, mean), float((values < 0).any(axis=2).mean()))

    def variance(self, mean: Doubles) -> Doubles:
        """Return the variance in electrons of pixels with these mean electrons of light."""
        return mean + self.dark + self.read_noise**2

    def render_share(self, image: Image) -> float | None:
        """Return the render's own noise as a share of the sensor's variance, the mean over pixels; None without errors.

        Below 0.01 it changes standard deviations by less than 0.5 %.
        """
        return self._render_share(image, self.electrons(image))

    def _render_share(self, image: Image, mean: Doubles) -> float | None:
        if image.errors is None or not np.isfinite(image.errors).all():
            return None
        matrix = np.asarray(self.camera_from_rec709)
        errors = np.sqrt((image.errors.astype(np.float64) ** 2) @ (matrix.T**2))
        own = (self._behind_filters(errors) * self.electrons_per_unit) ** 2
        return float((own / np.maximum(self.variance(mean), 1e-300)).mean())

    def _electrons_of(self, camera_values: Doubles) -> Doubles:
        return self._behind_filters(np.maximum(camera_values, 0.0)) * self.electrons_per_unit

    def _camera_values(self, image: Image) -> Doubles:
        rgb = converted(image.pixels[..., :3], image.color_space, REC709)
        return np.asarray(rgb @ np.asarray(self.camera_from_rec709).T)

    def _behind_filters(self, values: Doubles) -> Doubles:
        """Return the channel (H, W) that each pixel's filter lets through."""
        if self.mosaic == "MONO":
            return np.asarray(values @ np.array(LUMINANCE_WEIGHTS))
        found = np.empty(values.shape[:2])
        for place, letter in enumerate(self.mosaic):
            rows, columns = slice(place // 2, None, 2), slice(place % 2, None, 2)
            found[rows, columns] = values[rows, columns, "RGB".index(letter)]
        return found


@dataclass(frozen=True, eq=False)
class RawImage:
    """`values` (H, W) in DN, read-only; `render_share` and `negative_share` say how far the picture was from ideal.

    `negative_share` is the share of pixels with a negative colour behind the filters, which is read as none.

    >>> grey = primray.Image(np.full((4, 6, 4), 0.5, np.float32))
    >>> raw = primray.SensorModel(mosaic="MONO").expose(grey)
    >>> bool(raw.values.min() > raw.model.black_level), raw.render_share
    (True, None)
    """

    values: Whole
    model: SensorModel
    frame: int = 0
    render_share: float | None = None
    negative_share: float = 0.0

    def __post_init__(self) -> None:
        self.values.flags.writeable = False

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a .dng, or the numbers alone as .png (16 bits), .tif or .npy; SettingsError for other names."""
        from ..images.output_path import check_folder
        from .files import WRITERS, write

        file = Path(path)
        if file.suffix.lower() not in WRITERS:
            sentence = f"a raw picture is written as {', '.join(WRITERS)}, not {file.suffix or 'without an ending'}"
            raise SettingsError(sentence, where=str(file), code="unknown-format")
        check_folder(file)
        return write(self, file)
