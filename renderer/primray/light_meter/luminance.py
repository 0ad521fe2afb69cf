"""False-colour pictures of luminance as cameras see it, in cd/m2, for the page of readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import usd
from ..arrays import Doubles
from ..color.color_space import luminance_weights
from ..errors import SettingsError
from ..images.image import Image
from ..render.prepare import OpenedStage, open_once
from ..settings import RenderSettings
from .meters import CODE
from .pictures import picture_of_light, settings_of_light

WIDTH = 640  # pixels
SAMPLES = 64
DECADES = 4.0  # below the brightest that is shown
BRIGHTEST = 0.999  # share of pixels that are not brighter than the scale: highlights would darken the rest
ALL = "all"


@dataclass(frozen=True, eq=False)
class LuminancePicture:
    """Luminance (H, W) in cd/m2 as a camera sees it, with its standard errors."""

    camera: str
    luminance: Doubles
    errors: Doubles

    @property
    def mean(self) -> tuple[float, float, float]:
        """The mean luminance with its 95 % interval; errors of pixels are independent."""
        value, half = float(self.luminance.mean()), 1.959964 * math.sqrt(float((self.errors**2).sum())) / self.errors.size
        return value, value - half, value + half

    @property
    def scale(self) -> tuple[float, float]:
        """The ends of the legend: whole decades and halves of them, up to what one pixel in a thousand exceeds."""
        lit = self.luminance[self.luminance > 0]
        if lit.size == 0:
            return 0.1, 1.0
        most = 10 ** (math.ceil(2 * math.log10(float(np.quantile(lit, BRIGHTEST)))) / 2)
        least = float(np.quantile(lit, 1 - BRIGHTEST))
        return max(10 ** (math.floor(2 * math.log10(least)) / 2), most / 10**DECADES), most


def luminance_pictures(
    stage: OpenedStage | Any,
    cameras: Sequence[str],
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
) -> list[LuminancePicture]:
    """Return pictures of cameras, by path; "all": of all that the stage has, or of the automatic one where it has none.

    The width is 640 pixels where the settings have no resolution, `spp` by default 64. An exposure of the camera has no effect.
    """
    opened = stage if isinstance(stage, OpenedStage) else open_once(stage, settings)
    known = usd.camera_paths(opened.stage)
    named: list[str | None] = []
    for camera in cameras:
        if camera != ALL and camera not in known:
            has = f"the stage has {', '.join(known)}" if known else "the stage has none"
            raise SettingsError(f"there is no camera {camera}; {has}", where=camera, code=CODE)
        named += (known or [None]) if camera == ALL else [camera]
    asked = replace(
        settings_of_light(settings),
        resolution=settings.resolution or (WIDTH, 0),
        spp=SAMPLES if settings.spp is None else settings.spp,
    )
    return [_of(picture_of_light(opened, replace(asked, camera=camera))) for camera in dict.fromkeys(named)]


def _of(image: Image) -> LuminancePicture:
    weights = np.array(luminance_weights(image.color_space))
    luminance = np.maximum(np.asarray(image.pixels[..., :3], np.float64) @ weights, 0.0)
    # R, G and B share their noise, so their errors add.
    assert image.errors is not None
    errors = np.asarray(image.errors, np.float64) @ weights
    camera = "" if image.camera is None else image.camera.path
    return LuminancePicture(camera or "the automatic camera", luminance, errors)
