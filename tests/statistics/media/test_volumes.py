"""Volumes without an interface against closed forms: absorption, emission, scattering, overlaps, and bodies in them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from tests.described import box, describe, lambert, light, orthographic, placement, quad, render, scaling, translation
from tests.statistics.media.phases import henyey_greenstein
from tests.statistics.media.scenes import (
    HERE,
    SKY,
    SUN_DIRECTION,
    air,
    mean,
    sun,
    volume,
)

from primray.description import (
    Camera,
    CameraVisibility,
    Doubles,
    LightType,
    OpenPbr,
    Placed,
    Prototype,
    Shape,
    Sphere,
    Surface,
)

SLAB = (box((4, 4, 2)), HERE)
COLORS = (0.1, 0.5, 1.0)
BEER = np.exp(-2 * np.array(COLORS))


def sphere(surface: int = 0) -> Sphere:
    return Sphere("/ball", 1.0, surface, ())


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_slab_absorbs_by_beers_law(size: float) -> None:
    surface = volume(tuple(c / size for c in COLORS), 0.0)  # type: ignore[arg-type]
    camera = orthographic(translation(0, 0, 10 * size), 0.1 * size)
    camera = replace(camera, clipping_range=(1e-3 * size, 1e3 * size))
    found = mean([(SLAB[0], scaling(size, size, size))], [surface], camera=camera)
    np.testing.assert_allclose(found[:3], BEER, rtol=1e-4)
    np.testing.assert_allclose(found[3], 1 - BEER.mean(), rtol=1e-4)  # what is not absorbed is a gap before the sky


def test_far_from_the_origin_it_does_so_too() -> None:
    np.testing.assert_allclose(mean([SLAB], [volume(COLORS, 0.0)], at=translation(1e8, -1e8, 1e8))[:3], BEER, rtol=2e-4)


def test_light_samples_are_absorbed_as_rays_are() -> None:
    floor = quad([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], 0)
    above, lid = orthographic(translation(0, 0, 10), 0.1), (box((20, 20, 2), 1), translation(0, 0, 3))
    plain = mean([(floor, HERE)], [lambert(1.0)], [sun()], above, spp=64)
    covered = mean([(floor, HERE), lid], [lambert(1.0), volume(COLORS, 0.0)], [sun()], above, spp=64)
    np.testing.assert_allclose(plain[:3], SUN_DIRECTION[2] / math.pi, rtol=1e-3)
    np.testing.assert_allclose(covered[:3] / plain[:3], BEER * np.exp(-2 / SUN_DIRECTION[2] * np.array(COLORS)), rtol=2e-3)


def test_volumes_emit_by_length() -> None:
    shines = np.array([1.0, 2.0, 3.0])
    found = mean([SLAB], [volume(COLORS, 0.0, emission=(1.0, 2.0, 3.0))], [])
    np.testing.assert_allclose(found[:3], shines * (1 - BEER) / COLORS, rtol=1e-4)
    alone = mean([SLAB], [volume(0.0, emission=(1.0, 2.0, 3.0))], [])
    np.testing.assert_allclose(alone, [2.0, 4.0, 6.0, 0.0], rtol=1e-4)
    thin = mean([SLAB], [volume(1e-6, 0.0, emission=1.0)], [])
    np.testing.assert_allclose(thin[:3], 2 - 2e-6, rtol=1e-4)


def test_what_emits_in_a_scattering_volume_leaves_it() -> None:
    """Radiosity of an endless slab without absorption: half of what it emits leaves on either side."""
    wide = box((4000, 4000, 2))
    shines, directions = 0.5, np.linspace(0.05, 0.95, 10)
    leaving = []
    for mu in directions:
        d = np.array([0.0, math.sqrt(1 - mu * mu), mu])
        eye = np.eye(4)
        x = np.array([1.0, 0.0, 0.0])
        eye[:3, :3] = np.stack([x, np.cross(d, x), d], axis=1)
        eye[:3, 3] = d * 40
        leaving.append(mean([(wide, HERE)], [volume(1.0, 1.0, emission=shines)], [], orthographic(eye, 0.1), spp=1024)[0])
    x, w = np.polynomial.legendre.leggauss(40)
    at = (x + 1) / 2
    flux = 2 * math.pi * float((w / 2 * np.interp(at, directions, leaving) * at).sum())
    assert flux == pytest.approx(4 * math.pi * shines * 2 / 2, rel=0.01)


@pytest.mark.parametrize("g", [0.0, 0.7, -0.5])
def test_a_slab_scatters_the_sun_once(g: float) -> None:
    """`SLAB`'s closed form: albedo p E (1 - exp(-s d (1 + 1 / mu0))) / (1 + 1 / mu0)."""
    wide, s, albedo = (box((400, 400, 2)), HERE), 0.6, 0.8
    along = 1 + 1 / SUN_DIRECTION[2]
    expected = albedo * henyey_greenstein(-SUN_DIRECTION[2], g) * (1 - math.exp(-s * 2 * along)) / along
    found = mean([wide], [volume(s, albedo, g)], [sun()], spp=1024, max_depth=1)
    np.testing.assert_allclose(found[:3], expected, rtol=5e-3)


def test_light_from_a_point_in_the_air() -> None:
    """Single scattering along a ray that passes a point light, by quadrature."""
    s, albedo, g, beside = 0.3, 0.9, 0.4, 1.0
    cube = (box((12, 12, 12)), HERE)
    lamp = light(LightType.POINT, translation(beside, 0, 0.5), 5.0)
    plate = quad([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 0)
    facing = mean([(plate, HERE)], [lambert(1.0)], [light(LightType.POINT, translation(0, 0, 1), 5.0)],
                  orthographic(translation(0.0, 0, 9), 1e-4), spp=64)  # fmt: skip
    intensity = float(facing[0]) * math.pi
    z, w = np.polynomial.legendre.leggauss(2000)
    z, w = z * 6, w * 6
    to = np.stack([np.full_like(z, beside), np.zeros_like(z), 0.5 - z], axis=1)
    r = np.linalg.norm(to, axis=1)
    cosine = to[:, 2] / r * -1  # from the light's propagation to that towards the camera, +z
    phase = np.array([henyey_greenstein(c, g) for c in cosine])
    expected = float((w * albedo * s * phase * intensity / r**2 * np.exp(-s * (r + 6 - z))).sum())
    found = mean([cube], [volume(s, albedo, g)], [lamp], orthographic(translation(0, 0, 10), 1e-4), spp=16384, max_depth=1)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-2)


@pytest.mark.parametrize("camera_height", [0.7, 3.0, 40.0])
def test_light_that_a_lamp_beside_a_volume_sends_into_it(camera_height: float) -> None:
    """Single scattering by quadrature: nothing scatters between the camera and the volume, however far off that is."""
    half, s, albedo = 0.6, 0.1, 0.8
    lamp = np.array([0.0, -2.0, 3.0])
    z, w = np.polynomial.legendre.leggauss(200)
    z, w = z * half, w * half
    to = lamp - np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=1)
    r = np.linalg.norm(to, axis=1)
    towards = to / r[:, None]
    leaves = np.minimum(half / -towards[:, 1], (half - z) / towards[:, 2])  # by the face at -y, or by the upper one
    lit = (w * albedo * s / (4 * math.pi) / r**2 * np.exp(-s * (leaves + half - z))).sum()
    cube = (box((2 * half, 2 * half, 2 * half)), HERE)
    above = orthographic(translation(0, 0, camera_height), 1e-4)
    above = replace(above, clipping_range=(1e-3, 1e3))
    found = mean([cube], [volume(s, albedo)], [light(LightType.POINT, translation(*lamp), 1.0)], above, spp=1024, max_depth=1)
    plate = quad([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 0)
    facing = mean([(plate, HERE)], [lambert(1.0)], [light(LightType.POINT, translation(0, 0, 1), 1.0)],
                  orthographic(translation(0.0, 0, 9), 1e-4), spp=64)  # fmt: skip
    np.testing.assert_allclose(found[:3], float(facing[0]) * math.pi * lit, rtol=5e-3)


INSIDE = orthographic(translation(0, 0, 0.3), 0.1)
ON_FACE = orthographic(translation(0, 0, 1.0), 0.1)
TWO: list[tuple[Shape, Doubles]] = [SLAB, (box((2, 2, 8), 1), HERE)]
FURNACES: dict[str, tuple[list[tuple[Shape, Doubles]], list[Surface], Camera | None]] = {
    "box": ([SLAB], [volume(2.0)], None),
    "peaked": ([SLAB], [volume(2.0, g=0.9)], None),
    "sphere": ([(sphere(), HERE)], [volume(3.0, g=0.6)], None),
    "thick": ([(sphere(), HERE)], [volume(30.0)], None),
    "two": (TWO, [volume(1.0, path="/a"), volume(0.5, g=0.7, path="/b")], None),
    "inside two": (TWO, [volume(1.0, path="/a"), volume(0.5, g=0.7, path="/b")], INSIDE),
    "on a face": ([SLAB], [volume(2.0)], ON_FACE),
    "coloured": ([SLAB], [volume((0.2, 1.0, 5.0))], None),
    "two coloured": (TWO, [volume((0.2, 1.0, 5.0), path="/a"), volume((3.0, 0.3, 0.1), g=-0.6, path="/b")], None),
    "glass in it": (
        [SLAB, (sphere(1), scaling(0.7, 0.7, 0.7))],
        [volume(1.0), Surface("/g", open_pbr=OpenPbr(transmission_weight=1.0, base_weight=0.0, specular_roughness=0.0))],
        None,
    ),
}


@pytest.mark.parametrize("name", FURNACES)
def test_a_white_sky_is_white_through_volumes_that_only_scatter(name: str) -> None:
    shapes, surfaces, camera = FURNACES[name]
    colored = "coloured" in name  # channels have the noise of each other's collisions, and their mean has none
    found = mean(shapes, surfaces, camera=camera, spp=4096 if colored else 512)[:3]
    np.testing.assert_allclose(found, 1.0, atol=6e-3 if colored else 1e-3)
    assert found.mean() == pytest.approx(1.0, abs=1e-3)


def test_overlapping_volumes_add() -> None:
    expected = math.exp(-0.3 * 2 - 0.1 * 8)
    for order in permutations(((box((4, 4, 2)), 0.3), (box((2, 2, 8)), 0.1))):
        shapes: list[tuple[Shape, Doubles]] = [(replace(shape, surface=k), HERE) for k, (shape, _) in enumerate(order)]
        surfaces = [volume(s, 0.0, path=f"/{k}") for k, (_, s) in enumerate(order)]
        assert mean(shapes, surfaces)[0] == pytest.approx(expected, rel=1e-4)
    inside = mean(TWO, [volume(0.3, 0.0, path="/a"), volume(0.1, 0.0, path="/b")], camera=INSIDE)[0]
    assert inside == pytest.approx(math.exp(-0.3 * 1.3 - 0.1 * 4.3), rel=1e-4)


def test_a_ball_of_fog_in_a_box_of_fog() -> None:
    shapes: list[tuple[Shape, Doubles]] = [SLAB, (sphere(1), scaling(0.5, 0.5, 0.5))]
    surfaces = [volume(0.3, 0.0, path="/a"), volume(0.7, 0.0, path="/b")]
    found = mean(shapes, surfaces, camera=orthographic(translation(0, 0, 10), 1e-3))
    assert found[0] == pytest.approx(math.exp(-0.6 - 0.7), rel=1e-4)


def test_instances_of_one_volume_that_overlap_add() -> None:
    prototype = Prototype("/p", (Placed(0, HERE),))
    described = describe(
        surfaces=[volume(0.3, 0.0)], lights=[SKY], camera=orthographic(translation(0, 0, 10), 0.1), prototypes=[prototype],
        prototype_shapes=[box((4, 4, 2))], placements=[placement(0, [HERE, translation(0, 0, 1), translation(0, 0, -4)])],
    )  # fmt: skip
    assert render(described.build(), 16).pixels()[..., 0].mean() == pytest.approx(math.exp(-0.3 * 6), rel=1e-4)


def test_two_volumes_in_one_place_scatter_as_their_sum() -> None:
    s, albedo = 0.7, 0.9
    both = [(box((6, 6, 2), 0), HERE), (box((6, 6, 2), 1), HERE)]
    one = mean(both[:1], [volume(2 * s, albedo, 0.5)], [sun()], spp=4096)
    two = mean(both, [volume(s, albedo, 0.5, path="/a"), volume(s, albedo, 0.5, path="/b")], [sun()], spp=4096)
    np.testing.assert_allclose(two[:3], one[:3], rtol=0.01)


def test_phase_functions_of_overlapping_volumes_are_mixed_by_scattering() -> None:
    wide, s = [(box((400, 400, 2), 0), HERE), (box((400, 400, 2), 1), HERE)], (0.4, 0.1)
    along = 1 + 1 / SUN_DIRECTION[2]
    phase = [henyey_greenstein(-SUN_DIRECTION[2], g) for g in (0.6, -0.6)]
    expected = (s[0] * phase[0] + s[1] * phase[1]) / 0.5 * (1 - math.exp(-0.5 * 2 * along)) / along
    surfaces = [volume(s[0], 1.0, 0.6, path="/a"), volume(s[1], 1.0, -0.6, path="/b")]
    np.testing.assert_allclose(mean(wide, surfaces, [sun()], spp=4096, max_depth=1)[:3], expected, rtol=5e-3)


def test_a_body_excludes_the_volumes_around_it_in_any_order() -> None:
    """A body with an interface that is half in the fog: within it, only its own interior absorbs."""
    body = air(specular_ior=1.0, transmission_color=(0.5, 0.5, 0.5), transmission_depth=1.0)
    rate = -math.log(0.5)
    for at in (-1.0, 0.0, 1.0):
        z = 1.5 * at
        shapes = [SLAB, (box((2, 2, 2), 1), translation(0, 0, z))]
        outside = 2 - max(0.0, min(1.0, z + 1) - max(-1.0, z - 1))
        found = mean(shapes, [volume(0.4, 0.0), body])[0]
        assert found == pytest.approx(math.exp(-0.4 * outside - rate * 2), rel=1e-4)
        within = orthographic(translation(0, 0, z), 0.1)  # the camera in the body
        below = max(0.0, z)  # of the slab
        seen = mean(shapes, [volume(0.4, 0.0), body], camera=within)[0]
        assert seen == pytest.approx(math.exp(-0.4 * below - rate), rel=1e-4)


def test_a_volume_that_fills_a_room_hides_no_wall() -> None:
    """Room, volume and a second volume have the same faces, and the camera is inside."""
    room = replace(box((4, 4, 4), 0), triangles=box((4, 4, 4)).triangles[:, ::-1].copy())
    shapes = [(room, HERE), (box((4, 4, 4), 1), HERE), (box((4, 4, 4), 2), HERE)]
    surfaces = [lambert(0.0, 1.0), volume(0.3, 0.0, path="/a"), volume(0.2, 0.0, path="/b")]
    camera = orthographic(translation(0.3, 0.2, 0.5), 0.5)
    np.testing.assert_allclose(mean(shapes, surfaces, [], camera), [math.exp(-0.5 * 2.5)] * 3 + [1.0], rtol=1e-4)
    floor = quad([[-2, -2, -2], [2, -2, -2], [2, 2, -2], [-2, 2, -2]], 0)
    lit = mean([(floor, HERE), shapes[1]], [lambert(1.0), volume(COLORS, 0.0)], [sun()], camera)
    way = np.array(COLORS) * (2.5 + 4 / SUN_DIRECTION[2])
    expected = SUN_DIRECTION[2] / math.pi * np.exp(-way)
    inside = abs(4 * SUN_DIRECTION[1] / SUN_DIRECTION[2])  # the sun's rays leave by a side: shorter ways
    assert inside > 2
    assert (lit[:3] > expected).all()
    white = mean(shapes[1:], [lambert(0.0)] + [volume(1.0, path=f"/{k}") for k in "ab"], camera=camera, spp=512)
    np.testing.assert_allclose(white[:3], 1.0, atol=1e-3)


def test_volumes_that_touch_leave_no_gap() -> None:
    shapes = [(box((4, 4, 2), 0), translation(0, 0, 1)), (box((4, 4, 2), 1), translation(0, 0, -1))]
    surfaces = [volume(0.3, 0.0, path="/a"), volume(0.7, 0.0, path="/b")]
    assert mean(shapes, surfaces)[0] == pytest.approx(math.exp(-2.0), rel=1e-4)
    assert mean(shapes, [volume(1.0, path=f"/{k}") for k in "ab"], spp=512)[0] == pytest.approx(1.0, abs=1e-3)


def test_a_volume_inside_an_interface_is_seen_through_it() -> None:
    lobes = OpenPbr(base_weight=0.0, specular_weight=0.0, specular_ior=1.0, transmission_weight=1.0)
    inside = volume(COLORS, 0.0, emission=(1.0, 2.0, 3.0)).volume
    found = mean([SLAB], [Surface("/m", open_pbr=lobes, volume=inside)], [])
    np.testing.assert_allclose(found[:3], np.array([1.0, 2.0, 3.0]) * (1 - BEER) / COLORS, rtol=1e-4)
    np.testing.assert_allclose(mean([SLAB], [Surface("/m", open_pbr=lobes, volume=inside)])[:3] - found[:3], BEER, rtol=1e-4)


def test_render_passes_hide_volumes_and_hold_them_out() -> None:
    hidden = mean([SLAB], [volume(0.5, 0.5, camera=CameraVisibility.HIDDEN)])
    np.testing.assert_allclose(hidden, [1, 1, 1, 0], atol=1e-6)
    matte = mean([SLAB], [volume(0.5, 1.0, camera=CameraVisibility.MATTE)])
    np.testing.assert_allclose(matte, [math.exp(-1)] * 3 + [0.0], atol=1e-5)


def test_bits_depend_on_neither_lanes_nor_threads() -> None:
    shapes, surfaces, camera = FURNACES["two coloured"]
    described = describe(shapes, surfaces, [SKY, sun()], camera or orthographic(translation(0, 0, 10), 1.5))
    scene = described.build()
    first = render(scene, 16, lanes=1).pixels()
    for lanes, threads in ((4, 1), (8, 2), (16, 3)):
        np.testing.assert_array_equal(render(scene, 16, lanes=lanes, threads=threads).pixels(), first)


def chandrasekhar_h(mu: float, albedo: float) -> float:
    """Of isotropic scattering in a half-space (Chandrasekhar 1950, "Radiative Transfer"), by iteration over Gauss points."""
    x, w = np.polynomial.legendre.leggauss(200)
    x, w = (x + 1) / 2, w / 2
    h = np.ones(200)

    def at(m: Doubles) -> Doubles:
        return np.asarray(1 / (math.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (m[:, None] + x)).sum(1)))

    for _ in range(500):
        h = at(x)
    return float(at(np.array([mu]))[0])


@pytest.mark.parametrize("albedo", [0.5, 0.9, 0.99])
def test_a_half_space_reflects_as_chandrasekhar_says(albedo: float) -> None:
    mu, mu0 = 1.0, float(SUN_DIRECTION[2])
    expected = albedo / (4 * math.pi) * mu0 / (mu + mu0) * chandrasekhar_h(mu, albedo) * chandrasekhar_h(mu0, albedo)
    half_space = (box((4000, 4000, 400)), translation(0, 0, -200))
    found = mean([half_space], [volume(1.0, albedo)], [sun()], spp=8192)
    np.testing.assert_allclose(found[:3].mean(), expected, rtol=5e-3)


def slab_by_numpy(depth: float, albedo: float, g: float, towards: Doubles, count: int = 400_000) -> float:
    """Radiance towards +z of a slab of this optical depth under a sun of irradiance 1, by a walk of its own."""
    rng = np.random.default_rng(7)
    tau, d, weight, total = np.zeros(count), np.tile([0.0, 0.0, -1.0], (count, 1)), np.ones(count), 0.0
    for _ in range(200):
        tau = tau - d[:, 2] * -np.log1p(-rng.random(len(tau)))
        alive = (tau > 0) & (tau < depth)
        tau, d, weight = tau[alive], d[alive], weight[alive] * albedo
        if len(tau) == 0:
            break
        cosine = d @ towards  # light travels along -towards, paths backwards
        phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
        total += float((weight * phase * np.exp(-tau / towards[2])).sum())
        u = rng.random(len(tau))
        mu = 1 - 2 * u if g == 0 else (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
        phi, sine = 2 * np.pi * rng.random(len(tau)), np.sqrt(np.maximum(0, 1 - mu * mu))
        side = np.where(np.abs(d[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        x = np.cross(side, d)
        x /= np.linalg.norm(x, axis=1)[:, None]
        d = d * mu[:, None] + (x * np.cos(phi)[:, None] + np.cross(d, x) * np.sin(phi)[:, None]) * sine[:, None]
    return total / count


def test_a_slab_scatters_as_often_as_a_walk_of_its_own_says() -> None:
    g, albedo = 0.6, 0.95
    found = mean([(box((2000, 2000, 2)), HERE)], [volume(1.5, albedo, g)], [sun()], spp=8192)
    assert found[:3].mean() == pytest.approx(slab_by_numpy(3.0, albedo, g, SUN_DIRECTION), rel=0.01)


def test_error_bars_cover_the_truth() -> None:
    """Estimates of many small renders differ from the closed form by as much as their standard errors say."""
    wide, s = (box((400, 400, 2)), HERE), 0.6
    along = 1 + 1 / SUN_DIRECTION[2]
    truth = henyey_greenstein(-SUN_DIRECTION[2], 0.3) * (1 - math.exp(-s * 2 * along)) / along
    described = describe([wide], [volume(s, 1.0, 0.3)], [sun()], orthographic(translation(0, 0, 10), 0.1), resolution=(32, 32))
    rendered = render(described.build(), 64, max_depth=1)
    halves = rendered.replicates[..., 0] / rendered.counts
    means, errors = halves.mean(0), np.abs(halves[0] - halves[1]) / 2
    z = (means - truth).ravel() / math.sqrt(float((errors**2).mean()))
    assert abs(float((z**2).mean()) - 1) < 0.12
    assert abs(float(z.mean())) < 4 / 32
