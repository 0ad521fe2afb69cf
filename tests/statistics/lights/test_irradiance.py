"""A Lambert plane under every light against quadrature written from UsdLux's text: means, and each pixel by z-test."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.statistics.lights.placed_lights import irradiances

from primray.description import Light, LightType

RESOLUTION = 8  # pixels a side
HALF = 1.5  # of what the camera sees of the plane
SPP = 256
ALBEDO = (0.8, 0.5, 0.2)
ABOVE = translation(0.3, 1.4, -0.4) @ rotation([1, 0.2, 0.3], -80)
SHEAR = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])

LIGHTS: dict[str, Light] = {
    "point": light(LightType.POINT, ABOVE),
    "sphere": light(LightType.SPHERE, ABOVE, radius=0.4),
    "tiny sphere": light(LightType.SPHERE, ABOVE, radius=1e-3),
    "ellipsoid": light(LightType.SPHERE, ABOVE @ scaling(1.5, 0.4, 0.8), radius=0.4),
    "sphere near the plane": light(LightType.SPHERE, translation(0.2, 0.45, 0.1), radius=0.4),
    "disk": light(LightType.DISK, ABOVE, radius=0.6),
    "ellipse": light(LightType.DISK, ABOVE @ scaling(1.6, 0.5, 1), radius=0.5),
    "rect": light(LightType.RECT, ABOVE, width=1.2, height=0.7),
    "large rect": light(LightType.RECT, translation(0, 0.6, 0) @ rotation([1, 0, 0], -90), width=20.0, height=20.0),
    "sheared rect": light(LightType.RECT, ABOVE @ SHEAR, width=1.2, height=0.7),
    "sheared sphere": light(LightType.SPHERE, ABOVE @ SHEAR, radius=0.4),
    "sheared disk": light(LightType.DISK, ABOVE @ SHEAR, radius=0.6),
    "sheared cylinder": light(LightType.CYLINDER, ABOVE @ SHEAR, radius=0.2, length=1.3),
    "flat ellipsoid": light(LightType.SPHERE, ABOVE @ scaling(1.5, 1.0, 0.01), radius=0.4),
    "upright rect": light(LightType.RECT, translation(0, 0.5, -1.7) @ rotation([0, 1, 0], 180), width=2.0, height=1.4),
    "cylinder": light(LightType.CYLINDER, ABOVE, radius=0.2, length=1.5),
    "scaled cylinder": light(LightType.CYLINDER, ABOVE @ scaling(1.4, 0.5, 0.9), radius=0.3, length=1.0),
    "sun": light(LightType.DISTANT, ABOVE, angle_deg=0.53),
    "delta sun": light(LightType.DISTANT, ABOVE),
    "distant 10": light(LightType.DISTANT, ABOVE, angle_deg=10.0),
    "distant 120": light(LightType.DISTANT, ABOVE, angle_deg=120.0),
    "distant 180": light(LightType.DISTANT, ABOVE, angle_deg=180.0),
    "distant 300": light(LightType.DISTANT, ABOVE, angle_deg=300.0),
}


def plane_under(x: Light, texture: np.ndarray | None = None) -> Described:
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), HALF, clipping_range=(1e-4, 1.0))
    return describe([(ground(5), np.eye(4))], [lambert(ALBEDO)], [x], camera, (RESOLUTION, RESOLUTION), dome_texture=texture)


def film_points() -> tuple[np.ndarray, np.ndarray]:
    """Three Gauss points along each axis of every pixel, on the plane: (H, W, 9, 3), and their weights (9,)."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    c = ((np.arange(RESOLUTION)[:, None] + 0.5 + nodes / 2) / RESOLUTION * 2 - 1) * HALF
    z, x = np.meshgrid(c.ravel(), c.ravel(), indexing="ij")
    p = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(RESOLUTION, 3, RESOLUTION, 3, 3)
    return p.transpose(0, 2, 1, 3, 4).reshape(RESOLUTION, RESOLUTION, 9, 3), np.outer(weights, weights).ravel() / 4


def compare(result: object, expected: np.ndarray) -> float:
    """Checks the image's mean to 0.1 % and each pixel's z; returns the mean's deviation. `expected`: (H, W) irradiance."""
    per_replicate = replicate_means(result)
    image = per_replicate.mean(axis=0) / (np.array(ALBEDO) / math.pi)
    assert result.invalid_samples == 0  # type: ignore[attr-defined]
    np.testing.assert_allclose(image, np.broadcast_to(image[..., :1], image.shape), rtol=1e-4, atol=1e-6)
    image = image[..., 0]
    # Two replicates give one degree of freedom a pixel; the variance is pooled over a pixel and all like it: the whole image.
    half_difference = (per_replicate[0] - per_replicate[1])[..., 0] / 2 / (ALBEDO[0] / math.pi)
    relative = half_difference / np.maximum(expected, 0.05 * expected.max())
    sigma = np.maximum(math.sqrt(np.mean(relative**2)), 1e-4) * np.maximum(expected, 0.05 * expected.max())
    z = (image - expected) / sigma
    deviation = float(abs(image.mean() / expected.mean() - 1))
    noise = float(np.sqrt(np.mean(sigma**2)) / RESOLUTION / expected.mean())
    assert deviation < 1e-3 + 3 * noise
    # Bonferroni: 1 in 1000 over all pixels if normal; variances differ from pixel to pixel, hence half as much again.
    assert np.abs(z).max() < 1.5 * 5.0
    return deviation


def expected_irradiance(x: Light) -> np.ndarray:
    p, weights = film_points()
    steps = 160 if x.type in (LightType.CYLINDER, LightType.SPHERE) else 64
    e = irradiances(x, p.reshape(-1, 3), [0, 1, 0], steps)
    return e.reshape(RESOLUTION, RESOLUTION, 9) @ weights


@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance(name: str) -> None:
    x = LIGHTS[name]
    # A light that stands on the ground has heavy tails, which 256 samples' own spread understates.
    result = render(plane_under(x).build(), 16 * SPP if name == "upright rect" else SPP)
    compare(result, expected_irradiance(x))


TEXTURE = np.random.default_rng(8).random((8, 16, 1)).astype(np.float32) ** 6 * np.ones(3, np.float32)


@pytest.mark.parametrize("diffuse", [1.0, 0.5])
def test_textured_dome(diffuse: float) -> None:
    m = rotation([1, 2, -1], 70)
    steps = 700
    u, v = np.meshgrid((np.arange(steps) + 0.5) / steps, (np.arange(steps) + 0.5) / steps, indexing="ij")
    r, y = np.sqrt(u), np.sqrt(1 - u)
    w = np.stack([r * np.cos(2 * np.pi * v), y, r * np.sin(2 * np.pi * v)], axis=-1).reshape(-1, 3)
    a, b, c = (w @ m[:3, :3]).T
    s, t = (0.5 - np.arctan2(a, c) / (2 * np.pi)) * 16 - 0.5, np.arccos(b) / np.pi * 8 - 0.5
    i, j = np.floor(s).astype(int), np.floor(t).astype(int)
    fs, ft = s - i, t - j

    def texel(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return TEXTURE[np.clip(row, 0, 7), column % 16, 0].astype(float)

    L = (texel(j, i) * (1 - fs) + texel(j, i + 1) * fs) * (1 - ft) + (
        texel(j + 1, i) * (1 - fs) + texel(j + 1, i + 1) * fs
    ) * ft
    expected = np.full((RESOLUTION, RESOLUTION), math.pi * L.mean() * diffuse)
    compare(render(plane_under(light(LightType.DOME, m, diffuse=diffuse), TEXTURE).build(), SPP), expected)


def test_constant_dome_is_exact() -> None:
    result = render(plane_under(light(LightType.DOME, emission=0.7)).build(), 16)
    np.testing.assert_allclose(
        replicate_means(result), np.broadcast_to(np.array(ALBEDO) * 0.7, (2, RESOLUTION, RESOLUTION, 3)), rtol=2e-5
    )


def test_lights_add_up() -> None:
    names = ("point", "rect", "sphere", "cylinder", "distant 10", "disk")
    d = plane_under(LIGHTS["point"]).description
    together = Described(replace(d, lights=tuple(LIGHTS[n] for n in names)), {})
    compare(render(together.build(), SPP), np.sum([expected_irradiance(LIGHTS[n]) for n in names], axis=0))


ELONGATED = {
    "SphereLight": ("float inputs:radius = 0.3", light(LightType.SPHERE, np.eye(4), radius=0.3)),
    "DiskLight": ("float inputs:radius = 0.4", light(LightType.DISK, np.eye(4), radius=0.4)),
    "RectLight": (
        "float inputs:width = 0.5\nfloat inputs:height = 0.8",
        light(LightType.RECT, np.eye(4), width=0.5, height=0.8),
    ),
    "CylinderLight": (
        "float inputs:radius = 0.15\nfloat inputs:length = 0.9",
        light(LightType.CYLINDER, np.eye(4), radius=0.15, length=0.9),
    ),
}
WARPS = {"scaled": scaling(1.7, 0.4, 0.9), "sheared": SHEAR @ rotation([1, 2, 3], 30)}


@pytest.mark.conforms(
    "LightAPI.inputs:normalize", "LightAPI.inputs:intensity", "SphereLight.inputs:radius", "DiskLight.inputs:radius",
    "RectLight.inputs:width", "RectLight.inputs:height", "CylinderLight.inputs:radius", "CylinderLight.inputs:length",
)  # fmt: skip
@pytest.mark.parametrize("kind", ELONGATED)
@pytest.mark.parametrize("warp", WARPS)
def test_normalized_and_warped_stages(kind: str, warp: str) -> None:
    """From a stage: irradiance by quadrature over the warped surface, divided by the quadrature's own area."""
    from pxr import Usd
    from tests.statistics.lights.placed_lights import patches

    from primray.settings import RenderSettings
    from primray.usd import translate

    body, x = ELONGATED[kind]
    m = ABOVE @ WARPS[warp]
    rows = ", ".join(f"({', '.join(repr(float(v)) for v in row)})" for row in m.T)
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(
        f'#usda 1.0\ndef {kind} "l"\n{{\n{body}\nfloat inputs:intensity = 7\nbool inputs:normalize = 1\n'
        f'matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = ["xformOp:transform"]\n}}\n'
    )
    (translated,) = translate(stage, RenderSettings())[0].lights
    x = replace(x, world_from_light=m)
    area = patches(x, 1000).area.sum()
    result = render(plane_under(translated).build(), SPP)
    compare(result, expected_irradiance(x) * 7 / area)
