"""Inputs that vary by name alone give the bits of constants; emission at chosen points is what rays see there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.described import Described, describe, image, kernels, lambert, look_at, orthographic, placement, render, translation
from tests.kernels.scenes import SCENES
from tests.textured import FILE, glowing, plate, primvar, texture, with_primvars

from primray import core
from primray.core.surface_upload import DIRECTIONS
from primray.description import Input, Interpolation, OpenPbr, Placed, PrimvarInput, Prototype, Surface, TextureFile
from primray.description.shading import HAIR_PREFIX as HAIR
from primray.description.shading import OPEN_PBR_PREFIX

INPUT_FIELDS = [field.name for field in core.module().InputField]


def numbers(surface: Surface, name: str) -> tuple[float, ...]:
    value = surface.constant(name)
    return value if isinstance(value, tuple) else (value,)


def connected(surface: Surface) -> Surface:
    """Every input a primvar that nothing has; the constants themselves are other ones."""
    lobes = [p for p, own in ((OPEN_PBR_PREFIX, surface.open_pbr), (HAIR, surface.hair)) if own is None]
    names = [n for n in INPUT_FIELDS if n not in DIRECTIONS and not n.startswith(tuple(lobes))]
    inputs = tuple((name, PrimvarInput("nobody's", numbers(surface, name))) for name in names)
    blank = Surface(surface.path, open_pbr=OpenPbr())
    return replace(surface, inputs=inputs).with_constants({name: blank.constant(name) for name in names})


@pytest.mark.parametrize("lanes", [1, core.lanes()])
@pytest.mark.parametrize("name", ["all lights", "materials", "instances", "smooth, lens"])
def test_connected_constants_give_the_same_bits(name: str, lanes: int) -> None:
    constant = SCENES[name]()
    # One surface in two, so that lanes of both kinds go together.
    surfaces = tuple(connected(s) if i % 2 else s for i, s in enumerate(constant.description.surfaces))
    for some in (surfaces, tuple(connected(s) for s in constant.description.surfaces)):
        varying = replace(constant, description=replace(constant.description, surfaces=some))
        scene = varying.build()
        assert scene.has_inputs
        images = [render(s, 8, lanes=lanes).pixels(1.0) for s in (constant.build(), scene)]
        assert np.array_equal(images[0], images[1])


def emitters(value: Input) -> Described:
    mesh = with_primvars(plate(), primvar("glow", [[1, 2, 3], [4, 5, 6]], Interpolation.FACE))
    matrices = np.stack([translation(2.5 * i, 0, 0)[:3] for i in range(1, 4)])
    tint = primvar("tint", [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]], Interpolation.INSTANCE)
    return describe(
        [(plate(surface=1), translation(0, 5, 0)), (mesh, np.eye(4))], [glowing(value), lambert(0.5, 7.0)],
        camera=orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0),
        prototypes=[Prototype("/p", (Placed(2, np.eye(4)),))], prototype_shapes=[mesh],
        placements=[placement(0, matrices, (tint,))],
        textures={FILE: image(np.random.default_rng(0).random((4, 4, 3)))},
    )  # fmt: skip


def emission(d: Described, triangle: int, uv: np.ndarray, placement: int = -1, row: int = 0, lanes: int = 0) -> np.ndarray:
    n = len(uv)
    ints = [np.full(n, x, np.int32) for x in (triangle, placement, row)]
    return np.asarray(kernels().triangle_emission(d.build(), *ints, np.ascontiguousarray(uv, np.float32), lanes))


def test_emission_at_points() -> None:
    uv = np.random.default_rng(1).random((20, 2)) / 2
    by_face = emitters(PrimvarInput("glow", (0, 0, 0)))
    assert (emission(by_face, 0, uv) == 7).all()
    assert (emission(by_face, 2, uv) == [1, 2, 3]).all()
    assert (emission(by_face, 3, uv) == [4, 5, 6]).all()
    by_instance = emitters(PrimvarInput("tint", (0.5, 0.5, 0.5)))
    assert (emission(by_instance, 2, uv) == 0.5).all()
    assert (emission(by_instance, 4, uv, 0, 2) == [0, 0, 3]).all()
    d = emitters(texture())
    # Triangle 2's corners are (0, 0), (1, 0), (1, 1) in st.
    st = uv @ [[1, 0], [1, 1]]
    wanted = kernels().texture_lookup(d.textures[FILE][0][1].pixels, 1, 1, 0, st.astype(np.float32), np.zeros(20, np.float32))
    np.testing.assert_allclose(emission(d, 2, uv), wanted, rtol=1e-5)
    assert np.array_equal(emission(d, 2, uv), emission(d, 2, uv, lanes=1))


def test_average_emission() -> None:
    d = emitters(texture(scale=(2, 2, 2, 1), bias=(0.25, 0, 0, 0)))
    mean = d.textures[FILE][0][1].pixels.mean(axis=(0, 1))
    scene = d.build()
    np.testing.assert_allclose(kernels().average_emission(scene, 0), 2 * mean + [0.25, 0, 0], rtol=1e-5)
    assert kernels().average_emission(scene, 1) == (7, 7, 7)
    assert kernels().average_emission(emitters(PrimvarInput("glow", (0, 0, 0))).build(), 0) == (2.5, 3.5, 4.5)
    assert kernels().average_emission(emitters(PrimvarInput("none", (1, 2, 3))).build(), 0) == (1, 2, 3)


def test_packets_and_single_rays_meet_the_same_cut_outs() -> None:
    file = TextureFile("leaf", "raw")
    rng = np.random.default_rng(2)
    surface = Surface("/leaf", opacity_threshold=0.5, inputs=(("opacity", texture("r", file)),))
    shapes = [(plate(), translation(0, 0, -i)) for i in range(4)]
    scene = describe(shapes, [surface], textures={file: image(rng.random((8, 8)))}).build()
    o = np.column_stack([rng.uniform(-1, 1, (2000, 2)), np.full(2000, 2.0)])
    d = np.column_stack([rng.normal(size=(2000, 2)) * 0.2, np.full(2000, -1.0)]).astype(np.float32)
    found = [kernels().intersect(scene, o, d, lanes, packet) for lanes in (0, 1) for packet in (True, False)]
    hit = found[0]["geometry"] != -1
    for other in found[1:]:
        for key in ("geometry", "primitive"):
            assert np.array_equal(found[0][key], other[key]), key
        for key in ("t", "uv", "p", "ns"):
            assert np.array_equal(found[0][key][hit], other[key][hit]), key
    assert 0.4 < hit.mean() < 0.6
