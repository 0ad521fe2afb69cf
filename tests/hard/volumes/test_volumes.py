"""Volumes that are hard: by their values, sizes, places and numbers, and by what is inside of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from tests import vdb_writer as vdb
from tests.described import rotation, scaling, translation
from tests.hard.light.lit_stages import light, material, placed, prim, show, sphere

from primray.volumes.volume_grid import VolumeGrid

from .smoke_stages import BLACK, WHITE, Array, agrees, block, camera, depth, grid, look, seen, volume, write

Measured = Callable[[str], None]
NOTHING = np.eye(4)
PASSES = 0.6  # optical depth, where a case does not say another


@dataclass(frozen=True)
class Ray:
    """A ray through grids, which are placed by one matrix in the world."""

    grids: tuple[VolumeGrid, ...]
    eye: tuple[float, float, float] = (-20.0, 3.5, 3.5)
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)
    matrix: Array = field(default_factory=lambda: np.eye(4))  # world from index
    half: float = 1e-3  # of the picture's width, in voxels
    size: float = 1.0  # of a voxel in the world


def gradient(first: tuple[int, int, int] = (0, 0, 0)) -> VolumeGrid:
    x, y, z = np.indices((16, 16, 16))
    return grid(0.5 + 0.02 * x + 0.03 * y + 0.01 * z, first)


def checker() -> VolumeGrid:
    return grid(np.kron(np.indices((6, 6, 6)).sum(axis=0) % 2, np.ones((8, 8, 8))), (-24, -24, -24))


SHEARED = np.array([[1, 0.5, 0, 0], [0, 1, 0.25, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
AWAY = (0.8, 0.5, 0.4)


def through_middle(matrix: Array, size: float = 1.0, first: tuple[int, int, int] = (0, 0, 0)) -> Ray:
    """Return a ray through the middle of a gradient whose lowest voxel is `first`."""
    d = np.array(AWAY) / np.linalg.norm(AWAY)
    middle = matrix @ [*(np.array(first) + (7.2, 7.9, 7.4)), 1]
    x, y, z = (middle[:3] - 50 * size * d).tolist()
    return Ray((gradient(first),), (x, y, z), AWAY, matrix, size=size)


RAYS = {
    "the camera inside": Ray((gradient(),), (5.25, 7.5, 7.5)),
    "the camera on a face": Ray((block(),), (-1.0, 3.5, 3.5)),
    "rays in the plane of the last voxels": Ray((block(),), (7.0, 3.5, -20.0), (0, 0, 1), half=1e-6),
    "rays in the plane between two leaves": Ray((block(16),), (8.0, 8.0, -20.0), (0, 0, 1), half=1e-6),
    "rays along an edge, half a voxel outside": Ray((block(),), (7.5, 7.5, -20.0), (0, 0, 1), half=1e-6),
    "sheared voxels": through_middle(SHEARED),
    "mirrored voxels": through_middle(scaling(-1, 1, 1)),
    "turned, sheared and mirrored voxels": through_middle(rotation((1, 1, 0), 70) @ SHEARED @ scaling(-0.7, 1.4, 1)),
    "voxels of 1e-6 units": through_middle(scaling(1e-6, 1e-6, 1e-6), 1e-6),
    "voxels of 1e3 units": through_middle(scaling(1e3, 1e3, 1e3), 1e3),
    "flat voxels, 1e4 times as wide as high": through_middle(scaling(1e4, 1.0, 1e4)),
    "1e8 units from the origin": through_middle(translation(1e8, -1e8, 1e8)),
    "voxels with numbers of 1e9": through_middle(
        translation(-(1 << 30), 1 << 30, -(1 << 30)), first=(1 << 30, -(1 << 30), 1 << 30)
    ),
    "two grids that touch": Ray((grid(np.ones((8, 16, 16))), grid(np.ones((8, 16, 16)), (8, 0, 0))), (-20.0, 7.0, 7.0)),
    "a ray between two grids that touch": Ray(
        (grid(np.ones((8, 16, 16))), grid(np.ones((8, 16, 16)), (8, 0, 0))), (7.5, 7.0, -20.0), (0, 0, 1), half=0.25
    ),
    "a checker of leaves of 0 and 1": Ray((checker(),), (-40.0, -25.0, -21.0), (0.75, 0.5, 0.42)),
}


@pytest.mark.parametrize("name", RAYS)
@pytest.mark.hard_case("Volumes", "%s", expected="exp of minus the integral of the interpolated values, to 0.3 %")
def test_transmittance(name: str, tmp_path: Path, measured: Measured) -> None:
    ray = RAYS[name]
    length = sum(depth(g, ray.matrix, ray.eye, ray.direction, 200 * ray.size) for g in ray.grids)
    smoke = [volume(write(tmp_path, g), ray.matrix, f"smoke{k}") for k, g in enumerate(ray.grids)]
    view = camera(ray.eye, ray.direction, ray.half * ray.size, 400 * ray.size)
    found = seen(*smoke, look(PASSES / length, BLACK), view)
    measured(agrees(found, math.exp(-PASSES)))


@pytest.mark.hard_case("Volumes", "a grid split in two, at random values", expected="the picture of the whole one, to 0.3 %")
def test_a_grid_split_in_two(tmp_path: Path, measured: Measured) -> None:
    values = np.random.default_rng(4).random((16, 16, 16))
    view, black = camera((-20, 7.3, 8.1), (1, 0, 0), 1e-3, 400), look(0.06, BLACK)
    parts = [volume(write(tmp_path, grid(values[8 * k : 8 * k + 8], (8 * k, 0, 0))), name=f"part{k}") for k in range(2)]
    length = depth(grid(values), NOTHING, (-20, 7.3, 8.1), (1, 0, 0), 60)
    whole = agrees(seen(volume(write(tmp_path, grid(values))), black, view), math.exp(-0.06 * length))
    found = agrees(seen(*parts, black, view), math.exp(-0.06 * length))
    measured(f"the whole {whole}, the halves {found}")


@pytest.mark.parametrize("distance", [20.0, 1e6], ids=lambda distance: f"{distance:g} voxels away")
@pytest.mark.parametrize("density", [1e-9, 1e6, 1e30], ids=lambda density: f"{density:g}")
@pytest.mark.hard_case(
    "Volumes",
    "a density by the voxel and its distance: %s",
    expected="1 below, 0 above",
    plain_float="steps below the rounding of the distance do not advance: no end",
)
def test_extreme_densities(density: float, distance: float, tmp_path: Path, measured: Measured) -> None:
    view = camera((-distance, 3.5, 3.5), (1, 0, 0), 2.0, 4 * distance)
    found = seen(volume(write(tmp_path, block())), look(density, BLACK), view, spp=16)
    np.testing.assert_allclose(found.pixels, 1.0 if density < 1 else 0.0, atol=1e-6)
    measured(f"{found.mean:.6g}")


@pytest.mark.parametrize("value", [1e-30, 1e30])
@pytest.mark.hard_case("Volumes", "voxels of %s, and a density of its inverse", expected="as voxels of 1 have")
def test_values_and_density_cancel(value: float, tmp_path: Path, measured: Measured) -> None:
    smoke = volume(write(tmp_path, block(value=value)))
    found = seen(smoke, look(PASSES / 8 / value, BLACK), camera((-20, 3.5, 3.5), (1, 0, 0), 2.0, 100))
    measured(agrees(found, math.exp(-PASSES)))


WRONG = {"negative": -1.0, "infinite": math.inf, "NaN": math.nan}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.hard_case("Volumes", "%s voxels", expected="reported, and read as 0")
def test_values_that_are_no_densities(name: str, tmp_path: Path, measured: Measured) -> None:
    values = np.random.default_rng(1).random((16, 16, 16)).astype(np.float32)
    wrong, zero = values.copy(), values.copy()
    wrong[3:12:2, 5:9, 7], zero[3:12:2, 5:9, 7] = WRONG[name], 0.0
    view, gray = camera((-20, 7.5, 7.5), (1, 0, 0), 7.0, 100), look(0.1)
    expected = seen(volume(write(tmp_path, grid(zero))), gray, view, spp=16)
    found = seen(volume(write(tmp_path, grid(wrong))), gray, view, spp=16)
    np.testing.assert_array_equal(found.pixels, expected.pixels)
    assert "volume-values" in found.noted
    assert "volume-values" not in expected.noted
    measured("the same bits, `volume-values`")


@pytest.mark.hard_case("Volumes", "a level set as a density", expected="reported; distances outside are densities, inside is 0")
def test_a_level_set(tmp_path: Path, measured: Measured) -> None:
    places = np.moveaxis(np.indices((24, 24, 24)), 0, -1) - 11.5
    values = np.clip(np.linalg.norm(places, axis=-1) - 8.0, -3.0, 3.0)
    view, black = camera((-20, 11.7, 11.2), (1, 0, 0), 1e-3, 100), look(0.02, BLACK)
    file = write(tmp_path, grid(values), metadata={"class": vdb.string("level set")})
    found = seen(volume(file), black, view)
    assert "level set" in found.noted["volume-values"]
    length = depth(grid(np.maximum(values, 0.0)), NOTHING, (-20, 11.7, 11.2), (1, 0, 0), 60)
    measured(f"`volume-values`, {agrees(found, math.exp(-0.02 * length))}")


EMPTY = {
    "without leaves": grid(np.zeros((0, 8, 8))),
    "of zeros": VolumeGrid(**{**vars(block()), "leaf_values": np.zeros((1, 512), np.float32)}),
}


@pytest.mark.parametrize("name", EMPTY)
@pytest.mark.hard_case("Volumes", "a grid %s", expected="the picture without it")
def test_empty_grids(name: str, tmp_path: Path, measured: Measured) -> None:
    view, white = camera((-20, 3.5, 3.5), (1, 0, 0), 5.0, 100), look(1.0, WHITE)
    ball = sphere("clay", 2.0) + material("clay", "color3f inputs:diffuseColor = (0.5, 0.4, 0.3)")
    plain = seen(ball, white, view, spp=16)
    found = seen(ball, volume(write(tmp_path, EMPTY[name])), white, view, spp=16)
    np.testing.assert_array_equal(found.pixels, plain.pixels)
    measured("the same bits")


@pytest.mark.parametrize("optical_depth", [1e-9, 1e-2, 1.0, 100.0, 1e4])
@pytest.mark.hard_case("Volumes", "an albedo of 1 in a white sky, at an optical depth of %s", expected="1: it cannot be seen")
def test_a_white_furnace(optical_depth: float, tmp_path: Path, measured: Measured) -> None:
    """Beyond 16,384 scatterings lossless paths end by roulette, and their weights have noise."""
    values = np.random.default_rng(1).random((16, 16, 16)) ** 3
    values[5:9] = 0.0
    smoke, white = (
        volume(write(tmp_path, grid(values))),
        look(optical_depth / 4, WHITE, "float inputs:scatter_anisotropy = 0.3"),
    )
    view = camera((-20, 12, 2), (1, -0.2, 0.3), 6.0, 100)
    if optical_depth > 1e3:
        found = seen(smoke, white, view, spp=32, size=4)
        assert abs(found.mean - 1.0) < 5 * found.noise + 1e-4
        assert found.noise < 0.05
        measured(f"{found.mean:.3f} (standard error {found.noise:.3f})")
    else:
        found = seen(smoke, white, view, spp=16, size=16)
        np.testing.assert_allclose(found.pixels, 1.0, rtol=1e-4)
        measured("1, to 1e-4")


def instancer(places: Array, smoke: str) -> str:
    positions = ", ".join(f"({x!r}, {y!r}, {z!r})" for x, y, z in places.tolist())
    prototypes = prim("Scope", "prototypes", smoke)
    lines = (f"point3f[] positions = [{positions}]", f"int[] protoIndices = {[0] * len(places)}")
    return prim("PointInstancer", "crowd", *lines, "rel prototypes = </crowd/prototypes/smoke>", prototypes)


@pytest.mark.hard_case(
    "Volumes", "10,000 instances of a cloud, 20 on each ray", expected="20 times its optical depth, to 0.3 %"
)
def test_thousands_of_instances(tmp_path: Path, measured: Measured) -> None:
    places = 12.0 * np.stack(np.meshgrid(np.arange(20), np.arange(25), np.arange(20), indexing="ij"), -1).reshape(-1, 3)
    crowd = instancer(places, volume(write(tmp_path, block())))
    view = camera((-20, 147.5, 123.5), (1, 0, 0), 1.0, 400)
    found = seen(crowd, look(0.2 / 160, BLACK), view, spp=256)
    measured(agrees(found, math.exp(-0.2)))


FOG = "float primray:fog:density = {}\ncolor3f primray:fog:color = (0.8, 0.8, 0.8)\nfloat primray:fog:anisotropy = {}"


def airlight(places: Array, density: float, g: float) -> float:
    """Return the light of points of intensity 1 that endless fog of albedo 0.8 scatters once along -z from the origin."""
    theta = (np.arange(4000) + 0.5) / 4000
    total = 0.0
    for place in places:
        pivot = -place[2]  # distances along the ray are pivot + aside tan(angle), so that the inverse square is constant
        aside = math.hypot(place[0], place[1])
        low = math.atan2(-pivot, aside)
        angle = low + theta * (math.pi / 2 - low)
        t, r = pivot + aside * np.tan(angle), aside / np.cos(angle)
        cosine = (t - pivot) / r * -1  # between the way from the light and the way to the camera
        phase = (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
        total += float((0.8 * density * phase * np.exp(-density * (t + r))).mean() * (math.pi / 2 - low) / aside)
    return total


@pytest.mark.parametrize("density", [0.02, 0.5])
@pytest.mark.hard_case("Volumes", "500 lights in endless fog of density %s", expected="the sum of their integrals, to 1 %")
def test_five_hundred_lights_in_fog(density: float, measured: Measured) -> None:
    rng = np.random.default_rng(500)
    places = rng.uniform([-10, -10, -20], [10, 10, 5], (500, 3))
    places = places[np.hypot(places[:, 0], places[:, 1]) > 0.3]
    lamps = "".join(
        light("SphereLight", "float inputs:radius = 1e-3", "float inputs:intensity = 4", "bool inputs:normalize = 1",
              at=placed(*map(float, place)), name=f"lamp{k}")
        for k, place in enumerate(places)
    )  # fmt: skip
    view = camera((0, 0, 0), (0, 0, -1), 1e-4, 1e6).replace("{", "{\n" + FOG.format(density, 0.3), 1)
    found = show(view, lamps, spp=1024, resolution=(32, 32), max_depth=1)
    assert found.invalid_samples == 0
    measured(agrees(found, airlight(places, density, 0.3), 0.01))


def hair() -> str:
    points = [(-0.5, y, 0.3 * math.sin(y)) for y in (-6, -2, 2, 6)] + [(0.8, y, 0.5 - 0.1 * y) for y in (-6, -2, 2, 6)]
    lines = (
        'uniform token type = "cubic"', 'uniform token basis = "bspline"', "int[] curveVertexCounts = [4, 4]",
        "float[] widths = [0.7] (interpolation = \"constant\")", f"point3f[] points = {points}",
        "rel material:binding = </strands>",
    )  # fmt: skip
    white = material("strands", "color3f inputs:diffuseColor = (1, 1, 1)", "float inputs:roughness = 0.3")
    return prim("BasisCurves", "hair", *lines, apis=["MaterialBindingAPI"]) + white.replace(
        "{", "{\nbool primray:hair = true", 1
    )


INSIDE = {
    "a ball of glass": (
        sphere("glass", 2.0) + material("glass", "float inputs:opacity = 0", "float inputs:roughness = 0"),
        1e-3,
    ),
    "rough glass": (sphere("glass", 2.0) + material("glass", "float inputs:opacity = 0", "float inputs:roughness = 0.3"), 0.02),
    "white hair": (hair(), 3e-3),
}


@pytest.mark.parametrize("name", INSIDE)
@pytest.mark.hard_case("Volumes", "%s in white smoke under a white sky", expected="1: nothing of it can be seen")
def test_things_in_smoke(name: str, tmp_path: Path, measured: Measured) -> None:
    things, tolerance = INSIDE[name]
    smoke = volume(write(tmp_path, block()), translation(-3.5, -3.5, -3.5))
    found = seen(things, smoke, look(0.3, WHITE), camera((-15, 4, 6), (15, -4, -6), 3.0, 100), spp=256)
    alone = seen(things, camera((-15, 4, 6), (15, -4, -6), 3.0, 100), spp=256)
    assert found.mean == pytest.approx(1.0, abs=tolerance)
    measured(f"{found.mean:.4f} (without smoke {alone.mean:.4f})")
