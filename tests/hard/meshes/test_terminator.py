"""Coarse meshes with smooth normals where light grazes them: shaded as what they stand for, and still closed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from tests.described import look_at, rotation, scaling, translation
from tests.hard.meshes.mesh_stages import DOME, camera_prim, mesh_prim, picture, place, prim, round_mesh

Measured = Callable[[str], None]

EYE = look_at([0, 0, 10], [0, 0, 0])
LIGHTS = {
    "a distant light": prim(
        "DistantLight", "sun", "float inputs:intensity = 3", "bool inputs:normalize = 1", place(rotation((0, 1, 0), 65))
    ),
    "a sphere light": prim(
        "SphereLight", "lamp", "float inputs:intensity = 3000", "float inputs:radius = 0.5", place(translation(30, 8, 8))
    ),
}


def ball(bands: int, around: int, *, smooth: bool = True, color: float = 0.8, matrix: np.ndarray | None = None) -> str:
    points, faces = round_mesh(bands, around)
    return mesh_prim(points, faces, normals=points if smooth else None, color=color, matrix=matrix)


@cache
def seen(light: str, bands: int, around: int, matrix: str = "") -> np.ndarray:
    placed = {"": None, "mirrored": scaling(-1, 1, 1), "turned": rotation((1, 2, 3), 70)}[matrix]
    text = camera_prim(EYE, 0.12) + LIGHTS[light] + ball(bands, around, matrix=placed)
    return picture(text, (96, 96), 16, max_depth=1).pixels


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.hard_case(
    "Meshes",
    "shadow terminator: a sphere of 196 smooth-shaded triangles, %s from the side",
    expected="no black triangle where a sphere of 65,000 is lit, difference at most 0.03 of the brightest",
    plain_float="3 % of the sphere's pixels black where it is lit, as whole triangles lie behind their own plane",
)
def test_no_triangle_is_black_where_the_sphere_is_lit(light: str, measured: Measured) -> None:
    coarse, fine = seen(light, 8, 14), seen(light, 128, 256)
    both = (coarse[..., 3] == 1) & (fine[..., 3] == 1)
    black = both & (coarse[..., 0] < 0.1 * fine[..., 0]) & (fine[..., 0] > 0.02 * fine[..., 0].max())
    rms = np.sqrt(np.mean((coarse - fine)[both][:, 0] ** 2)) / fine[..., 0].max()
    assert black.sum() == 0
    assert rms < 0.03
    measured(f"{black.sum()} black pixels, root mean square difference {rms:.3f}")


@pytest.mark.parametrize("matrix", ["mirrored", "turned"])
def test_wherever_it_stands(matrix: str) -> None:
    coarse, fine = seen("a distant light", 8, 14, matrix), seen("a distant light", 128, 256, matrix)
    both = (coarse[..., 3] == 1) & (fine[..., 3] == 1)
    assert not (both & (coarse[..., 0] < 0.1 * fine[..., 0]) & (fine[..., 0] > 0.05 * fine[..., 0].max())).any()


def test_instances_look_like_the_mesh() -> None:
    sun = LIGHTS["a distant light"]
    stretched = translation(0.1, 0, 0) @ rotation((3, 1, 2), 40) @ scaling(1, 0.5, -1.2)
    plain = picture(camera_prim(EYE, 0.14) + sun + ball(8, 14, matrix=stretched), (48, 48), 16, max_depth=1)
    copies = prim(
        "Xform", "copies", place(stretched), prim("Xform", "a", ball(8, 14)).replace('"a"', '"a" (instanceable = true)')
    )
    instanced = picture(camera_prim(EYE, 0.14) + sun + copies, (48, 48), 16, max_depth=1)
    assert np.mean(np.abs(plain.pixels - instanced.pixels)) < 1e-3 * plain.pixels[..., :3].max()


@pytest.mark.hard_case(
    "Meshes",
    "a white sphere of 196 smooth-shaded triangles under a white sky",
    expected="1 in every pixel: nothing is lost below the triangles' planes",
    plain_float="up to 2 % dark where normals bend away from the triangles",
)
def test_furnace(measured: Measured) -> None:
    image = picture(camera_prim(EYE, 0.05) + DOME + ball(8, 14, color=1.0), (32, 32), 64)
    off = np.abs(image.pixels[..., :3] - 1).max()
    assert off < 1e-6
    measured("1, to 1e-6")


# A closed box whose normals point from its centre: its middle is lifted by half its size.
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
LAMP = prim("SphereLight", "lamp", "float inputs:intensity = 1e6", "float inputs:radius = 0.3")


@pytest.mark.parametrize("gap", [1e-3, 0.1])
@pytest.mark.hard_case(
    "Meshes",
    "a bright light in a closed box, %s from a box with normals that bend by 55 degrees",
    expected="exactly black outside",
    plain_float="renderers that start shadow rays off the surface without looking leak here",
)
def test_no_light_through_a_neighbour(gap: float, measured: Measured) -> None:
    lit = mesh_prim(CUBE, QUADS, name="lit")
    beside = mesh_prim(CUBE, QUADS, name="beside", normals=CUBE, matrix=translation(2 + gap, 0, 0))
    eye = camera_prim(look_at([6, 5, 12], [1.5, 0, 0]), 0.3)
    for instanced in (False, True):
        both = prim("Xform", "boxes", lit, beside)
        if instanced:
            both = both.replace('"boxes"', '"boxes" (instanceable = true)')
        image = picture(eye + LAMP + both, (64, 64), 64, max_depth=3)
        assert image.pixels[..., 3].mean() > 0.1
        assert not image.pixels[..., :3].any()
    measured("exactly black")


def test_the_measure_sees_facets() -> None:
    """What is compared above is not alike for faceted triangles."""
    sun = LIGHTS["a distant light"]
    faceted = picture(camera_prim(EYE, 0.12) + sun + ball(8, 14, smooth=False), (96, 96), 16, max_depth=1).pixels
    fine = seen("a distant light", 128, 256)
    both = (faceted[..., 3] == 1) & (fine[..., 3] == 1)
    assert (both & (faceted[..., 0] < 0.1 * fine[..., 0]) & (fine[..., 0] > 0.02 * fine[..., 0].max())).sum() > 30
