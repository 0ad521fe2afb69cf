"""Flux of a light: its emission integrated over its surface and all directions, times the cosine at the surface.

It is integrated over directions by the light's projected area, which is in closed form under any affine transform. Without
shaping it is pi times the area (Cauchy's formula).
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import assert_never

import numpy as np

from ..arrays import Doubles
from ..description.lighting import Light, LightType, Shaping
from .light_shape import Sizes, axes_with_depth, cylinder_area, disk_area, projected_area, rect_area, shape_key, sphere_area
from .shaping_factor import axis_of, cone_angles, scaled_angles, shaping_factor

AROUND = 256  # least number of directions around the axis
_MOST_BREAKS = 720
_AT_ONCE = 1 << 20


def flux(light: Light) -> Doubles:
    """Return the flux (3,) of an emission of 1, without an image; in scene units squared."""
    if light.shaping is None:
        return np.full(3, _unshaped(light))
    return np.array(_shaped(light.type, *shape_key(light), light.shaping))


def _unshaped(light: Light) -> float:
    m, kind = light.world_from_light, light.type
    match kind:
        case LightType.POINT:
            return 4 * math.pi
        case LightType.LINE:  # pi^2 is the sine's integral over directions
            return math.pi**2 * light.length * float(np.linalg.norm(m[:3, 0]))
        case LightType.RECT:
            return math.pi * rect_area(m, light.width, light.height)
        case LightType.DISK:
            return math.pi * disk_area(m, light.radius)
        case LightType.SPHERE:
            return math.pi * sphere_area(m, light.radius)
        case LightType.CYLINDER:
            return math.pi * cylinder_area(m, light.length, light.radius)
        case LightType.DISTANT | LightType.DOME | LightType.GEOMETRY:
            raise ValueError(f"a {kind.value} light has no surface of its own")
        case _:
            assert_never(kind)


@lru_cache(maxsize=256)
def _shaped(kind: LightType, linear: bytes, sizes: Sizes, shaping: Shaping) -> tuple[float, float, float]:
    axes = axes_with_depth(np.frombuffer(linear).reshape(3, 3))
    frame = _frame(axes)
    theta, theta_weights = _quadrature(_polar_breaks(shaping), math.pi, 180)
    phi, phi_weights = _quadrature(_turn_breaks(shaping), 2 * math.pi, AROUND)
    total = np.zeros(3)
    rows = max(1, _AT_ONCE // len(phi))
    for i in range(0, len(theta), rows):
        t, f = np.meshgrid(theta[i : i + rows], phi, indexing="ij")
        local = np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], axis=-1).reshape(-1, 3)
        directions = local @ frame
        weights = np.outer(theta_weights[i : i + rows] * np.sin(theta[i : i + rows]), phi_weights).ravel()
        weights *= projected_area(kind, axes, sizes, directions)
        total += weights @ shaping_factor(shaping, axes, directions)
    r, g, b = total.tolist()
    return (r, g, b)


def _frame(axes: Doubles) -> Doubles:
    """Return -X, -Y and -Z of the light, made orthonormal, as rows; horizontal angles of profiles are from -X."""
    axis = axis_of(axes)
    first = -axes[:, 0] + axis * (axes[:, 0] @ axis)
    if np.linalg.norm(first) < 1e-9 * np.linalg.norm(axes[:, 0]):
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    second *= -1.0 if second @ axes[:, 1] > 0 else 1.0
    return np.stack([first, second, axis])


def _polar_breaks(shaping: Shaping) -> list[float]:
    """Return angles off the axis where the integrand has a kink or changes most."""
    breaks = [math.pi / 2, *cone_angles(shaping)]
    if shaping.focus > 0:
        width = 1.0 / math.sqrt(shaping.focus + 1.0)
        near = [k * width for k in (0.5, 1.0, 2.0, 4.0, 8.0)]
        breaks += near + [math.pi - k for k in near]
    if shaping.ies is not None and not shaping.ies.horizontal_pole:
        divisor, origin = scaled_angles(shaping.ies_angle_scale)
        breaks += _table_breaks((np.radians(shaping.ies.vertical_deg) - origin) * divisor + origin)
    return breaks


def _turn_breaks(shaping: Shaping) -> list[float]:
    if shaping.ies is None or shaping.ies.horizontal_pole:
        return []
    return _table_breaks(np.radians(shaping.ies.horizontal_deg))


def _table_breaks(angles: Doubles) -> list[float]:
    return angles.tolist() if len(angles) <= _MOST_BREAKS else []


def _quadrature(breaks: list[float], end: float, fewest: int) -> tuple[Doubles, Doubles]:
    """Return Gauss-Legendre nodes and weights from 0 to `end`, piecewise between breaks: at least `fewest`."""
    edges = np.unique(np.concatenate([[0.0, end], [b for b in breaks if 0.0 < b < end]]))
    order = min(max(math.ceil(fewest / (len(edges) - 1)), 4), 16)
    if len(edges) - 1 < fewest // order:
        parts = math.ceil(fewest / (order * (len(edges) - 1)))
        edges = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in pairwise(edges.tolist())]))
    x, w = np.polynomial.legendre.leggauss(order)
    half = np.diff(edges) / 2
    return (edges[:-1, None] + half[:, None] * (x + 1)).ravel(), (half[:, None] * w).ravel()
