"""Flux of a light, and the scale of its emission for a photometric amount: a flux, or an illuminance.

The flux is the emission integrated over the surface and all directions, times the cosine at the surface. It is integrated over
directions by the light's projected area, which is in closed form under any affine transform. Without shaping it is pi times the
area (Cauchy's formula).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import assert_never

import numpy as np

from ..arrays import Doubles, Floats
from ..description.lighting import Light, LightType, Photometric, Shaping
from .illuminance import distant_illuminance, dome_illuminance, illuminance_ahead
from .light_shape import (
    Sizes,
    axes_with_depth,
    axis_of,
    cone_angles,
    cylinder_area,
    disk_area,
    projected_area,
    rect_area,
    scaled_angles,
    shape_key,
    shaping_factor,
    sphere_area,
)

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


# Shaping and images may multiply the emission by 1e9 before single precision overflows.
BRIGHTEST_EMISSION = 1e15
DARK_TEXT = "The light's shape, shaping and image let no light out, so the amount cannot be reached: it emits nothing."
TOO_BRIGHT_TEXT = f"The requested amount needs an emission above {BRIGHTEST_EMISSION:g}: it is clamped to that."


def amount_of_unit_emission(light: Light, wanted: Photometric, image: Floats | None = None) -> Doubles:
    """Return the amount (3,) that an emission of 1 gives, through an image (H, W, 3) if there is one."""
    if light.type is LightType.DOME:
        return dome_illuminance(light, wanted.up, image)
    if light.type is LightType.DISTANT:
        return distant_illuminance(light)
    if wanted.distance is not None:
        return illuminance_ahead(light, wanted.distance, image)
    all_of_it = flux(light)
    return all_of_it if image is None else np.array(all_of_it * image.mean(axis=(0, 1), dtype=np.float64))


def scaled_to(light: Light, wanted: Photometric, of_one: Doubles) -> Light | None:
    """Return the light with the wanted amount, given that an emission of 1 has the amount `of_one`; None if no scale does."""
    luminance = float((of_one * light.emission) @ np.array(wanted.weights))
    if not luminance > 0 or not math.isfinite(luminance):
        return None
    r, g, b = (x * (wanted.amount / luminance) for x in light.emission)
    return replace(light, emission=(r, g, b), photometric=None)


def clamped(light: Light) -> Light:
    """Return the light with its emission clamped to BRIGHTEST_EMISSION."""
    r, g, b = (min(x, BRIGHTEST_EMISSION) for x in light.emission)
    return replace(light, emission=(r, g, b))
