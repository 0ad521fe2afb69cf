"""What a case's picture is: the irradiance of the plane, by quadrature, averaged over each pixel.

It knows nothing of primray: this module and those that it imports are USD, numpy and formulas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pxr import Usd
from tests.reference.adaptive import Doubles
from tests.reference.emitters import Emitter, emitters
from tests.reference.irradiance import ORDER, irradiance
from tests.reference.stages import Plane

_PIXEL_TOLERANCE = 1e-3  # of the largest pixel: what the middle of a part may differ from its Gauss points, times its share
_LEVELS = 5
_KINKED = 4


@dataclass(frozen=True)
class Referees:
    """The referee's picture (H, W, 3), every pixel the average over its square, and its relative error."""

    picture: Doubles
    error: float


def expected(stage: Usd.Stage, plane: Plane, resolution: tuple[int, int]) -> Referees:
    lights = emitters(stage)
    width, height = resolution
    j, i = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    x, z = (2 * i.ravel() + 1) / width - 1, (2 * j.ravel() + 1) / height - 1
    value, error = _average(lights, plane, x, z, np.full(x.size, 1 / width), np.full(x.size, 1 / height))
    top = max(float(value.max()), 1e-300)
    probe = np.argsort(value.max(axis=1))[:: max(1, x.size // 24)]
    p = plane.world(x[probe], z[probe])
    two = [irradiance(lights, p, plane.normal, order).value for order in (ORDER, ORDER + ORDER // 2)]
    within = np.abs(two[0] - two[1]).max() / max(two[1].max(), 1e-300)
    return Referees(value.reshape(height, width, 3) / math.pi, float(error / top + within))


def _average(lights: list[Emitter], plane: Plane, x: Doubles, z: Doubles, hx: Doubles, hz: Doubles) -> tuple[Doubles, float]:
    """Over rectangles: 2 x 2 Gauss points, quartered where the middle says otherwise."""
    value, error = np.zeros((x.size, 3)), 0.0
    cell, share = np.arange(x.size), np.ones(x.size)
    top = 0.0
    # A point with a profile throws its kinks on the plane as they are, between the points that would tell.
    least = _KINKED if any(light.point_or_line and light.shaping is not None for light in lights) else 0
    for level in range(_LEVELS):
        fine, bound = _gauss(lights, plane, x, z, hx, hz, 2)
        coarse, _ = _gauss(lights, plane, x, z, hx, hz, 1)
        top = max(top, float(fine.max(initial=0.0)))
        alike = np.abs(fine - coarse).max(axis=1) * share <= _PIXEL_TOLERANCE * top
        done = (alike & (level >= least)) | (level == _LEVELS - 1)
        np.add.at(value, cell[done], (fine * share[:, None])[done])
        error = max(error, bound)
        if done.all():
            break
        x, z, hx, hz, cell, share = (a[~done] for a in (x, z, hx, hz, cell, share))
        x = np.concatenate([x - hx / 2, x + hx / 2, x - hx / 2, x + hx / 2])
        z = np.concatenate([z - hz / 2, z - hz / 2, z + hz / 2, z + hz / 2])
        hx, hz, share, cell = np.tile(hx, 4) / 2, np.tile(hz, 4) / 2, np.tile(share, 4) / 4, np.tile(cell, 4)
    return value, error


def _gauss(
    lights: list[Emitter], plane: Plane, x: Doubles, z: Doubles, hx: Doubles, hz: Doubles, order: int
) -> tuple[Doubles, float]:
    nodes, weights = np.polynomial.legendre.leggauss(order)
    a, b = (g.ravel() for g in np.meshgrid(nodes, nodes, indexing="ij"))
    p = plane.world(x[:, None] + hx[:, None] * a, z[:, None] + hz[:, None] * b)
    e = irradiance(lights, p.reshape(-1, 3), plane.normal)
    weight = np.outer(weights, weights).ravel() / 4
    value: Doubles = np.einsum("qkc,k->qc", e.value.reshape(x.size, -1, 3), weight)
    return value, float(e.error.max(initial=0.0))
