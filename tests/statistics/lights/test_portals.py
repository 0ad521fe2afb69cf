"""Domes sampled through portals: the density is what is drawn, pictures stay the same, a room with a window gets less noise."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import (
    Described,
    box,
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    mesh,
    orthographic,
    perspective,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Doubles, Floats, Light, LightType, Mesh, Portal

N = 40_000
SKY: Floats = (np.random.default_rng(2).random((16, 32, 3)) ** 8 * 5).astype(np.float32)
SHEAR = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])
# Windows in the wall x = 1, through which light comes along -x.
INWARDS = rotation([0, 1, 0], 90)
PORTALS: dict[str, tuple[Portal, ...]] = {
    "one": (Portal(translation(1, 0.2, 0) @ INWARDS, 0.5, 0.8),),
    "two, one of them scaled": (
        Portal(translation(1, 0.2, 0.4) @ INWARDS @ scaling(0.5, 2, 3), 0.5, 0.2),
        Portal(translation(0, 1, 0) @ rotation([1, 0, 0], 90), 0.4, 0.4),
    ),
    "sheared": (Portal(translation(1, 0.1, 0) @ INWARDS @ SHEAR, 0.6, 0.5),),
    "many": tuple(Portal(translation(1, 0.05 * i - 0.5, 0.3 * (i % 3)) @ INWARDS, 0.5, 0.4) for i in range(20)),
}


def dome(portals: tuple[Portal, ...] = (), **more: object) -> Light:
    return light(LightType.DOME, portals=portals, **more)  # type: ignore[arg-type]


CASES = [(name, sky) for name in PORTALS for sky in ("constant", "image")]


@pytest.mark.conforms("DomeLight.portals", "DomeLight_1.portals", "PortalLight.inputs:width", "PortalLight.inputs:height")
@pytest.mark.parametrize(("name", "sky"), CASES)
def test_samples_follow_the_density(name: str, sky: str) -> None:
    scene = describe(lights=[dome(PORTALS[name])], dome_texture=SKY if sky == "image" else None).build()
    p = np.ascontiguousarray(np.broadcast_to([0.1, -0.1, 0.2], (N, 3)), np.float64)
    wi, pdf, L = kernels().portal_sample(scene, 0, p, random_numbers(N, 3, seed=3))
    drawn = pdf > 0
    assert drawn.mean() > 0.999
    found = kernels().dome_pdf(scene, 0, p[drawn], wi[drawn])
    assert np.mean(np.abs(found / pdf[drawn] - 1) < 1e-4) > 0.995
    if sky == "constant":
        assert (L[drawn] == 1).all()

    def density(w: Doubles) -> Doubles:
        at = np.ascontiguousarray(np.broadcast_to(p[0], (len(w), 3)))
        return kernels().dome_pdf(scene, 0, at, w.astype(np.float32))

    # Edges of windows go through cells: fine points.
    cells = SphereCells(np.array([1.0, 0.2, 0.1]), spread=np.pi, rings=24, points=100)
    assert density_p_value(cells, density, wi[drawn], N) > 0.01 / len(CASES)


@pytest.mark.parametrize("count", [1, 2])
def test_behind_a_portal_the_image_alone_is_sampled(count: int) -> None:
    """It transmits along -Z: who stands on its +Z side is not guided. Of two, no weight is left to choose by."""
    portals = PORTALS["one"] * count
    with_image = describe(lights=[dome(portals)], dome_texture=SKY).build()
    p = np.ascontiguousarray(np.broadcast_to([3.0, 0.2, 0.0], (2000, 3)), np.float64)
    wi, pdf, _ = kernels().portal_sample(with_image, 0, p, random_numbers(2000, 3, seed=3))
    np.testing.assert_allclose(pdf, kernels().dome_eval(with_image, 0, wi)[0], rtol=1e-6)
    constant = describe(lights=[dome(portals)]).build()
    assert (kernels().portal_sample(constant, 0, p, random_numbers(2000, 3, seed=3))[1] == 0).all()
    assert (kernels().dome_pdf(constant, 0, p, wi) == 0).all()


def test_lanes_do_not_change_bits() -> None:
    scene = describe(lights=[dome(PORTALS["two, one of them scaled"])], dome_texture=SKY).build()
    p, u = np.random.default_rng(4).uniform(-1.5, 1.5, (333, 3)), random_numbers(333, 3, seed=4)
    seen = kernels().portal_sample(scene, 0, p, u)[1] > 0
    for one, many in zip(kernels().portal_sample(scene, 0, p, u, 1), kernels().portal_sample(scene, 0, p, u), strict=True):
        assert np.array_equal(one[seen], many[seen])


def room() -> list[tuple[Mesh, Doubles]]:
    """A box 2 wide with a window of 0.4 x 0.3 in the wall x = 1, where the quads leave it out."""
    inside = box([2, 2, 2])
    walls = mesh(inside.points, [t for t in inside.triangles.tolist() if not (inside.points[t][:, 0] == 1).all()])
    y = [-1, 0.05, 0.35, 1]
    z = [-1, -0.2, 0.2, 1]
    points = [[1, b, c] for b in y for c in z]
    faces = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    quads = [[4 * i + j, 4 * (i + 1) + j, 4 * (i + 1) + j + 1, 4 * i + j + 1] for i, j in faces]
    wall = mesh(points, [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])
    return [(walls, np.eye(4)), (wall, np.eye(4))]


WINDOW = (Portal(translation(1, 0.2, 0) @ INWARDS, 0.4, 0.3),)


def seen_in_room(portals: tuple[Portal, ...], sky: Floats | None, spp: int, depth: int = 3) -> Doubles:
    camera = perspective(look_at([-0.9, 0.5, 0.8], [0.5, -0.6, -0.3]), 0.8)
    d = describe(room(), [lambert(0.7)], [dome(portals)], camera, (24, 24), dome_texture=sky)
    result = render(d.build(), spp, max_depth=depth, splits=1)
    assert result.invalid_samples == 0
    return replicate_means(result)


@pytest.mark.conforms("DomeLight.portals", "DomeLight_1.portals")
@pytest.mark.parametrize("sky", ["constant", "image"])
def test_a_room_with_a_window(sky: str) -> None:
    pixels = SKY if sky == "image" else None
    without, with_portal = seen_in_room((), pixels, 512), seen_in_room(WINDOW, pixels, 512)
    noise = [float(np.square(a[0] - a[1]).mean() / 4) for a in (without, with_portal)]
    assert abs(without.mean() - with_portal.mean()) < 4 * np.sqrt(sum(noise) / (24 * 24)) + 1e-3 * without.mean()
    assert noise[0] > 4 * noise[1]  # of the squared error, at equal samples


def test_a_portal_in_the_wrong_place_costs_noise_alone() -> None:
    """It guides; it does not light and does not shadow."""
    wrong = (Portal(translation(-1, 0, 0) @ rotation([0, 1, 0], -90), 1.0, 1.0),)
    a, b = seen_in_room(wrong, SKY, 1024), seen_in_room((), SKY, 1024)
    error = np.sqrt(sum(np.square(i[0] - i[1]).mean() / 4 for i in (a, b)) / (24 * 24))
    assert abs(a.mean() - b.mean()) < 4 * error


def test_other_lights_and_lobe_factors_beside_portals() -> None:
    """The choice among lights counts the dome with portals, and its multipliers."""

    def lit(portals: tuple[Portal, ...]) -> Described:
        lights = [
            dome(portals, diffuse=0.5),
            light(LightType.SPHERE, translation(0, 0.5, 0), 3.0, radius=0.1),
            light(LightType.DOME, emission=0.3),
        ]
        camera = orthographic(look_at([0, 0.3, 0], [0, 0, 0], up=(0, 0, -1)), 0.3)
        return describe([(ground(2), np.eye(4))], [lambert(0.8)], lights, camera, (8, 8))

    a, b = (replicate_means(render(lit(p).build(), 1024, max_depth=1)) for p in (PORTALS["two, one of them scaled"], ()))
    error = np.sqrt(sum(np.square(i[0] - i[1]).mean() / 4 for i in (a, b)) / 64)
    assert abs(a.mean() - b.mean()) < 4 * error + 1e-4
