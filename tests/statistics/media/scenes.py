"""Scenes with volumes and fog, described directly, and their mean pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from tests.described import describe, light, orthographic, render, translation

from primray.description import (
    Camera,
    CameraVisibility,
    Doubles,
    Fog,
    HomogeneousVolume,
    Light,
    LightType,
    OpenPbr,
    Shape,
    Surface,
    volume_boundary,
)

Color = float | tuple[float, float, float]
HERE = np.eye(4)
SKY = light(LightType.DOME)
SUN_DIRECTION = np.array([0.0, math.sqrt(0.75), 0.5])  # towards it: 60 degrees from +z


def color(x: Color) -> tuple[float, float, float]:
    return x if isinstance(x, tuple) else (x, x, x)


def volume(
    extinction: Color, albedo: Color = 1.0, g: float = 0.0, emission: Color = 0.0, path: str = "/volume",
    camera: CameraVisibility = CameraVisibility.SEEN, droplets: float = 0.0,
) -> Surface:  # fmt: skip
    e, a = color(extinction), color(albedo)
    scattering = (e[0] * a[0], e[1] * a[1], e[2] * a[2])
    inside = HomogeneousVolume(
        path=path, extinction=e, scattering=scattering, emission=color(emission), anisotropy=g, droplets=droplets
    )
    return volume_boundary(inside, camera=camera)


def air(**inputs: Any) -> Surface:
    """An OpenPBR body without reflection."""
    lobes = OpenPbr(base_weight=0.0, specular_weight=0.0, transmission_weight=1.0, **inputs)
    return Surface("/air", open_pbr=lobes)


def sun(irradiance: float = 1.0, towards: Sequence[float] | Doubles = SUN_DIRECTION) -> Light:
    """A distant light with this irradiance on a plane that faces it; a small disk, since a point has no radiance."""
    z = np.asarray(towards, np.float64)
    x = np.cross([1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    angle = 0.2
    radiance = irradiance / (math.pi * math.sin(math.radians(angle / 2)) ** 2)
    return light(LightType.DISTANT, m, radiance, angle_deg=angle)


def mean(
    shapes: Sequence[tuple[Shape, Doubles]], surfaces: Sequence[Surface], lights: Sequence[Light] = (SKY,),
    camera: Camera | None = None, spp: int = 64, fog: Fog | None = None, at: Doubles = HERE, **settings: Any,
) -> Doubles:  # fmt: skip
    """Mean R, G, B and coverage of 8 x 8 pixels; by default before an orthographic camera at z = 10 that looks down."""
    described = describe(shapes, surfaces, lights, camera or orthographic(translation(0, 0, 10), 0.1)).moved(at)
    described = replace(described, description=replace(described.description, fog=fog))
    return np.asarray(render(described.build(), spp, **settings).pixels(), np.float64).mean((0, 1))
