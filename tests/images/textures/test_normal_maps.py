"""Normal maps against normals computed here: any st, mirrored ones, instances of any kind, smooth normals, degenerate st."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    describe,
    image,
    lambert,
    light,
    look_at,
    orthographic,
    placement,
    render,
    rotation,
    scaling,
    translation,
)
from tests.textured import FILE, pixels_of, plate, primvar, texture, with_primvars

from primray.description import (
    Doubles,
    Interpolation,
    LightType,
    Mesh,
    Placed,
    PrimvarInput,
    Prototype,
    Surface,
)

TILT = np.array([0.3, -0.2, 0.9])
BENT = TILT / np.linalg.norm(TILT)
SUN = rotation([1, 0, 0], -20) @ rotation([0, 1, 0], 15)
TO_SUN = SUN[:3, 2]
NORMAL = ("normal", texture(scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)))
MAP = {FILE: image(np.broadcast_to((TILT + 1) / 2, (4, 4, 3)))}
WHITE = replace(lambert(1.0), inputs=(NORMAL,))
SHEAR = np.eye(4)
SHEAR[0, 1] = 0.6


def irradiance_on(mesh: Mesh, matrix: Doubles, *, instanced: bool, surface: Surface = WHITE) -> np.ndarray:
    """Radiance of a white plate in the sun, times pi, (2, 2)."""
    camera = orthographic(look_at([0, 0, 5], [0, 0, 0]), 0.2)
    sun = [light(LightType.DISTANT, SUN)]
    if not instanced:
        d = describe([(mesh, matrix)], [surface], sun, camera, (2, 2), textures=MAP)
    else:
        prototypes, placements = [Prototype("/p", (Placed(0, np.eye(4)),))], [placement(0, matrix[None, :3])]
        d = describe([], [surface], sun, camera, (2, 2), prototypes, [mesh], placements, textures=MAP)
    return pixels_of(d, max_depth=1)[..., 0] * np.pi


def bent(matrix: Doubles, ds: np.ndarray, dt: np.ndarray, tilt: np.ndarray = BENT) -> np.ndarray:
    """The normal that a map gives on the plate z = 0, whose tangents are ds, dt, under a matrix."""
    m = matrix[:3, :3]
    n = np.linalg.inv(m).T @ [0, 0, 1]
    n /= np.linalg.norm(n)
    t = m @ ds - n * (n @ (m @ ds))
    t /= np.linalg.norm(t)
    b = np.cross(n, t)
    b *= np.sign(b @ (m @ dt))
    return t * tilt[0] + b * tilt[1] + n * tilt[2]


MATRICES = {
    "as it is": np.eye(4),
    "turned": rotation([0, 0, 1], 70) @ rotation([1, 0.3, 0], 25),
    "mirrored": scaling(-1, 1, 1),
    "mirrored and turned": rotation([1, 0.3, 0], 25) @ scaling(1, -1, 1),
    "sheared": SHEAR,
    "stretched": rotation([0, 1, 0], 20) @ scaling(3, 0.5, 2),
    "sheared and mirrored": rotation([0, 1, 0], -20) @ SHEAR @ scaling(-1, 1, 1),
}
# Corners' st, and how the point moves with s and with t.
MAPS: dict[str, tuple[Any, Any, Any]] = {
    "upright": ([[0, 0], [1, 0], [1, 1], [0, 1]], [1, 0, 0], [0, 1, 0]),
    "mirrored": ([[1, 0], [0, 0], [0, 1], [1, 1]], [-1, 0, 0], [0, 1, 0]),
    "turned": ([[0, 1], [0, 0], [1, 0], [1, 1]], [0, 1, 0], [-1, 0, 0]),
    "stretched": ([[0, 0], [9, 0], [9, 0.1], [0, 0.1]], [1, 0, 0], [0, 1, 0]),
}


@pytest.mark.parametrize("instanced", [False, True])
@pytest.mark.parametrize("st", MAPS)
@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.conforms("UsdPreviewSurface.inputs:normal")
def test_against_the_normal_itself(matrix: str, st: str, instanced: bool) -> None:
    coordinates, ds, dt = MAPS[st]
    got = irradiance_on(plate(coordinates), MATRICES[matrix], instanced=instanced)
    wanted = bent(MATRICES[matrix], np.array(ds, float), np.array(dt, float)) @ TO_SUN
    np.testing.assert_allclose(got, wanted, rtol=2e-3)


def test_the_plate_itself_tilted() -> None:
    """A map of one tilted normal lights a plate as tilting it does, under lights of every kind."""
    turn = np.eye(4)
    turn[:3, :3] = np.stack([np.cross(np.cross(BENT, [1, 0, 0]), BENT), np.cross(BENT, [1, 0, 0]), BENT], axis=1)
    turn[:3, :3] /= np.linalg.norm(turn[:3, :3], axis=0)
    lights = [
        light(LightType.SPHERE, translation(1, 1, 4), 20.0, radius=0.5),
        light(LightType.RECT, translation(-1, 1, 5) @ rotation([1, 0, 0], 10), 10.0, width=1.0, height=1.0),
    ]
    camera = orthographic(look_at([0, 0, 3], [0, 0, 0]), 0.01)
    glossy = Surface("/m", diffuse_color=(0.5, 0.4, 0.3), roughness=0.4, clearcoat=0.6, clearcoat_roughness=0.2)
    mapped = describe([(plate(), np.eye(4))], [replace(glossy, inputs=(NORMAL,))], lights, camera, (2, 2), textures=MAP)
    tilted = describe([(plate(), turn)], [glossy], lights, camera, (2, 2))
    a, b = (render(d.build(), 2048, max_depth=1).pixels(1.0)[..., :3].mean(axis=(0, 1)) for d in (mapped, tilted))
    np.testing.assert_allclose(a, b, rtol=5e-3)


def test_degenerate_st_and_useless_normals_leave_the_normal() -> None:
    flat = TO_SUN[2]
    for st in ([[0.5, 0.5]] * 4, [[0, 0], [1, 1], [2, 2], [1, 1]]):
        np.testing.assert_allclose(irradiance_on(plate(st), np.eye(4), instanced=False), flat, rtol=1e-5)
    for tilt in ((0, 0, 0), (0, 0, -1), (1, 0, 0), (np.nan, 0, 1)):
        surface = replace(lambert(1.0), inputs=(("normal", PrimvarInput("n", tilt)),))
        np.testing.assert_allclose(irradiance_on(plate(), np.eye(4), instanced=False, surface=surface), flat, rtol=1e-5)


def test_normals_from_primvars() -> None:
    surface = replace(lambert(1.0), inputs=(("normal", PrimvarInput("n", (0, 0, 1))),))
    mesh = with_primvars(plate(), primvar("n", [TILT], Interpolation.CONSTANT))
    np.testing.assert_allclose(irradiance_on(mesh, np.eye(4), instanced=False, surface=surface), BENT @ TO_SUN, rtol=1e-4)


def test_about_the_smooth_normal() -> None:
    smooth = np.array([0.2, 0.1, 0.97])
    smooth /= np.linalg.norm(smooth)
    mesh = replace(plate(), normals=np.broadcast_to(smooth, (4, 3)).astype(np.float32))
    t = np.array([1, 0, 0]) - smooth * smooth[0]
    t /= np.linalg.norm(t)
    wanted = t * BENT[0] + np.cross(smooth, t) * BENT[1] + smooth * BENT[2]
    np.testing.assert_allclose(irradiance_on(mesh, np.eye(4), instanced=False), wanted @ TO_SUN, rtol=2e-3)


def test_the_back_is_bent_the_other_way() -> None:
    """Seen and lit from behind, a bump is a hollow: the whole normal is turned around."""
    camera = orthographic(look_at([0, 0, -5], [0, 0, 0]), 0.2)
    sun = rotation([0, 1, 0], 165)
    d = describe([(plate(), np.eye(4))], [WHITE], [light(LightType.DISTANT, sun)], camera, (2, 2), textures=MAP)
    np.testing.assert_allclose(pixels_of(d, max_depth=1)[..., 0] * np.pi, -BENT @ sun[:3, 2], rtol=2e-3)
