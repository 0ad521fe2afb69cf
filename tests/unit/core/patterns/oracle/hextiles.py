"""Hexagonal tiles: Mikkelsen 2022, with the library's hash, which is in single precision as its fractions of products are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .numbers import Inputs, Rows

Lookup = Callable[[Rows], Rows]  # texels at (N, 2) coordinates
SQUARE_GRID = 2 * np.sqrt(3)


@dataclass(frozen=True)
class Tile:
    at: Rows  # (N, 2)
    weight: Rows  # (N,)
    angle: Rows  # (N,)


def random_pair(cell: Rows) -> Rows:
    p = cell.astype(np.float32) + np.float32(0.12345)
    q = p[:, [0, 1, 0]] * np.array([0.1031, 0.1030, 0.0973], np.float32)
    q = q - np.floor(q)
    q = q + (q * (q[:, [1, 2, 0]] + np.float32(33.33))).sum(axis=1, keepdims=True, dtype=np.float32)
    r = (q[:, [0, 0]] + q[:, [1, 2]]) * q[:, [2, 1]]
    return np.asarray(r - np.floor(r), np.float64)


def between(ends: Rows, share: Rows) -> Rows:
    return ends[:, 0] * (1 - share) + ends[:, 1] * share


def tiles(i: Inputs) -> list[Tile]:
    at = i["texcoord"] * i["tiling"]
    st = at * SQUARE_GRID
    skewed = np.stack([st[:, 0] - 0.57735027 * st[:, 1], 1.15470054 * st[:, 1]], axis=1)
    base = np.floor(skewed)
    x, y = (skewed - base).T
    z = 1 - x - y
    upper = (z <= 0).astype(float)
    found = []
    for dx, dy, weight in (
        (upper, upper, np.abs(z)),
        (upper, 1 - upper, np.where(upper, 1 - y, y)),
        (1 - upper, upper, np.where(upper, 1 - x, x)),
    ):
        cell = base + np.stack([dx, dy], axis=1)
        random = random_pair(cell)
        middle = np.stack([cell[:, 0] + cell[:, 1] / 2, cell[:, 1] / 1.15470054], axis=1) / SQUARE_GRID
        angle = between(np.radians(i["rotationrange"]), random[:, 0] * i["rotation"][:, 0])
        scale = 1 - i["scale"][:, 0] + i["scale"][:, 0] * between(i["scalerange"], random[:, 1])
        moved = [between(i["offsetrange"], random[:, k] * i["offset"][:, 0]) for k in range(2)]
        d = at - middle
        turned = [d[:, 0] * np.cos(angle) - d[:, 1] * np.sin(angle), d[:, 0] * np.sin(angle) + d[:, 1] * np.cos(angle)]
        place = np.stack([turned[k] / scale + middle[:, k] + moved[k] for k in range(2)], axis=1)
        found.append(Tile(place, weight, angle))
    return found


def gain(x: Rows, r: Rows) -> Rows:
    a = (1 / np.clip(r, 0.001, 0.999) - 2) * (1 - 2 * x)
    return np.where(x < 0.5, x / (a + 1), (a - x) / (a - 1))


def shares(i: Inputs, of: Sequence[Tile], brightness: Rows) -> Rows:
    """(N, 3)."""
    w = brightness * np.stack([tile.weight for tile in of], axis=1) ** 7
    w = w / w.sum(axis=1, keepdims=True)
    gained = gain(w, i["falloff"])
    return np.where(i["falloff"] == 0.5, w, gained / gained.sum(axis=1, keepdims=True))


def image(i: Inputs, look: Lookup) -> Rows:
    of = tiles(i)
    colors = [look(tile.at) for tile in of]
    luma = np.stack([(c[:, :3] * i["lumacoeffs"]).sum(axis=1) for c in colors], axis=1)
    contrast = i["falloffcontrast"]
    w = shares(i, of, 1 - contrast + contrast * luma)
    plain = shares(i, of, np.ones_like(w))
    color = sum(c[:, :3] * w[:, k : k + 1] for k, c in enumerate(colors))
    alpha = sum(c[:, 3:] * plain[:, k : k + 1] for k, c in enumerate(colors))
    return np.hstack([color, alpha])


def unit(v: Rows) -> Rows:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def about(axis: Rows, angle: Rows, v: Rows) -> Rows:
    """Rodrigues' formula, right-handed."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along: npt.NDArray[np.float64] = (axis * v).sum(axis=1, keepdims=True)
    return np.asarray(v * c + np.cross(axis, v) * s + axis * along * (1 - c))


def normal(i: Inputs, look: Lookup) -> Rows:
    n, of = i["normal"], tiles(i)
    w = np.clip(shares(i, of, np.ones((len(n), 3))), 0, 1)
    gradient = np.zeros_like(n)
    for k, tile in enumerate(of):
        coded = look(tile.at)[:, :3].copy()
        coded[:, 1] = np.where(i["flip_g"][:, 0] > 0, 1 - coded[:, 1], coded[:, 1])
        x, y, z = np.split(2 * coded - 1, 3, axis=1)
        tangent, bitangent = (about(n, tile.angle, i[name]) * i["strength"] for name in ("tangent", "bitangent"))
        bent = unit(tangent * x + bitangent * y + n * z)
        d = (n * bent).sum(axis=1, keepdims=True)
        gradient += w[:, k : k + 1] * (d * n - bent) / np.maximum(1e-8, np.abs(d))
    return unit(n - gradient)
