"""A camera that no prim of the stage is: a `Camera`, or a matrix through UsdGeomCamera's default lens."""

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
    """Of a Camera in units of its window."""
    if isinstance(asked, tuple):
        return APERTURE
    left, right, bottom, top = asked.window
    return Aperture(right - left, top - bottom, (left + right) / 2, (bottom + top) / 2)


def conformed(
    asked: Camera | Matrix, aperture: Aperture, resolution: tuple[int, int], product: ProductSettings, shutter: Shutter
) -> Camera:
    """Its window adapted to the image; one that fits keeps its bits. It has no path: what moves on the stage does not move it.

    Depth of field is left out where the product says so, as of the stage's own cameras.
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
    """Black, where that closes before it opens."""
    if shutter is None:
        return replace(camera, shutter=INSTANT, exposure_scale=0.0)
    return replace(camera, shutter=shutter)
