"""The camera with which usdrecord frames a stage without cameras (UsdAppUtilsFrameRecorder), and bounds of the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...arrays import Doubles
from ...description import Camera, Placed, Placement, Projection, Prototype, Shape
from ...description.placement import placed_box
from ..adapters.cameras.camera import Aperture, conform, window_of
from ..adapters.rendering.render_product import ProductSettings
from ..resolving.stage_bounds import Bounds

# GfCamera's defaults: 50 mm, 35 mm projector aperture.
FOCAL_LENGTH = 50.0
APERTURE = Aperture(20.955, 15.2908)


MANY = 1_000_000  # up to this many instances, the corners of each are bounded


def framing_camera(bounds: Bounds, z_up: bool, resolution: tuple[int, int], product: ProductSettings) -> Camera:
    """Return a camera that looks at the centre of the bounds, far enough away for them to fit; nothing is clipped."""
    center, size = bounds
    up, depth = (2, 1) if z_up else (1, 2)
    radius = math.hypot(size[0], size[up]) / 2
    tan_half = APERTURE.width / (2 * FOCAL_LENGTH)
    distance = radius / tan_half + size[depth] / 2
    if distance < 1:  # GfCamera's near plane
        distance += 1
    world_from_camera = np.eye(4)
    if z_up:  # looks along +Y with +Z up
        world_from_camera[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    world_from_camera[:3, 3] = center
    world_from_camera[depth, 3] += -distance if z_up else distance
    aperture = conform(APERTURE, resolution, product)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window_of(aperture, 1 / FOCAL_LENGTH), (0.0, 3e38))


def shape_bounds(
    shapes: Sequence[Shape], static: Sequence[Placed], prototypes: Sequence[Prototype], placements: Sequence[Placement]
) -> Bounds:
    """Return centre and size of the translated scene, by the corners of shapes' boxes; a unit box if it is empty."""
    corners = [corners_of(shapes[p.shape]) @ p.matrix[:3, :3].T + p.matrix[:3, 3] for p in static]
    for placement in placements:
        if prototypes[placement.prototype].placements or len(placement) > MANY:
            corners.append(np.array(placed_box(placement.levels, prototype_box(shapes, prototypes, placement.prototype))))
            continue
        for p in prototypes[placement.prototype].shapes:
            local = corners_of(shapes[p.shape]) @ p.matrix[:3, :3].T + p.matrix[:3, 3]
            for world in placement.chunks():
                at = (local @ world[:, :, :3].transpose(0, 2, 1) + world[:, None, :, 3]).reshape(-1, 3)
                corners.append(np.array([at.min(axis=0), at.max(axis=0)]))
    if not corners:
        return np.zeros(3), np.ones(3)
    low = np.min([c.min(axis=0) for c in corners], axis=0)
    high = np.max([c.max(axis=0) for c in corners], axis=0)
    return (low + high) / 2, high - low


def prototype_box(shapes: Sequence[Shape], prototypes: Sequence[Prototype], number: int) -> Bounds:
    """Return the low and high corner of a prototype in its own space."""
    p = prototypes[number]
    boxes = [placed_box(inner.levels, prototype_box(shapes, prototypes, inner.prototype)) for inner in p.placements]
    for placed in p.shapes:
        at = corners_of(shapes[placed.shape]) @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
        boxes.append((at.min(axis=0), at.max(axis=0)))
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def corners_of(shape: Shape) -> Doubles:
    """Return the corners (8, 3) of a shape's box."""
    low, high = shape.box()
    pick = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)], bool)
    return np.where(pick, high, low)
