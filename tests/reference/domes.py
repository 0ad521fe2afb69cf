"""Irradiance under a dome: DomeLight's and DomeLight_1's maps from directions to pixels, by their text.

The text does not turn formats other than lat-long. Read so: their middle shows +Z and their top +Y, as in lat-long; a ball is
seen from +Z, so that +X is on the right; a cross is unfolded as seen from within, with -Z hanging below -Y.

A dome is the same from everywhere, so that one dense rule per stage is affordable: Gauss in the polar angle and in azimuth
between the kinks of a lat-long picture; 4 million directions for other formats.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from tests.reference.adaptive import Doubles
from tests.reference.emitters import Emitter

Y_FROM_Z = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])  # a Z-up dome's directions to a Y-up one's: z -> y, -y -> z


@lru_cache(maxsize=16)
def dome_irradiance(light: Emitter, normal: tuple[float, float, float]) -> Doubles:
    """(C,) for unit radiance times the picture."""
    n = np.array(normal)
    if light.picture is None:
        return np.array([np.pi])
    steps = 2000
    x, w = np.polynomial.legendre.leggauss(4)
    # Cosine-weighted directions about n: uniform in the square of the sine and in azimuth.
    edges = np.linspace(0, 1, steps // 4 + 1)
    u = (edges[:-1, None] + (x + 1) / 2 * np.diff(edges)[:, None]).ravel()
    weight = np.tile(w / 2, steps // 4) * 4 / steps
    phi = (np.arange(steps) + 0.5) * 2 * np.pi / steps
    aside = np.array([1.0, 0, 0]) if abs(n[0]) < 0.6 else np.array([0, 1.0, 0])
    a = np.cross(aside, n)
    a /= np.linalg.norm(a)
    b = np.cross(n, a)
    total = np.zeros(3)
    for ui, wi in zip(u, weight, strict=True):
        r = np.sqrt(ui)
        d = r * (np.cos(phi)[:, None] * a + np.sin(phi)[:, None] * b) + np.sqrt(1 - ui) * n
        total += wi * radiance(light, d).mean(axis=0)
    return np.pi * total


def radiance(light: Emitter, d: Doubles) -> Doubles:
    """The picture where a unit vector (..., 3) in the world points."""
    assert light.picture is not None
    own = d @ np.linalg.inv(light.linear).T
    own = own / np.linalg.norm(own, axis=-1, keepdims=True)
    if light.z_pole:
        own = own @ Y_FROM_Z.T
    return light.picture.at(*_MAPS.get(light.picture_format, lat_long)(own), wrap=light.picture_format not in _MAPS)


def lat_long(d: Doubles) -> tuple[Doubles, Doubles]:
    """s to the right, t down. Longitude 0 at +Z, pi/2 at +X, pi at the left edge; latitude pi/2 at the top."""
    return 0.5 - np.arctan2(d[..., 0], d[..., 2]) / (2 * np.pi), np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi


def mirrored_ball(d: Doubles) -> tuple[Doubles, Doubles]:
    """A camera far out on +Z sees in the ball, at normal n, what lies along 2 (n.z) n - z: n is half way between z and d."""
    n = d + [0, 0, 1.0]
    n = n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-12)
    return (1 + n[..., 0]) / 2, (1 - n[..., 1]) / 2


def angular(d: Doubles) -> tuple[Doubles, Doubles]:
    angle, azimuth = np.arccos(np.clip(d[..., 2], -1, 1)), np.arctan2(d[..., 1], d[..., 0])
    return (1 + np.cos(azimuth) * angle / np.pi) / 2, (1 - np.sin(azimuth) * angle / np.pi) / 2


# Faces of a cross: column, row, the axis looked along, the axes to the right and down.
_FACES = (
    (1, 1, (0, 0, 1), (-1, 0, 0), (0, -1, 0)),
    (0, 1, (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    (2, 1, (-1, 0, 0), (0, 0, -1), (0, -1, 0)),
    (1, 0, (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    (1, 2, (0, -1, 0), (-1, 0, 0), (0, 0, -1)),
    (1, 3, (0, 0, -1), (-1, 0, 0), (0, 1, 0)),
)


def vertical_cross(face_pixels: int, d: Doubles) -> tuple[Doubles, Doubles]:
    """No pixel of another face is mixed in: places nearer to an edge than half a pixel are moved there."""
    along = np.stack([d @ np.array(face[2], float) for face in _FACES], axis=-1)
    which = along.argmax(axis=-1)
    column, row = np.array([f[0] for f in _FACES])[which], np.array([f[1] for f in _FACES])[which]
    right, down = np.array([f[3] for f in _FACES], float)[which], np.array([f[4] for f in _FACES], float)[which]
    depth = along.max(axis=-1)
    edge = 0.5 / face_pixels
    s = np.clip(((d * right).sum(axis=-1) / depth + 1) / 2, edge, 1 - edge)
    t = np.clip(((d * down).sum(axis=-1) / depth + 1) / 2, edge, 1 - edge)
    return (column + s) / 3, (row + t) / 4


CROSS_FACE = 32  # pixels of a face of the crosses that tests write

_MAPS = {
    "mirroredBall": mirrored_ball,
    "angular": angular,
    "cubeMapVerticalCross": lambda d: vertical_cross(CROSS_FACE, d),
}
