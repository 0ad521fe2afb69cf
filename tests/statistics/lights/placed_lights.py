"""The lights that the tests look at, each in several positions, and what UsdLux says of them, in double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from tests.described import Described, describe, light, rotation, scaling, translation

from primray.description import Doubles, Light, LightType

PLACED = translation(0.3, 1.1, -0.2) @ rotation([1, 0.3, 0.2], -75)
SHEAR = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])

LIGHTS: dict[str, Light] = {
    "sphere": light(LightType.SPHERE, PLACED, radius=0.4),
    "small sphere": light(LightType.SPHERE, PLACED, radius=1e-3),
    "ellipsoid": light(LightType.SPHERE, PLACED @ scaling(1, 0.3, 0.6), radius=0.4),
    "sheared sphere": light(LightType.SPHERE, PLACED @ SHEAR, radius=0.3),
    "disk": light(LightType.DISK, PLACED, radius=0.5),
    "ellipse": light(LightType.DISK, PLACED @ scaling(1.3, 0.4, 1), radius=0.5),
    "sheared disk": light(LightType.DISK, PLACED @ SHEAR, radius=0.4),
    "rect": light(LightType.RECT, PLACED, width=0.8, height=0.5),
    "scaled rect": light(LightType.RECT, PLACED @ scaling(2, 0.5, 3), width=0.8, height=0.9),
    "long rect": light(LightType.RECT, PLACED, width=4.0, height=0.02),
    "sheared rect": light(LightType.RECT, PLACED @ SHEAR, width=0.8, height=0.5),
    "mirrored rect": light(LightType.RECT, PLACED @ scaling(-1, 1, 1), width=0.8, height=0.5),
    "cylinder": light(LightType.CYLINDER, PLACED, radius=0.2, length=1.4),
    "scaled cylinder": light(LightType.CYLINDER, PLACED @ scaling(1.5, 0.7, 0.7), radius=0.2, length=0.8),
    "sheared cylinder": light(LightType.CYLINDER, PLACED @ SHEAR, radius=0.15, length=1.0),
    "sun": light(LightType.DISTANT, PLACED, angle_deg=0.53),
    "distant 10": light(LightType.DISTANT, PLACED, angle_deg=10.0),
    "distant 180": light(LightType.DISTANT, PLACED, angle_deg=180.0),
    "distant 300": light(LightType.DISTANT, PLACED, angle_deg=300.0),
}

# In the light's own frame, scaled by its size: where it is looked at from.
VIEWS: dict[str, tuple[float, float, float]] = {
    "near": (0.1, 0.05, -0.6),
    "middle": (0.4, -0.7, -1.5),
    "far": (3.0, 2.0, -12.0),
    "grazing": (1.6, 1.0, -0.03),
    "beside": (0.2, 1.5, -0.2),
    "on the axis": (0.0, 0.0, -1.2),
    "along x": (2.5, 0.3, -0.1),
    "inside": (0.1, 0.05, -0.1),
    "behind": (0.1, 0.3, 1.0),
}


def view_point(x: Light, view: str) -> Doubles:
    return (x.world_from_light @ [*VIEWS[view], 1.0])[:3]


def only(x: Light, dome_texture: npt.ArrayLike | None = None) -> Described:
    return describe(lights=[x], dome_texture=dome_texture)


@dataclass(frozen=True)
class Patches:
    """Small pieces of a light's emitting surface in world space: points, outward normals, areas."""

    p: Doubles
    n: Doubles
    area: Doubles


def patches(x: Light, steps: int = 400, steps_v: int = 0) -> Patches:
    """UsdLux: sphere; disk and rect in XY facing -Z; cylinder along X without caps. Midpoints of a grid of (u, v), mapped by
    the matrix; normals and areas by its cofactors."""
    steps_v = steps_v or steps
    u, v = (
        a.ravel() for a in np.meshgrid((np.arange(steps) + 0.5) / steps, (np.arange(steps_v) + 0.5) / steps_v, indexing="ij")
    )
    one, zero, a = np.ones_like(u), np.zeros_like(u), 2 * np.pi * v
    if x.type is LightType.RECT:
        p = np.stack([(u - 0.5) * x.width, (v - 0.5) * x.height, zero], axis=1)
        n, area = np.stack([zero, zero, -one], axis=1), x.width * x.height
    elif x.type is LightType.DISK:
        p = np.stack([np.sqrt(u) * np.cos(a), np.sqrt(u) * np.sin(a), zero], axis=1) * x.radius
        n, area = np.stack([zero, zero, -one], axis=1), np.pi * x.radius**2
    elif x.type is LightType.SPHERE:
        r = 2 * np.sqrt(u * (1 - u))
        n = np.stack([r * np.cos(a), r * np.sin(a), 1 - 2 * u], axis=1)
        p, area = n * x.radius, 4 * np.pi * x.radius**2
    elif x.type is LightType.CYLINDER:
        n = np.stack([zero, np.cos(a), np.sin(a)], axis=1)
        p, area = n * x.radius + np.stack([(u - 0.5) * x.length, zero, zero], axis=1), 2 * np.pi * x.radius * x.length
    else:
        raise ValueError(x.type)
    m = x.world_from_light
    cofactors = np.linalg.inv(m[:3, :3]).T * abs(np.linalg.det(m[:3, :3]))
    mapped = n @ cofactors.T
    length = np.linalg.norm(mapped, axis=1)
    return Patches(p @ m[:3, :3].T + m[:3, 3], mapped / length[:, None], length * (area / len(u)))


def parameters(x: Light, p: Doubles) -> Doubles:
    """The (u, v) of `patches` at points of the light's surface in world space, (N, 2)."""
    q = (p - x.world_from_light[:3, 3]) @ np.linalg.inv(x.world_from_light[:3, :3]).T
    turn = (np.arctan2(q[:, 2], q[:, 1]) if x.type is LightType.CYLINDER else np.arctan2(q[:, 1], q[:, 0])) / (2 * np.pi) % 1.0
    if x.type is LightType.RECT:
        return q[:, :2] / [x.width, x.height] + 0.5
    if x.type is LightType.DISK:
        return np.stack([np.sum(q[:, :2] ** 2, axis=1) / x.radius**2, turn], axis=1)
    if x.type is LightType.SPHERE:
        return np.stack([(1 - q[:, 2] / np.linalg.norm(q, axis=1)) / 2, turn], axis=1)
    return np.stack([q[:, 0] / x.length + 0.5, turn], axis=1)


def irradiances(x: Light, points: Doubles, n: npt.ArrayLike, steps: int) -> Doubles:
    """At points (N, 3) of a plane with normal n, unoccluded, for radiance (or point intensity, or delta irradiance) 1."""
    n = np.asarray(n, np.float64)
    if x.type is LightType.POINT:
        to = x.world_from_light[:3, 3] - points
        return np.maximum(to @ n, 0) / np.linalg.norm(to, axis=1) ** 3
    if x.type is LightType.DISTANT:
        return np.full(len(points), distant_irradiance(x, n))
    s = patches(x, steps)
    result = []
    for p in points:
        to = s.p - p
        d2 = np.einsum("ij,ij->i", to, to)
        cosines = np.maximum(to @ n, 0) * np.maximum(-np.einsum("ij,ij->i", to, s.n), 0)
        result.append(np.sum(cosines * s.area / (d2 * d2)))
    return np.array(result)


def distant_irradiance(x: Light, n: Doubles, steps: int = 1500) -> float:
    axis = x.world_from_light[:3, 2] / np.linalg.norm(x.world_from_light[:3, 2])
    if x.angle_deg == 0:
        return max(float(axis @ n), 0.0)
    spread = 2 * np.sin(np.radians(x.angle_deg) / 4) ** 2
    u, v = np.meshgrid((np.arange(steps) + 0.5) / steps, (np.arange(steps) + 0.5) / steps, indexing="ij")
    z = 1 - u * spread
    r = np.sqrt(u * spread * (2 - u * spread))
    t = np.linalg.svd(axis[None])[2][1:]
    w = (r * np.cos(2 * np.pi * v))[..., None] * t[0] + (r * np.sin(2 * np.pi * v))[..., None] * t[1] + z[..., None] * axis
    return float(np.maximum(w @ n, 0).mean() * 2 * np.pi * spread)
