"""Many lights: each gives what it should, is seen where it stands, and the time grows with their logarithm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.described import describe, ground, lambert, look_at, orthographic, render, rotation, scaling, translation
from tests.described import light as described_light

from primray import core
from primray.description import Light, LightType
from primray.settings import Filter

from .lit_stages import irradiance, light, placed, prim, show

Measured = Callable[[str], None]


def scattered_lights(count: int, kind: str, *inputs: str) -> tuple[str, np.ndarray]:
    """Spread over 10 x 3 x 10 above the ground, as one stage's text and their places."""
    places = np.random.default_rng(count).uniform([-5, 0.5, -5], [5, 3.5, 5], (count, 3))
    texts = [
        light(kind, *inputs, at=placed(float(x), float(y), float(z), -90.0), name=f"light_{k}")
        for k, (x, y, z) in enumerate(places)
    ]
    return "".join(texts), places


@pytest.mark.parametrize("kind", ["SphereLight", "RectLight"])
@pytest.mark.hard_case("Lights", "1000 lights: %s", expected="the sum of their closed forms, to five standard errors")
def test_sum(kind: str, measured: Measured) -> None:
    size = (
        ("float inputs:radius = 1e-3",)
        if kind == "SphereLight"
        else ("float inputs:width = 1e-3", "float inputs:height = 1e-3")
    )
    text, places = scattered_lights(1000, kind, *size, "bool inputs:normalize = 1")
    found = irradiance(text, spp=1024)
    d = np.linalg.norm(places, axis=1)
    cosine = places[:, 1] / d
    lobe = 0.25 if kind == "SphereLight" else cosine
    wanted = float((lobe * cosine / d**2).sum())
    assert abs(found.mean - wanted) < 5 * found.noise + 2e-3 * wanted
    assert not found.noted
    measured(f"{found.mean / wanted:.2f} of it")


def mixed(count: int) -> list[Light]:
    rng = np.random.default_rng(5)
    shear = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])
    made = []
    for k in range(count):
        m = translation(*rng.uniform([-1, 0.3, -1], [1, 2, 1])) @ rotation(rng.normal(size=3), float(rng.uniform(0, 360)))
        m = m @ (shear if k % 5 == 0 else scaling(1, 1, 1))
        kind = (LightType.SPHERE, LightType.DISK, LightType.RECT, LightType.CYLINDER)[k % 4]
        r, g, b = (float(c) for c in rng.uniform(0.1, 1, 3))
        made.append(described_light(kind, m, (r, g, b), width=0.1, height=0.06, radius=0.04, length=0.2))
    return [*made, described_light(LightType.DISTANT, rotation([1, 0, 0], -60), 2.0, angle_deg=20.0)]


def test_lanes_agree() -> None:
    """The tree of many lights shows a lane nothing of its neighbours."""
    camera = orthographic(look_at([0, 1, 5], [0, 0.9, 0]), 1.2)
    d = describe([(ground(3), np.eye(4))], [lambert(0.8)], mixed(60), camera, (16, 16))
    images = [render(d.build(), 32, lanes=lanes, max_depth=3).replicates for lanes in (1, 4, core.lanes())]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])


def test_the_tree_leaves_out_no_light() -> None:
    """What a few at a time give, each tried by itself, they give together."""
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), 1.0, clipping_range=(1e-4, 1.0))
    lights = mixed(64)

    def image(some: list[Light]) -> np.ndarray:
        d = describe([(ground(3), np.eye(4))], [lambert(0.8)], some, camera, (8, 8))
        result = render(d.build(), 4096, max_depth=1)
        assert result.invalid_samples == 0
        return np.asarray(result.pixels(1.0)[..., :3], np.float64)

    together, apart = image(lights), sum(image(lights[k : k + 13]) for k in range(0, len(lights), 13))
    np.testing.assert_allclose(together.mean(axis=(0, 1)), np.mean(apart, axis=(0, 1)), rtol=3e-3)
    np.testing.assert_allclose(together, apart, rtol=0.05)


@pytest.mark.hard_case(
    "Lights", "500 sphere lights in front of each other", expected="the nearest one in every pixel, by numpy"
)
def test_the_nearest_is_seen(measured: Measured) -> None:
    rng = np.random.default_rng(3)
    places, colors = rng.uniform([-1, -1, -9], [1, 1, -2], (500, 3)), rng.uniform(0.1, 1, (500, 3))
    radius, n = 0.08, 48
    texts = [
        light(
            "SphereLight", f"float inputs:radius = {radius}", f"color3f inputs:color = ({c[0]}, {c[1]}, {c[2]})",
            at=placed(*map(float, p)), name=f"light_{k}",
        )
        for k, (p, c) in enumerate(zip(places, colors, strict=True))
    ]  # fmt: skip
    camera = prim(
        "Camera", "camera", "float2 clippingRange = (0.0001, 1000)", 'token projection = "orthographic"',
        "float horizontalAperture = 20", "float verticalAperture = 20",
    )  # fmt: skip
    found = show(camera, *texts, spp=64, resolution=(n, n), filter=Filter.BOX)
    # 8 x 8 rays a pixel.
    at = (np.arange(n * 8) + 0.5) / (n * 8) * 2 - 1
    y, x = np.meshgrid(-at, at, indexing="ij")
    depth, seen = np.full(x.shape, -np.inf), np.zeros((*x.shape, 3))
    for p, c in zip(places, colors.astype(np.float32), strict=True):
        r2 = (x - p[0]) ** 2 + (y - p[1]) ** 2
        front = np.where(r2 < radius**2, p[2] + np.sqrt(np.maximum(radius**2 - r2, 0)), -np.inf)
        nearer = front > depth
        depth[nearer], seen[nearer] = front[nearer], c
    wanted = seen.reshape(n, 8, n, 8, 3).mean(axis=(1, 3))
    flat = np.ptp(seen.reshape(n, 8, n, 8, 3), axis=(1, 3)).max(axis=-1) == 0  # one sphere alone, or none
    assert 0.2 < flat.mean() < 0.9
    off = np.abs(found.pixels - wanted).max(axis=-1)
    assert (off[flat] < 1e-5).mean() > 0.9  # but where a silhouette just enters between the rays
    assert off.mean() < 0.02
    measured(f"{(off[flat] < 1e-5).mean():.0%} of the pixels that one sphere fills are exactly its colour")


@pytest.mark.long
@pytest.mark.parametrize("kind", ["SphereLight", "RectLight"])
@pytest.mark.hard_case(
    "Lights", "100,000 lights: %s", expected="their sum; for 1000 times the lights less than 100 times the time",
)  # fmt: skip
def test_100_000(kind: str, measured: Measured) -> None:
    size = (
        ("float inputs:radius = 0.004",)
        if kind == "SphereLight"
        else ("float inputs:width = 0.01", "float inputs:height = 0.01")
    )
    seconds = {}
    for count in (100, 100_000):
        text, places = scattered_lights(count, kind, *size, "bool inputs:normalize = 1")
        found = irradiance(text, spp=4096, max_depth=2)
        seconds[count] = found.image.report["cpu_s"]
    d = np.linalg.norm(places, axis=1)
    cosine = places[:, 1] / d
    wanted = float(((0.25 if kind == "SphereLight" else cosine) * cosine / d**2).sum())
    assert abs(found.mean - wanted) < 5 * found.noise + 5e-3 * wanted
    assert seconds[100_000] < 100 * seconds[100] + 0.5  # a list of them takes 1000 times as long
    measured(f"{found.mean / wanted:.2f} of it")
