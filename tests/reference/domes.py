"""Irradiance under a dome: DomeLight's and DomeLight_1's maps from directions to pixels, by their text.

A dome is the same from everywhere, so that one dense rule per stage is affordable: Gauss in the polar angle and in azimuth
between the kinks of a lat-long picture; 4 million directions for other formats.
"""

from __future__ import annotations

import numpy as np
from tests.reference.adaptive import Doubles
from tests.reference.emitters import Emitter

Y_FROM_Z = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])  # a Z-up dome's directions to a Y-up one's: z -> y, -y -> z


def dome_irradiance(light: Emitter, n: Doubles) -> Doubles:
    """(C,) for unit radiance times the picture."""
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
    x, y, z = own[..., 0], own[..., 1], own[..., 2]
    # Longitude 0 at +Z, pi/2 at +X, pi at the left edge; latitude pi/2 at the top.
    return light.picture.at(0.5 - np.arctan2(x, z) / (2 * np.pi), np.arccos(np.clip(y, -1, 1)) / np.pi, wrap=True)
