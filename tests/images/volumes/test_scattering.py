"""Light that smoke scatters once: closed forms in slabs, and quadrature along the camera's ray near point lights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.described import describe, light, rotation, scaling, translation
from tests.images.volumes.voxels import Array, along, block, check, depth_along, medium, picture, voxels
from tests.statistics.media.phases import henyey_greenstein as phase

from primray.description import Light, LightType, Shaping, VolumeMedium

SIZE = (32, 32)
# Eight voxels across x, and wide along y and z.
WIDE = translation(0, -8e3, -8e3) @ scaling(1, 1e3, 1e3)
INTO = along((1, 0, 0), (4, 0, 0), half=1e-2)


def slab(extinction: Any, albedo: Any = 1.0, **more: Any) -> VolumeMedium:
    return medium(voxels(np.ones((8, 16, 16))), extinction, albedo, matrices=[WIDE], **more)


def sun(direction: Any, irradiance: Any = 1.0) -> Light:
    """Return a light that travels along `direction`."""
    z = -np.array(direction, np.float64) / np.linalg.norm(direction)
    aside = np.cross((0, 1, 0) if abs(z[1]) < 0.9 else (1, 0, 0), z).astype(np.float64)
    x = aside / np.linalg.norm(aside)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return light(LightType.DISTANT, matrix, irradiance)


def once(media: list[VolumeMedium], lights: list[Light], spp: int, camera: Any = INTO, **more: Any) -> Array:
    """Return light that is scattered at most once."""
    return picture(
        describe(media=media, lights=lights, camera=camera, resolution=SIZE, **more), spp, max_depth=1
    )  # fmt: skip


@pytest.mark.parametrize(
    ("direction", "g"),
    [((1, 0, 0), 0.0), ((1, 0, 0), 0.8), ((0.5, 0.7, 0.2), -0.5), ((-0.6, 0.3, -0.5), 0.8), ((-1, 0, 0), -0.5)],
)
def test_a_sun_and_a_slab(direction: tuple[float, float, float], g: float) -> None:
    d = np.array(direction) / np.linalg.norm(direction)
    depth, mu = 0.8, abs(d[0])
    if d[0] > 0:  # the sun and the camera are on one side
        along_ray = (1 - math.exp(-depth * (1 + 1 / mu))) / (1 + 1 / mu)
    else:
        along_ray = (
            math.exp(-depth / mu) * (math.expm1(depth * (1 / mu - 1)) / (1 / mu - 1)) if mu < 1 else depth * math.exp(-depth)
        )
    wanted = 0.7 * phase(-d[0], g) * along_ray
    check(once([slab(0.1, 0.7, anisotropy=g)], [sun(d)], 5500), wanted)


def test_colored_slabs() -> None:
    """Extinction, albedo and the sun have colors, and an albedo grid is multiplied with the albedo."""
    colors, extinction = np.array((0.9, 0.5, 0.2)), np.array((0.05, 0.1, 0.2))
    tau = 8 * extinction
    wanted = colors / (4 * math.pi) * (1 - np.exp(-2 * tau)) / 2
    forward = sun((1, 0, 0))
    check(once([slab(tuple(extinction), tuple(colors))], [forward], 8192), wanted)
    check(once([slab(tuple(extinction))], [sun((1, 0, 0), tuple(colors))], 8192), wanted)
    tint = voxels(np.broadcast_to(colors / 0.9, (8, 16, 16, 3)))
    check(once([slab(tuple(extinction), 0.9, albedo_grid=tint)], [forward], 8192), wanted)


def test_an_albedo_grid() -> None:
    """Half of the slab scatters; the albedo is that of the voxel that is chosen, and 0 where the grid has none."""
    colors = np.zeros((8, 16, 16, 3), np.float32)
    colors[:, :8] = 1.0
    matrix = translation(0, -7.5, -8) @ scaling(1, 1, 1)
    cloud = medium(voxels(np.ones((8, 16, 16))), 0.1, 0.8, albedo_grid=voxels(colors), matrices=[matrix])
    wanted = 0.8 / (4 * math.pi) * (1 - math.exp(-1.6)) / 2
    for y, part in ((-3, 1.0), (0.25, 0.25), (0.0, 0.5)):
        check(once([cloud], [sun((1, 0, 0))], 4096, along((1, 0, 0), (4, y, 0), half=1e-3)), part * wanted, 0.005)
    far = medium(
        voxels(np.ones((8, 16, 16)), (8000, 0, 0)),
        0.1,
        0.8,
        albedo_grid=voxels(colors, (8000, 0, 0)),
        matrices=[matrix @ translation(-8000, 0, 0)],
    )
    check(once([far], [sun((1, 0, 0))], 4096, along((1, 0, 0), (4, -3, 0), half=1e-3)), wanted, 0.003)


def test_slabs_that_overlap() -> None:
    """Of two media at a point each scatters its own share, by its own phase function."""
    one, other = slab(0.06, 0.9, anisotropy=0.6), slab(0.04, 0.3, anisotropy=-0.4)
    along_ray = (1 - math.exp(-1.6)) / 2
    wanted = (0.6 * 0.9 * phase(-1, 0.6) + 0.4 * 0.3 * phase(-1, -0.4)) * along_ray
    check(once([one, other], [sun((1, 0, 0))], 10_000), wanted)


FOG = voxels(np.ones((32, 32, 32)), (-16, -16, -16))


def fog(points: Array) -> Array:
    """Return the values of FOG at `points`, as FOG.sample() does."""
    return np.clip(np.minimum(points + 17, 16 - points), 0, 1).prod(axis=-1)


def airlight(
    density_at: Any, places: Any, power: Any, k: float, g: float, y: float, reaches: Any = None, steps: int = 1000
) -> float:
    """Return the light of points with intensity `power` (P,) at `places` (P, 3) that is scattered along the ray (x, y, 0).

    `reaches(points)`: factor (N, P) of the intensity.
    """
    x = np.concatenate([np.linspace(-17.5, 17.5, steps), *(p[0] + np.tan(np.linspace(-1.5, 1.5, steps)) for p in places[:4])])
    x = np.sort(x[(x > -17.5) & (x < 17.5)])
    middle, width = (x[1:] + x[:-1]) / 2, np.diff(x)
    points = np.stack([middle, np.full(len(middle), y), np.zeros(len(middle))], -1)
    density = density_at(points)
    before = np.concatenate([[0.0], np.cumsum(density * width)])
    depth = (before[1:] + before[:-1]) / 2
    total = 0.0
    for i, place in enumerate(places):
        to = points - place
        r = np.linalg.norm(to, axis=1)
        s = (np.arange(64) + 0.5) / 64
        towards = place + to[:, None] * s[None, :, None]
        tau = density_at(towards.reshape(-1, 3)).reshape(len(points), -1).mean(axis=1) * r
        factor = power[i] / r**2 if reaches is None else power[i] / r**2 * reaches(i, to / r[:, None])
        total += (density * k * factor * phase(-to[:, 0] / r, g) * np.exp(-k * (tau + depth)) * width).sum()
    return float(total)


@pytest.mark.parametrize("g", [-0.5, 0.0, 0.8])
@pytest.mark.parametrize("place", [(2.0, 1.5, -1.0), (-5.0, 9.0, 3.0), (0.0, 25.0, 0.0), (-10.0, 0.05, 0.0)])
def test_the_airlight_of_a_point(place: tuple[float, float, float], g: float) -> None:
    """Within the fog, near the ray and far from it, above the fog, and almost on the ray."""
    k = 0.05
    wanted = 0.8 * airlight(fog, np.array([place]), [3.0], k, g, 0.0)
    lamp = light(LightType.POINT, translation(*place), 3.0)
    check(once([medium(FOG, k, 0.8, anisotropy=g)], [lamp], 4096, along((1, 0, 0), (0, 0, 0), half=1e-4)), wanted, 0.004)


def test_two_points_in_a_cloud() -> None:
    rng = np.random.default_rng(8)
    grid = voxels(rng.random((16, 16, 16)) ** 2, (-8, -8, -8))
    places, k = np.array([(3.2, 2.1, 0.3), (-9.0, -4.0, 6.0)]), 0.1
    wanted = airlight(grid.sample, places, [2.0, 7.0], k, 0.3, 0.0)
    lamps = [light(LightType.POINT, translation(*p), i) for p, i in zip(places, (2.0, 7.0), strict=True)]
    check(once([medium(grid, k, 1.0, anisotropy=0.3)], lamps, 6144, along((1, 0, 0), (0, 0, 0), half=1e-4)), wanted, 0.004)


@pytest.mark.parametrize("angle", [15.0, 50.0, 85.0])
def test_a_spot(angle: float) -> None:
    """A cone with a hard edge: the part of the ray within it is lit."""
    place, k = np.array([(1.0, 6.0, 0.0)]), 0.04
    spot = light(
        LightType.POINT, translation(*place[0]) @ rotation((1, 0, 0), -90), 5.0, shaping=Shaping(cone_angle_deg=angle)
    )  # fmt: skip
    least = math.cos(math.radians(angle))
    wanted = airlight(fog, place, [5.0], k, 0.4, 0.0, lambda _, d: -d[:, 1] > least, steps=10_000)
    smoke = [medium(FOG, k, 1.0, anisotropy=0.4)]
    check(once(smoke, [spot], 4096, along((1, 0, 0), (0, 0, 0), half=1e-4)), wanted, 0.004)


def test_a_rect_light() -> None:
    """A rectangle of 2 by 1 that shines downwards, as 50 points."""
    k = 0.04
    matrix = translation(1, 5, 0) @ rotation((1, 0, 0), -90)
    lamp = light(LightType.RECT, matrix, 2.0, width=2.0, height=1.0)
    u, v = np.meshgrid((np.arange(10) + 0.5) / 10 * 2 - 1, (np.arange(5) + 0.5) / 5 - 0.5)
    places = np.array([(matrix @ [a, b, 0, 1])[:3] for a, b in zip(u.ravel(), v.ravel(), strict=True)])
    power = [2.0 * 2.0 / 50] * 50
    wanted = airlight(fog, places, power, k, 0.5, 0.0, lambda _, d: np.maximum(-d[:, 1], 0), steps=200)
    smoke = [medium(FOG, k, 1.0, anisotropy=0.5)]
    check(once(smoke, [lamp], 4096, along((1, 0, 0), (0, 0, 0), half=1e-4)), wanted, 0.004)


def test_a_sky_over_a_slab() -> None:
    """Scattered once, isotropically: at depth t the mean transmittance of all directions is (E2(t) + E2(d - t)) / 2."""
    depth = 0.8
    t = (np.arange(2000) + 0.5) / 2000 * depth
    mu = (np.arange(4000) + 0.5) / 4000

    def e2(x: Array) -> Array:
        return np.exp(-x[:, None] / mu).mean(axis=1)

    mean = (e2(t) + e2(depth - t)) / 2
    wanted = math.exp(-depth) + 0.9 * (np.exp(-t) * mean).mean() * depth
    check(once([slab(0.1, 0.9)], [light(LightType.DOME)], 2048), wanted)


def test_a_lamp_that_smoke_dims() -> None:
    """Depth 0: what of a lamp's body is seen through smoke, inside of its outline and at its edge."""
    ball = light(LightType.SPHERE, translation(20, 3.5, 3.5), 2.0, radius=3.0)
    smoke = [medium(block(), 0.05)]
    camera = along((1, 0, 0), (3.5, 3.5, 3.5), half=1.0)
    check(picture(describe(media=smoke, lights=[ball], camera=camera, resolution=SIZE), 1536), 2 * math.exp(-0.4))
    whole = along((1, 0, 0), (3.5, 3.5, 3.5), half=3.5)
    pixels = picture(describe(media=smoke, lights=[ball], camera=whole, resolution=SIZE), 1024)
    # The whole disk is seen: its area of the picture, through voxels that are all 1 within 3.5 of their middle.
    assert pixels.mean() == pytest.approx(2 * math.exp(-0.4) * math.pi * 9 / 49, rel=0.002)
    assert depth_along(block(), (-5, 6.4, 3.5), (1, 0, 0), 20.0) == pytest.approx(8.0)
