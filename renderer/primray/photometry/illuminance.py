"""Illuminance of a patch that faces a light: ahead of an area light, before a distant one, or facing up below a dome.

For area lights it is integrated over the light's surface, or over the directions in which a sphere is visible, with nodes that
are dense near the patch. A dome's image is read as in the core (core/light/dome).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import assert_never

import numpy as np

from ..arrays import Doubles, Floats
from ..description.lighting import Light, LightType, Shaping
from .light_shape import Sizes, area_vector, axes_with_depth, axis_of, shape_key, shaping_factor

_NODES = 256  # quadrature nodes along each of two parameters
_FINEST = 2048  # most rows or columns of an image

# Surface elements: positions (N, 3) from the light's origin, area vectors (N, 3) on the emitting side.
Elements = tuple[Doubles, Doubles]


def distant_illuminance(light: Light) -> Doubles:
    """Return the illuminance (3,) of an emission of 1, which at angle 0 is irradiance (UsdLux DistantLight).

    With an angle beyond 180 degrees the rest comes from behind.
    """
    half = math.radians(light.angle_deg) / 2
    if half == 0:
        return np.ones(3)
    return np.full(3, math.pi * (math.sin(half) ** 2 if half < math.pi / 2 else 1.0))


def illuminance_ahead(light: Light, distance: float, image: Floats | None = None) -> Doubles:
    """Return the illuminance (3,) at `distance` along -Z, facing the light's origin, of an emission of 1.

    `image` (H, W, 3) multiplies a rectangle's emission.
    """
    linear, sizes = shape_key(light)
    if image is not None:
        return _image_illuminance(linear, sizes, light.shaping, distance, image)
    return np.array(_illuminance_ahead(light.type, linear, sizes, light.shaping, distance))


@lru_cache(maxsize=256)
def _illuminance_ahead(
    kind: LightType, linear: bytes, sizes: Sizes, shaping: Shaping | None, distance: float
) -> tuple[float, float, float]:
    axes = axes_with_depth(np.frombuffer(linear).reshape(3, 3))
    axis = axis_of(axes)
    match kind:
        case LightType.POINT:
            received = _factor(shaping, axes, axis[None])[0] / distance**2
        case LightType.SPHERE:
            received = _from_sphere(axes, sizes, shaping, distance)
        case LightType.LINE:
            received = _from_line(axes, sizes, shaping, distance)
        case LightType.RECT:
            received = _weights(_rect_elements(axes, sizes, distance), axes, shaping, distance).sum(axis=0)
        case LightType.DISK:
            received = _weights(_disk_elements(axes, sizes, distance), axes, shaping, distance).sum(axis=0)
        case LightType.CYLINDER:
            received = _weights(_cylinder_elements(axes, sizes, distance), axes, shaping, distance).sum(axis=0)
        case LightType.DISTANT | LightType.DOME | LightType.GEOMETRY:
            raise ValueError(f"a {kind.value} light has no surface of its own")
        case _:
            assert_never(kind)
    r, g, b = received.tolist()
    return (r, g, b)


def _factor(shaping: Shaping | None, axes: Doubles, directions: Doubles) -> Doubles:
    return np.ones((len(directions), 3)) if shaping is None else shaping_factor(shaping, axes, directions)


def _weights(elements: Elements, axes: Doubles, shaping: Shaping | None, distance: float) -> Doubles:
    """Return (N, 3) for each element: shaping times both cosines over the distance squared."""
    places, areas = elements
    axis = axis_of(axes)
    towards = axis * distance - places
    squared = np.maximum((towards * towards).sum(axis=1), 1e-300)
    directions = towards / np.sqrt(squared)[:, None]
    leaving = np.maximum((areas * directions).sum(axis=1), 0.0)
    received: Doubles = _factor(shaping, axes, directions) * (leaving * np.maximum(directions @ axis, 0.0) / squared)[:, None]
    return received


def _dense(low: float, high: float, about: float, scale: float) -> tuple[Doubles, Doubles]:
    """Return nodes and weights from low to high, dense within `scale` of `about`."""
    x, w = np.polynomial.legendre.leggauss(_NODES)
    start, end = math.asinh((low - about) / scale), math.asinh((high - about) / scale)
    u = start + (end - start) * (x + 1) / 2
    return about + scale * np.sinh(u), scale * np.cosh(u) * w * (end - start) / 2


def _length(vector: Doubles) -> float:
    return max(float(np.linalg.norm(vector)), 1e-300)


def _rect_elements(axes: Doubles, sizes: Sizes, distance: float) -> Elements:
    width, height = sizes.width, sizes.height
    x, wx = _dense(-width / 2, width / 2, 0.0, distance / _length(axes[:, 0]))
    y, wy = _dense(-height / 2, height / 2, 0.0, distance / _length(axes[:, 1]))
    places = x[:, None, None] * axes[:, 0] + y[None, :, None] * axes[:, 1]
    return places.reshape(-1, 3), np.outer(wx, wy).reshape(-1, 1) * area_vector(axes)


def _disk_elements(axes: Doubles, sizes: Sizes, distance: float) -> Elements:
    r, wr = _dense(0.0, sizes.radius, 0.0, distance / _length(axes[:, 0]))
    turn = (np.arange(_NODES) + 0.5) * (2 * math.pi / _NODES)
    around = np.cos(turn)[:, None] * axes[:, 0] + np.sin(turn)[:, None] * axes[:, 1]
    weights = np.repeat(wr * r * (2 * math.pi / _NODES), _NODES)
    return (r[:, None, None] * around).reshape(-1, 3), weights[:, None] * area_vector(axes)


def _cylinder_elements(axes: Doubles, sizes: Sizes, distance: float) -> Elements:
    """Return the elements of a cylinder that are visible from the patch; none from inside."""
    radius, length = sizes.radius, sizes.length
    at = np.linalg.solve(axes, axis_of(axes) * distance)  # the patch, in the light's frame
    away = math.hypot(at[1], at[2])
    if away <= radius:
        return np.zeros((1, 3)), np.zeros((1, 3))
    x, wx = _dense(-length / 2, length / 2, float(at[0]), away - radius)
    reach, middle = math.acos(radius / away), math.atan2(at[2], at[1])
    psi, wp = _dense(middle - reach, middle + reach, middle, max((away - radius) / radius, 1e-6))
    sideways = np.cos(psi)[:, None] * axes[:, 1] + np.sin(psi)[:, None] * axes[:, 2]
    places = x[:, None, None] * axes[:, 0] + radius * sideways
    along, across = np.cross(axes[:, 2], axes[:, 0]), np.cross(axes[:, 0], axes[:, 1])
    normals = np.cos(psi)[:, None] * along + np.sin(psi)[:, None] * across
    normals *= math.copysign(radius, float(np.linalg.det(axes)))
    return places.reshape(-1, 3), (np.outer(wx, wp)[:, :, None] * normals).reshape(-1, 3)


def _from_line(axes: Doubles, sizes: Sizes, shaping: Shaping | None, distance: float) -> Doubles:
    """Return the illuminance by a line, whose emission is radiant intensity per length, perpendicular to it."""
    along, axis = axes[:, 0], axis_of(axes)
    x, wx = _dense(-sizes.length / 2, sizes.length / 2, 0.0, distance / _length(along))
    towards = axis * distance - x[:, None] * along
    apart = np.linalg.norm(towards, axis=1)
    directions = towards / apart[:, None]
    shown = np.linalg.norm(np.cross(directions, along), axis=1) * wx
    weights = shown * np.maximum(directions @ axis, 0.0) / apart**2
    received: Doubles = weights @ _factor(shaping, axes, directions)
    return received


def _from_sphere(axes: Doubles, sizes: Sizes, shaping: Shaping | None, distance: float) -> Doubles:
    """Return the illuminance by a sphere, over the cone of directions to it in its frame, mapped to the world."""
    axis = axis_of(axes)
    at = np.linalg.solve(axes, axis * distance)
    away = float(np.linalg.norm(at))
    if away <= sizes.radius:
        return np.zeros(3)
    towards, first = -at / away, np.cross(at, np.eye(3)[np.argmin(np.abs(at))])
    first /= np.linalg.norm(first)
    beta, wb = _dense(0.0, math.asin(sizes.radius / away), 0.0, math.pi)
    turn = (np.arange(_NODES) + 0.5) * (2 * math.pi / _NODES)
    sideways = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(towards, first)
    local = np.cos(beta)[:, None, None] * towards + np.sin(beta)[:, None, None] * sideways
    seen = local.reshape(-1, 3) @ axes.T
    lengths = np.linalg.norm(seen, axis=1)
    solid_angles = np.repeat(wb * np.sin(beta) * (2 * math.pi / _NODES), _NODES) * abs(np.linalg.det(axes)) / lengths**3
    directions = -seen / lengths[:, None]  # of the arriving light
    received: Doubles = (solid_angles * np.maximum(directions @ axis, 0.0)) @ _factor(shaping, axes, directions)
    return received


def _image_illuminance(linear: bytes, sizes: Sizes, shaping: Shaping | None, distance: float, image: Floats) -> Doubles:
    """Return the illuminance by a rectangle's image (first row at +Y, first column at +X), bilinear as in the core."""
    axes = axes_with_depth(np.frombuffer(linear).reshape(3, 3))
    width, height = sizes.width, sizes.height
    down, across = (_places(count) for count in image.shape[:2])
    total = np.zeros(3)
    step = area_vector(axes) * (width * height / (len(down) * len(across)))
    for t in down:
        places = ((0.5 - across) * width)[:, None] * axes[:, 0] + (0.5 - t) * height * axes[:, 1]
        weights = _weights((places, np.broadcast_to(step, places.shape)), axes, shaping, distance)
        total += (weights * bilinear(image, across * image.shape[1], np.full(len(across), t * image.shape[0]))).sum(axis=0)
    return total


def _places(texels: int) -> Doubles:
    """Return sample positions from 0 to 1: texel centres, finer for small images, coarser for very large ones."""
    count = min(texels * math.ceil(512 / texels), _FINEST)
    return (np.arange(count) + 0.5) / count


def bilinear(image: Floats, x: Doubles, y: Doubles, *, around: bool = False) -> Doubles:
    """Return bilinear values (N, 3) of an image (H, W, 3); the first texel's centre is at 0.5; `around`: x is periodic."""
    height, width, _ = image.shape
    i, j = np.floor(x - 0.5).astype(np.intp), np.floor(y - 0.5).astype(np.intp)
    u, v = (x - 0.5 - i)[:, None], (y - 0.5 - j)[:, None]
    left, right = (i % width, (i + 1) % width) if around else (np.clip(i, 0, width - 1), np.clip(i + 1, 0, width - 1))
    top, bottom = np.clip(j, 0, height - 1), np.clip(j + 1, 0, height - 1)
    upper = image[top, left] * (1 - u) + image[top, right] * u
    lower = image[bottom, left] * (1 - u) + image[bottom, right] * u
    mixed: Doubles = upper * (1 - v) + lower * v
    return mixed


_ROWS = 1024  # least number of rows of directions from pole to pole
_DISCS = ("mirroredBall", "angular")


def dome_illuminance(light: Light, up: tuple[float, float, float], image: Floats | None) -> Doubles:
    """Return the illuminance (3,) of an emission of 1, times the dome's image (H, W, 3) if there is one."""
    if image is None:
        return np.full(3, math.pi)
    axes = light.world_from_light[:3, :3] / np.linalg.norm(light.world_from_light[:3, :3], axis=0)
    return _received(image, axes.T @ np.array(up), light.texture_format)


def _received(image: Floats, up: Doubles, layout: str) -> Doubles:
    """Return the illuminance, summed over rows of equal elevation; `up` is in the dome's frame."""
    height, width, _ = image.shape
    plain = layout in ("latlong", "automatic")
    if layout in _DISCS:
        image = _extended_disc(image)
    as_stored = plain and height >= _ROWS and width >= _ROWS  # texels are small enough to be one direction each
    rows, columns = (height, width) if as_stored else (_ROWS, 2 * _ROWS)
    turn = (0.5 - (np.arange(columns) + 0.5) / columns) * 2 * math.pi  # s = 0.5 - atan2(x, z) / 2 pi
    total = np.zeros(3)
    for row in range(rows):
        polar = (row + 0.5) * math.pi / rows
        sine, cosine = math.sin(polar), math.cos(polar)
        facing = np.maximum(up[1] * cosine + sine * (up[0] * np.sin(turn) + up[2] * np.cos(turn)), 0.0)
        if not facing.any():
            continue
        band = math.cos(row * math.pi / rows) - math.cos((row + 1) * math.pi / rows)
        if as_stored:
            values = np.asarray(image[row], np.float64)
        else:
            directions = np.stack([sine * np.sin(turn), np.full(columns, cosine), sine * np.cos(turn)], axis=-1)
            values = _image_values(image, directions, layout)
        total += facing @ values * (band * 2 * math.pi / columns)
    return total


def _extended_disc(image: Floats) -> Floats:
    """Return the image with the edge of its disc extended outwards, as in the core."""
    height, width, _ = image.shape
    y, x = np.meshgrid(2 * (np.arange(height) + 0.5) / height - 1, 2 * (np.arange(width) + 0.5) / width - 1, indexing="ij")
    radius = np.hypot(x, y)
    inwards = np.where(radius > 1, max(1 - 1.4143 / min(width, height), 0.0) / np.maximum(radius, 1e-20), 1.0)
    column = np.clip(((x * inwards + 1) * 0.5 * width).astype(np.intp), 0, width - 1)
    row = np.clip(((y * inwards + 1) * 0.5 * height).astype(np.intp), 0, height - 1)
    whole: Floats = image[row, column]
    return whole


def _image_values(image: Floats, w: Doubles, layout: str) -> Doubles:
    """Return the image's values (N, 3) in unit directions of the dome's frame (formats: core/light/dome/dome_format.hpp)."""
    height, width, _ = image.shape
    if layout in _DISCS:
        sine = np.maximum(np.hypot(w[:, 0], w[:, 1]), 1e-20)
        angle = np.arctan2(sine, w[:, 2])
        radius = (np.sin(angle / 2) if layout == "mirroredBall" else angle / math.pi) / sine
        return bilinear(image, (0.5 + 0.5 * radius * w[:, 0]) * width, (0.5 - 0.5 * radius * w[:, 1]) * height)
    if layout == "cubeMapVerticalCross":
        return bilinear(image, *_on_cross(w, width, height))
    s = 0.5 - np.arctan2(w[:, 0], w[:, 2]) / (2 * math.pi)
    return bilinear(image, s * width, np.arccos(np.clip(w[:, 1], -1, 1)) / math.pi * height, around=True)


def _on_cross(w: Doubles, width: int, height: int) -> tuple[Doubles, Doubles]:
    """Return column and row (N,) on a vertical cross, no nearer to a face's edge than the centres of its outer texels."""
    x, y, z = w.T
    ax, ay, az = np.abs(w).T
    on_x, back = (ax > ay) & (ax > az), z < 0
    on_y = ~on_x & (ay > az)
    back &= ~on_x & ~on_y
    half = 0.5 / np.maximum(np.maximum(ax, ay), az)
    across = np.where(on_x, np.copysign(z, x * z), -x)
    down = np.where(on_y, np.copysign(z, y * z), np.where(back, y, -y))
    column = np.where(on_x, np.where(x > 0, 0.0, 2.0), 1.0)
    row = np.where(on_y, np.where(y > 0, 0.0, 2.0), np.where(back, 3.0, 1.0))
    edge_x, edge_y = min(1.5 / width, 0.5), min(2.0 / height, 0.5)
    on_face_x = np.clip(0.5 + across * half, edge_x, 1 - edge_x)
    on_face_y = np.clip(0.5 + down * half, edge_y, 1 - edge_y)
    return (column + on_face_x) * (width / 3), (row + on_face_y) * (height / 4)
