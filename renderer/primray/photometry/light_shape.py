"""Shape of a light under its transform, and its shaping: projected and surface areas, and the factor by direction of emission.

Surface areas are exact up to rounding under any affine transform; UsdLux's `normalize` divides by them. The factor is that of
UsdLux ShapingAPI (focus, cone, IES profile), as in the core's light/shaping.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple, assert_never

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description.lighting import IesProfile, Light, LightType, Shaping


class Sizes(NamedTuple):
    """Sizes of a light before its transform."""

    width: float
    height: float
    radius: float
    length: float


def shape_key(light: Light) -> tuple[bytes, Sizes]:
    """Return the light's stretch (3, 3) as bytes, and its sizes; instances that are only rotated or moved have the same."""
    linear = light.world_from_light[:3, :3]
    _, stretch, own = np.linalg.svd(linear)
    straight = own.T @ (stretch[:, None] * own)  # the symmetric factor of a polar decomposition
    largest = float(np.abs(straight).max())
    digits = 12 - math.floor(math.log10(largest)) if 0 < largest < math.inf else 0
    sizes = Sizes(light.width, light.height, light.radius, light.length)
    return np.ascontiguousarray(np.round(straight, digits)).tobytes(), sizes


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


def axis_of(axes: Doubles) -> Doubles:
    """Return the light's -Z (3,) in the world, given its axes (3, 3) as columns."""
    axis: Doubles = -axes[:, 2] / np.linalg.norm(axes[:, 2])
    return axis


def shaping_factor(shaping: Shaping, axes: Doubles, directions: Doubles) -> Doubles:
    """Return the factor (N, 3) for unit directions of emission (N, 3) in the world."""
    axis = axis_of(axes)
    cosine = directions @ axis
    theta = np.arctan2(np.linalg.norm(np.cross(directions, axis), axis=1), cosine)
    factor = np.repeat(_cone(shaping, theta)[:, None], 3, axis=1)
    if shaping.focus > 0:
        focused = (np.abs(cosine) ** shaping.focus)[:, None]
        tint = np.array(shaping.focus_tint)
        factor *= tint + (1.0 - tint) * focused
    if shaping.ies is not None:
        divisor = shaping.ies.power if shaping.ies_normalize else 1.0
        local = directions @ np.linalg.inv(axes).T
        factor *= (intensity(shaping.ies, local, shaping.ies_angle_scale) / divisor)[:, None]
    return factor


def _cone(shaping: Shaping, theta: Doubles) -> Doubles:
    cutoff, start = cone_angles(shaping)
    if start == cutoff:
        return np.where(theta <= cutoff, 1.0, 0.0)
    left = np.clip((cutoff - theta) / (cutoff - start), 0.0, 1.0)
    faded: Doubles = left * left * (3.0 - 2.0 * left)
    return faded


def cone_angles(shaping: Shaping) -> tuple[float, float]:
    """Return the cone's cutoff and the angle at which it begins to fade, in radians."""
    cutoff = math.radians(shaping.cone_angle_deg)
    return cutoff, cutoff * (1.0 - shaping.cone_softness)


def scaled_angles(angle_scale: float) -> tuple[float, float]:
    """Return divisor and origin of ies:angleScale: a profile is looked up at (angle - origin) / divisor + origin."""
    if angle_scale == 0:
        return 1.0, 0.0
    return abs(angle_scale), math.pi if angle_scale < 0 else 0.0


def intensity(profile: IesProfile, local: Doubles, angle_scale: float) -> Doubles:
    """Return the profile's intensity (N,) along directions (N, 3) of any length in the light's space (angles: IesProfile)."""
    x, y, z = -local[:, 0], -local[:, 1], local[:, 2]
    across = np.hypot(x, y)
    divisor, origin = scaled_angles(angle_scale)
    vertical = np.minimum((np.arctan2(across, -z) - origin) / divisor + origin, math.pi)
    before = vertical < 0
    if profile.horizontal_pole:
        flat = np.sin(vertical) / np.maximum(across, 1e-300)
        x, y, down = x * flat, y * flat, np.cos(vertical)
        vertical, horizontal = np.arctan2(x, down), np.arctan2(-y, np.hypot(x, down))
    else:
        horizontal = np.mod(np.arctan2(y, x), 2 * math.pi)
    return np.where(before, 0.0, _read(profile, vertical, horizontal))


def _read(profile: IesProfile, vertical: Doubles, horizontal: Doubles) -> Doubles:
    candela = profile.candela.astype(np.float64)
    v, part, inside = _cell(np.radians(profile.vertical_deg.astype(np.float64)), vertical)
    rows = candela[:, v] * (1 - part) + candela[:, v + 1] * part if len(candela) == 1 else None
    if rows is not None:
        return np.where(inside, rows[0], 0.0)
    h, around, within = _cell(np.radians(profile.horizontal_deg.astype(np.float64)), horizontal)
    low = candela[h, v] * (1 - part) + candela[h, v + 1] * part
    high = candela[h + 1, v] * (1 - part) + candela[h + 1, v + 1] * part
    return np.where(inside & within, low + (high - low) * around, 0.0)


def _cell(grid: Doubles, at: Doubles) -> tuple[npt.NDArray[np.intp], Doubles, npt.NDArray[np.bool_]]:
    """Return the grid's cell, the position in it from 0 to 1, and whether the angle is in the grid up to rounding."""
    i = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    part = np.clip((at - grid[i]) / np.maximum(grid[i + 1] - grid[i], 1e-20), 0.0, 1.0)
    return i, part, (at >= grid[0] - 1e-9) & (at <= grid[-1] + 1e-6)
