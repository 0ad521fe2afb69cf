"""Geometry of a back plate: a rectangle or, with a depth image, a relief with a vertex per texel at its depth.

UsdGeom BackPlateAPI: depth = (texel - minOffset) * normalizingFactor + cameraSpaceOffset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats, Ints
from ...color.color_space import ColorSpace
from ...description import TextureFile
from ...textures.texture import load_texture
from ..stage.reads import read_asset

MOST_TEXELS = 1 << 21  # larger images are subsampled: every second, third ... texel


@dataclass(frozen=True)
class Card:
    """A plate without depth: its sides at the distance `away`, in scene units; `flat` if rays are parallel."""

    left: float
    right: float
    bottom: float
    top: float
    away: float
    flat: bool

    @property
    def center(self) -> tuple[float, float, float]:
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2, -self.away


@dataclass(frozen=True, eq=False)
class Relief:
    """Mesh of a plate."""

    points: Floats  # (N, 3) from the card's centre
    quads: Ints  # (F, 4)
    st: Floats  # (N, 2)


def flat_card(card: Card) -> Relief:
    x, y = (card.right - card.left) / 2, (card.top - card.bottom) / 2
    points = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], np.float32)
    st = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    return Relief(points, np.array([[0, 1, 2, 3]], np.int32), st)


def depths_of(path: str, space: str | ColorSpace, least: float, factor: float, offset: float) -> Doubles:
    """Return depths (H, W), the lowest row first; `space` is the texels' encoding. AssetError if the image cannot be read."""
    texels = load_texture(TextureFile(path, space, is_color=False), read_asset).channels(0, 1)[::-1, :, 0]
    step = int(np.ceil(np.sqrt(texels.size / MOST_TEXELS)))
    return (texels[::step, ::step].astype(np.float64) - least) * factor + offset


def relief(card: Card, depths: Doubles) -> Relief:
    """Return a mesh with a vertex per texel and along the edges; it has holes where depth is not positive."""
    deep = np.pad(depths, 1, mode="edge")
    t, s = (np.concatenate([[0.0], (np.arange(n) + 0.5) / n, [1.0]]) for n in depths.shape)
    s, t = np.broadcast_arrays(s[None, :], t[:, None])
    x, y = card.left + (card.right - card.left) * s, card.bottom + (card.top - card.bottom) * t
    scale = np.ones_like(deep) if card.flat else deep / card.away
    points = np.stack([x * scale, y * scale, -deep], axis=2) - card.center
    good = np.isfinite(deep) & (deep > 0)
    number = np.arange(deep.size).reshape(deep.shape)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=2).reshape(-1, 4)
    quads = quads[good.ravel()[quads].all(axis=1)]
    points = np.where(good[..., None], points, 0.0)
    st = np.stack([s, t], axis=2).reshape(-1, 2)
    return Relief(points.reshape(-1, 3).astype(np.float32), quads.astype(np.int32), st.astype(np.float32))
