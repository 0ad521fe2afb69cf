"""Cameras given in the settings without a prim: a `Camera`, or a matrix with UsdGeomCamera's default lens."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...camera_choice import Matrix
from ...description import Camera, Projection
from ..adapters.cameras.camera import Aperture, conform, window_of
from ..adapters.cameras.shutter import INSTANT, Shutter
from ..adapters.rendering.render_product import ProductSettings
from .framing import APERTURE, FOCAL_LENGTH

CLIPS_NOTHING = (0.0, 3e38)
SAME = 1e-12  # relative: aspect ratios that differ in rounding only


def aperture_of(asked: Camera | Matrix) -> Aperture:
    """Return the aperture of a given camera, in units of its window."""
    if isinstance(asked, tuple):
        return APERTURE
    left, right, bottom, top = asked.window
    return Aperture(right - left, top - bottom, (left + right) / 2, (bottom + top) / 2)


def conformed(
    asked: Camera | Matrix, aperture: Aperture, resolution: tuple[int, int], product: ProductSettings, shutter: Shutter
) -> Camera:
    """Return the given camera with its window conformed to the image; a window of that aspect keeps its bits.

    It has no path, so nothing on the stage moves it. A product without depth of field makes it a pinhole, like the stage's
    cameras.
    """
    fitted = conform(aperture, resolution, product)
    if isinstance(asked, tuple):
        window = window_of(fitted, 1.0 / FOCAL_LENGTH)
        return with_shutter(Camera("", np.array(asked), Projection.PERSPECTIVE, window, CLIPS_NOTHING), shutter)
    if not math.isclose(fitted.aspect, aperture.aspect, rel_tol=SAME):
        asked = replace(asked, window=window_of(fitted, 1.0))
    if product.disable_depth_of_field:
        asked = replace(asked, lens_radius=0.0)
    return with_shutter(replace(asked, path=""), shutter)


def with_shutter(camera: Camera, shutter: Shutter) -> Camera:
    """Return the camera with this shutter; a shutter of None (closes before it opens) makes the image black."""
    if shutter is None:
        return replace(camera, shutter=INSTANT, exposure_scale=0.0)
    return replace(camera, shutter=shutter)
