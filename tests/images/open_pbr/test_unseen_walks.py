"""Walks below a surface that no pixel resolves: where they are left out, what is seen then, and what keeps its walks."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pxr import Usd

import primray
from primray.core import native, passes

from .test_interiors import SKY, Inputs, ball, box, material
from .test_walks import ABOVE, BELOW, COSINE, albedo_of, color_of, half_space, slab

Doubles = npt.NDArray[np.float64]
MOST = native.lanes()
RED = 0.8
WALKED = 0.5 - 0.74 * math.log(1 - RED)  # bound to a walk's mean distance along an axis, in mean free paths
SKIN: Inputs = {
    "specular_weight": 0.0,
    "subsurface_weight": 1.0,
    "subsurface_color": (RED, 0.5, 0.4),
    "subsurface_radius_scale": (1.0, 0.5, 0.25),
}
PIXEL = 1.0  # of a camera that sees 16 units with 16 pixels
LARGEST = PIXEL / 32 / WALKED  # mean free path that is left out


def rendered(*parts: str, aperture: float = 160.0, resolution: int = 16, at: float = 0.0, **settings: Any) -> primray.Image:
    """A picture by an orthographic camera at (at, 0, 40) that looks down; `aperture` in tenths of units."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(
        f"""#usda 1.0
( metersPerUnit = 1
  upAxis = "Y" )
def Camera "eye" {{
    token projection = "orthographic"
    float horizontalAperture = {aperture}
    float verticalAperture = {aperture}
    double3 xformOp:translate = ({at}, 0, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
        + "".join(parts)
    )
    return primray.render(stage, **{"resolution": (resolution, resolution), "spp": 16, **settings})


def skin(path: float, **more: Any) -> str:
    return material("m", {**SKIN, "subsurface_radius": path, **more})


def told(image: primray.Image) -> list[dict[str, Any]]:
    return [d for d in image.report["diagnostics"] if d["code"] == "subsurface-unresolved"]


def mean(image: primray.Image) -> Doubles:
    return np.asarray(image.pixels[..., :3], float).mean((0, 1))


@pytest.mark.parametrize(
    ("path", "resolution", "more", "left_out"),
    [
        (0.98 * LARGEST, 16, {}, True),
        (1.02 * LARGEST, 16, {}, False),
        (0.98 * LARGEST, 20, {}, False),
        (1.2 * LARGEST, 12, {}, True),
        (0.98 * LARGEST, 16, {"subsurface_scatter_anisotropy": 0.5}, False),  # the reduced path is longer
        (0.4 * LARGEST, 16, {"subsurface_scatter_anisotropy": 0.5}, True),
        (0.4 * LARGEST, 16, {"subsurface_scatter_anisotropy": -0.5}, False),
        (0.4 * LARGEST, 16, {"coat_weight": 0.5}, False),
        (0.4 * LARGEST, 16, {"base_diffuse_roughness": 0.5}, False),
        (0.4 * LARGEST, 16, {"subsurface_color": (1.0, 0.5, 0.4)}, False),  # light gets through any thickness
    ],
)
def test_mean_free_path_and_resolution_decide(path: float, resolution: int, more: Inputs, left_out: bool) -> None:
    image = rendered(box((40, 40, 30), z=-15), skin(path, **more), SKY, resolution=resolution, spp=2)
    found = told(image)
    assert bool(found) is left_out
    if left_out:
        assert found[0]["prim_path"] == "/box"
        assert " % of the step" in found[0]["message"]


@pytest.mark.parametrize(("radius", "left_out"), [(9.6, True), (6.4, False)])
def test_thin_and_curved_bodies_keep_their_walks(radius: float, left_out: bool) -> None:
    """1,000 mean free paths through the middle; only its border, where a ray along the normal is as long, would have none."""
    path = 0.016
    assert bool(told(rendered(ball(radius), skin(path), SKY, spp=2))) is left_out


def doubled(albedo: float, g: float, points: int = 32) -> float:
    """Reflectance of diffuse light by a half-space, by doubling of layers (van de Hulst); Henyey and Greenstein's phases."""
    x, w = np.polynomial.legendre.leggauss(points)
    mu, w = (x + 1) / 2, w / 2
    terms = np.arange(2 * points)
    legendre, weights = np.polynomial.legendre.legvander(mu, len(terms) - 1), (2 * terms + 1) * g**terms
    onwards, back = (legendre * weights) @ legendre.T, (legendre * weights * (-1.0) ** terms) @ legendre.T
    whole = ((onwards + back) * w).sum(1)[:, None] / 2
    flux, depth = 2 * mu * w, 1e-7
    thin = albedo * depth / (4 * np.outer(mu, mu)) / whole * flux
    reflected, passed = back * thin, onwards * thin + np.diag(np.exp(-depth / mu))
    for _ in range(48):
        between = np.linalg.solve(np.eye(points) - reflected @ reflected, np.eye(points))
        reflected, passed = reflected + passed @ between @ reflected @ passed, passed @ between @ passed
    return float((2 * mu * w * reflected.sum(1)).sum())


def test_doubling_agrees_with_the_closed_form() -> None:
    for albedo in (0.6, 0.95):
        assert doubled(albedo, 0.0) == pytest.approx(half_space(albedo), abs=2e-5)


@pytest.mark.parametrize("g", [0.0, 0.4, 0.8])
def test_the_albedo_is_that_of_walks(g: float) -> None:
    for colors in ((0.05, 0.1, 0.2), (0.3, 0.4, 0.5)):
        albedos = [albedo_of(c) for c in colors]
        s2 = [1 - a for a in albedos]
        expected = [doubled((1 - s) / (1 - g * s), g) for s in s2]
        given = {"subsurface_color": colors, "subsurface_scatter_anisotropy": g, "subsurface_radius_scale": (1.0, 1.0, 1.0)}
        image = rendered(box((40, 40, 30), z=-15), skin(5e-3, **given), SKY)
        assert told(image)
        np.testing.assert_allclose(mean(image), expected, atol=5e-4)


def test_a_ball_has_the_mean_of_its_walks() -> None:
    """A trace of a coat makes it walk. From one to the other there is a step by the ball's curvature, below 0.3 %."""
    without, walks = (
        rendered(ball(8.8), skin(0.9 * LARGEST, coat_weight=coat, coat_roughness=1.0), SKY, spp=spp)
        for coat, spp in ((0.0, 64), (1e-6, 512))
    )
    assert told(without)
    assert not told(walks)
    np.testing.assert_allclose(mean(without), mean(walks), rtol=5e-3)


def test_thin_sheets_keep_light_from_behind() -> None:
    path, depth = 0.5 * LARGEST, 5.0
    color = color_of(0.9)
    given = {"subsurface_color": (color, color, color), "subsurface_radius_scale": (1.0, 1.0, 1.0)}
    for sun, side in ((ABOVE, 0), (BELOW, 1)):
        image = rendered(box((60, 60, depth * path)), skin(path, **given), sun, spp=256)
        assert not told(image)
        np.testing.assert_allclose(mean(image), slab(0.9, depth)[side] * COSINE / math.pi, rtol=2e-2)


def test_far_from_the_origin_it_is_the_same() -> None:
    def at(x: float) -> primray.Image:
        moved = ball(8.0, centre=(x, 0.0, 0.0))
        return rendered(moved, skin(0.5 * LARGEST), SKY, at=x)

    near, far = at(0.0), at(1e6)
    assert told(near)
    assert told(far)
    np.testing.assert_allclose(mean(far), mean(near), rtol=2e-3)


def test_mirrors_show_walks_whatever_their_width() -> None:
    """A mirror may magnify what it shows: bodies in it keep their walks, which take many rays."""
    body, path = ball(8.0, centre=(0.0, 0.0, 80.0)), skin(0.4 * LARGEST)
    mirror = box((40, 40, 1), wears="mirror") + material("mirror", {"base_metalness": 1.0, "specular_roughness": 0.0})
    shown, straight = rendered(mirror, body, path, SKY), rendered(ball(8.0), path, SKY)
    assert told(straight)
    rays = [image.report["rays_by_kind"]["scattered"] / image.report["samples"] for image in (shown, straight)]
    assert rays[0] > 4 * rays[1]


def test_lanes_threads_and_regions_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = (ball(5.6), skin(0.4 * LARGEST, specular_weight=1.0), SKY, ABOVE)
    pictures = []
    for lanes, threads in ((1, 1), (4, 2), (0, 1)):
        monkeypatch.setattr(passes, "lanes", lambda lanes=lanes: lanes or MOST)
        image = rendered(*parts, threads=threads)
        assert told(image)
        pictures.append(np.asarray(image.pixels))
    for one, other in itertools.pairwise(pictures):
        np.testing.assert_array_equal(one, other)
    part = np.asarray(rendered(*parts, region=(0.25, 0.25, 0.75, 0.75)).pixels)
    assert (part[..., :3] > 0).any()
    np.testing.assert_array_equal(part, pictures[0][4:12, 4:12])
