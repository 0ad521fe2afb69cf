"""Shape of a light under its transform: axes, projected area, surface area, and a key that rotations do not change.

Surface areas are exact up to rounding under any affine transform; UsdLux's `normalize` divides by them.
"""

from __future__ import annotations

import math
from functools import lru_cache
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


def axes_with_depth(linear: Doubles) -> Doubles:
    """Return the axes (3, 3), with a unit normal for the third axis if a flat light's transform leaves it no depth."""
    if np.linalg.det(linear) != 0:
        return linear
    normal = np.cross(linear[:, 0], linear[:, 1])
    length = float(np.linalg.norm(normal))
    return np.column_stack([linear[:, :2], normal / length]) if length > 0 else np.eye(3)


def area_vector(axes: Doubles) -> Doubles:
    """Return the area vector (3,) of a unit square in the light's plane, on the side of its -Z."""
    area: Doubles = np.cross(axes[:, 0], axes[:, 1])
    return -area if area @ axes[:, 2] > 0 else area


def projected_area(kind: LightType, axes: Doubles, sizes: Sizes, directions: Doubles) -> Doubles:
    """Return the projected area (N,) of the emitting surface along unit directions (N, 3); 1 for a point."""
    width, height, radius, length = sizes
    match kind:
        case LightType.POINT:
            return np.ones(len(directions))
        case LightType.LINE:
            sine: Doubles = np.linalg.norm(np.cross(directions, axes[:, 0]), axis=1)
            return sine * length
        case LightType.RECT:
            return width * height * np.maximum(directions @ area_vector(axes), 0.0)
        case LightType.DISK:
            return math.pi * radius**2 * np.maximum(directions @ area_vector(axes), 0.0)
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


def rect_area(world_from_light: Doubles, width: float, height: float) -> float:
    """Return the area of a rectangle in the light's XY plane."""
    return abs(width * height) * float(np.linalg.norm(np.cross(world_from_light[:3, 0], world_from_light[:3, 1])))


def disk_area(world_from_light: Doubles, radius: float) -> float:
    """Return the area of a disk in the light's XY plane, an ellipse in the world."""
    return math.pi * rect_area(world_from_light, radius, radius)


def cylinder_area(world_from_light: Doubles, length: float, radius: float) -> float:
    """Return the lateral area (no caps): length times the perimeter of the ellipse swept by cross products with the axis."""
    axis, y, z = world_from_light[:3, :3].T
    swept = np.stack([np.cross(axis, y), np.cross(axis, z)], axis=1)
    a, b = np.linalg.svd(swept, compute_uv=False)
    return abs(length * radius) * 8.0 * carlson_rg(0.0, a * a, b * b)  # DLMF 19.30.5: L = 8 R_G(0, a^2, b^2)


def sphere_area(world_from_light: Doubles, radius: float) -> float:
    """Return the area of the ellipsoid: DLMF 19.33.1, S = 4 pi R_G(a^2 b^2, a^2 c^2, b^2 c^2)."""
    return _sphere_area(world_from_light[:3, :3].tobytes(), radius)


@lru_cache(maxsize=256)
def _sphere_area(linear: bytes, radius: float) -> float:
    """Return an ellipsoid's area; cached, as many lights differ only in position."""
    a, b, c = (float(s) * radius for s in np.linalg.svd(np.frombuffer(linear).reshape(3, 3), compute_uv=False))
    return 4.0 * math.pi * carlson_rg((a * b) ** 2, (a * c) ** 2, (b * c) ** 2)


def carlson_rg(x: float, y: float, z: float) -> float:
    """Return Carlson's symmetric integral R_G of three numbers >= 0 (DLMF 19.16.3, computed by 19.21.10)."""
    x, y, z = sorted((float(x), float(y), float(z)))
    if z == 0.0:
        return 0.0
    if y == 0.0:
        return 0.5 * math.sqrt(z)  # DLMF 19.20.4
    x, y, z, scale = x / z, y / z, 1.0, math.sqrt(z)
    # 19.21.10 loses least when its z is the middle argument.
    x, y, z = x, z, y
    total = z * _carlson_rf(x, y, z) - (x - z) * (y - z) * _carlson_rd(x, y, z) / 3.0 + math.sqrt(x * y / z)
    return 0.5 * total * scale


def _carlson_rf(x: float, y: float, z: float) -> float:
    """Return Carlson's R_F: DLMF 19.36.1 after duplication until the arguments are nearly equal."""
    for _ in range(60):
        mean = (x + y + z) / 3.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean)) < 1e-3 * mean:
            break
        step = math.sqrt(x * y) + math.sqrt(y * z) + math.sqrt(z * x)
        x, y, z = (x + step) / 4.0, (y + step) / 4.0, (z + step) / 4.0
    mean = (x + y + z) / 3.0
    dx, dy = 1.0 - x / mean, 1.0 - y / mean
    dz = -(dx + dy)
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / math.sqrt(mean)


def _carlson_rd(x: float, y: float, z: float) -> float:
    """Return Carlson's R_D: DLMF 19.36.2 after duplication."""
    total, power = 0.0, 1.0
    for _ in range(60):
        mean = (x + y + 3.0 * z) / 5.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean)) < 1e-3 * mean:
            break
        step = math.sqrt(x * y) + math.sqrt(y * z) + math.sqrt(z * x)
        total += power / (math.sqrt(z) * (z + step))
        power /= 4.0
        x, y, z = (x + step) / 4.0, (y + step) / 4.0, (z + step) / 4.0
    mean = (x + y + 3.0 * z) / 5.0
    dx, dy = 1.0 - x / mean, 1.0 - y / mean
    dz = -(dx + dy) / 3.0
    e2 = dx * dy - 6.0 * dz * dz
    e3 = (3.0 * dx * dy - 8.0 * dz * dz) * dz
    e4 = 3.0 * (dx * dy - dz * dz) * dz * dz
    e5 = dx * dy * dz**3
    series = 1.0 - 3 * e2 / 14 + e3 / 6 + 9 * e2 * e2 / 88 - 3 * e4 / 22 - 9 * e2 * e3 / 52 + 3 * e5 / 26
    return 3.0 * total + power * series / (mean * math.sqrt(mean))
