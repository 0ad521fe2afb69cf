"""Shape of a light under its transform: axes, projected area, and a key that rotations do not change."""

from __future__ import annotations

import math
from typing import assert_never

import numpy as np

from ..arrays import Doubles
from ..description.lighting import Light, LightType

Sizes = tuple[float, float, float, float]  # width, height, radius, length


def shape_key(light: Light) -> tuple[bytes, Sizes]:
    """Return the light's stretch (3, 3) as bytes, and its sizes; instances that are only rotated or moved have the same."""
    linear = light.world_from_light[:3, :3]
    _, stretch, own = np.linalg.svd(linear)
    straight = own.T @ (stretch[:, None] * own)  # the symmetric factor of a polar decomposition
    largest = float(np.abs(straight).max())
    digits = 12 - math.floor(math.log10(largest)) if 0 < largest < math.inf else 0
    return np.ascontiguousarray(np.round(straight, digits)).tobytes(), (light.width, light.height, light.radius, light.length)


def whole_axes(linear: Doubles) -> Doubles:
    """Return the axes (3, 3), with a unit normal for the third axis if a flat light's transform leaves it no depth."""
    if np.linalg.det(linear) != 0:
        return linear
    normal = np.cross(linear[:, 0], linear[:, 1])
    length = float(np.linalg.norm(normal))
    return np.column_stack([linear[:, :2], normal / length]) if length > 0 else np.eye(3)


def facing(axes: Doubles) -> Doubles:
    """Return the area vector (3,) of a unit square in the light's plane, on the side of its -Z."""
    area: Doubles = np.cross(axes[:, 0], axes[:, 1])
    return -area if area @ axes[:, 2] > 0 else area


def shown_area(kind: LightType, axes: Doubles, sizes: Sizes, directions: Doubles) -> Doubles:
    """Return the projected area (N,) of the emitting surface along unit directions (N, 3); 1 for a point."""
    width, height, radius, length = sizes
    match kind:
        case LightType.POINT:
            return np.ones(len(directions))
        case LightType.LINE:
            sine: Doubles = np.linalg.norm(np.cross(directions, axes[:, 0]), axis=1)
            return sine * length
        case LightType.RECT:
            return width * height * np.maximum(directions @ facing(axes), 0.0)
        case LightType.DISK:
            return math.pi * radius**2 * np.maximum(directions @ facing(axes), 0.0)
        case LightType.SPHERE:
            ellipse: Doubles = math.pi * radius**2 * np.linalg.norm(_seen_area(axes, directions), axis=1)
            return ellipse
        case LightType.CYLINDER:
            seen = _seen_area(axes, directions)
            outline: Doubles = 2 * radius * length * np.hypot(seen[:, 1], seen[:, 2])
            return outline
        case LightType.DISTANT | LightType.DOME | LightType.GEOMETRY:
            raise ValueError(f"a {kind.value} light has no surface of its own")
        case _:
            assert_never(kind)


def _seen_area(axes: Doubles, directions: Doubles) -> Doubles:
    """Return area vectors (N, 3) in the light's frame that project to unit area along each direction in the world."""
    x, y, z = axes.T
    cofactors = np.column_stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])  # carry area vectors to the world
    seen: Doubles = directions @ cofactors
    return seen
