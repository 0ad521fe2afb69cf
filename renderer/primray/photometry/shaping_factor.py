"""Factor of UsdLux ShapingAPI by direction of emission: focus, cone and IES profile, as in the core's light/shaping."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description.lighting import IesProfile, Shaping


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
