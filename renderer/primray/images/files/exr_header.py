"""EXR header attributes of a picture: windows, colours and camera matrices."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Doubles
from ...color.color_space import ColorSpace, named
from ...description import Camera, Frame, Projection

# SMPTE ST 2065-1 (AP0) and the ACEScg specification S-2014-004 (AP1), relative to the ACES white point.
_ACES_WHITE = (0.32168, 0.33767)
_ACES_CHROMATICITIES = {
    "lin_ap0_scene": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), _ACES_WHITE),
    "lin_ap1_scene": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), _ACES_WHITE),
}


def place_pixels(spec: Any, frame: Frame | None) -> None:
    """Set the data and display windows, and the pixel aspect ratio."""
    spec.attribute("PixelAspectRatio", 1.0 if frame is None else frame.pixel_aspect_ratio)
    if frame is not None:
        spec.x, spec.y = frame.pixels.x, frame.pixels.y
        spec.full_x = spec.full_y = 0
        spec.full_width, spec.full_height = frame.resolution


def describe_colors(spec: Any, space: ColorSpace) -> None:
    """Set the interop id, if the space has one, and the chromaticities.

    ACES spaces get those of their standards, as readers expect.
    """
    import OpenImageIO as oiio

    spec.attribute("oiio:ColorSpace", space.name)
    if named(space.name) == space:
        spec.attribute("colorInteropID", space.name)
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), chromaticities_of(space))


def chromaticities_of(space: ColorSpace) -> tuple[float, ...]:
    """Return x, y of red, green, blue and white, as stored in a file."""
    known = named(space.name) == space
    corners = _ACES_CHROMATICITIES.get(space.name, space.gamut) if known else space.gamut
    return tuple(float(x) for corner in corners for x in corner)


def exr_matrices(camera: Camera) -> tuple[Doubles, Doubles]:
    """Return worldToCamera and worldToNDC as OpenEXR's ImfStandardAttributes.h defines them, for column vectors.

    Its camera space is left-handed (objects in front have positive z); its NDC has (0, 0) upper left, (1, 1) lower right.
    """
    camera_from_world = np.diag([1.0, 1.0, -1.0, 1.0]) @ np.linalg.inv(camera.world_from_camera)
    left, right, bottom, top = camera.window
    near, far = camera.clipping_range
    depth = np.array([0.0, 0.0, far / (far - near), -far * near / (far - near)])
    x, y = np.array([1.0, 0, 0, 0]), np.array([0, 1.0, 0, 0])
    if camera.projection is Projection.PERSPECTIVE:
        w = np.array([0.0, 0.0, 1.0, 0.0])
    else:
        w = np.array([0.0, 0.0, 0.0, 1.0])
        depth = np.array([0.0, 0.0, 1.0, -near]) / (far - near)
    ndc_from_camera = np.stack([(x - left * w) / (right - left), (top * w - y) / (top - bottom), depth, w])
    return camera_from_world, ndc_from_camera @ camera_from_world


def row_vector_floats(matrix: Doubles) -> tuple[float, ...]:
    return tuple(float(v) for v in matrix.T.ravel())
