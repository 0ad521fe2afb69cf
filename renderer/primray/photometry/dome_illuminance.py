"""Illuminance by a dome of a patch that faces up, through the dome's image as the core reads it (core/light/dome)."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Doubles, Floats
from ..description.lighting import Light
from .illuminance import bilinear

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
        image = _extended(image)
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
            values = _seen(image, directions, layout)
        total += facing @ values * (band * 2 * math.pi / columns)
    return total


def _extended(image: Floats) -> Floats:
    """Return the image with the edge of its disc extended outwards, as in the core."""
    height, width, _ = image.shape
    y, x = np.meshgrid(2 * (np.arange(height) + 0.5) / height - 1, 2 * (np.arange(width) + 0.5) / width - 1, indexing="ij")
    radius = np.hypot(x, y)
    inwards = np.where(radius > 1, max(1 - 1.4143 / min(width, height), 0.0) / np.maximum(radius, 1e-20), 1.0)
    column = np.clip(((x * inwards + 1) * 0.5 * width).astype(np.intp), 0, width - 1)
    row = np.clip(((y * inwards + 1) * 0.5 * height).astype(np.intp), 0, height - 1)
    whole: Floats = image[row, column]
    return whole


def _seen(image: Floats, w: Doubles, layout: str) -> Doubles:
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
