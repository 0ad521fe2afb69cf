"""Cut-outs show and shadow exactly what their texture says; stacks of see-through surfaces count every edge once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    image,
    lambert,
    light,
    look_at,
    orthographic,
    placement,
    quad,
    render,
    rotation,
    translation,
)
from tests.textured import FILE, UNIT_ST, look_at_plate, plate, primvar, texture, with_primvars

from primray.description import (
    Doubles,
    Interpolation,
    LightType,
    Mesh,
    Placed,
    PrimvarInput,
    Prototype,
    Surface,
    TextureFile,
)

RNG = np.random.default_rng(0)
OPACITY = (RNG.integers(0, 256, (16, 16)) / 255).astype(np.float32)
DOWN = rotation([1, 0, 0], -90)


def cutout(threshold: float, channels: str = "r", file: TextureFile = FILE) -> Surface:
    """Glows where it is."""
    inputs = (("opacity", texture(channels, file)),)
    return Surface("/leaf", emissive_color=(1, 1, 1), opacity_threshold=threshold, inputs=inputs)


@pytest.mark.parametrize("presence", [False, True])
@pytest.mark.parametrize("threshold", [0.2, 0.5, 128 / 255])
@pytest.mark.conforms(
    "UsdPreviewSurface.inputs:opacity", "UsdPreviewSurface.inputs:opacityThreshold", "UsdPreviewSurface.inputs:opacityMode"
)
def test_what_the_texture_says(threshold: float, presence: bool) -> None:
    """At the threshold exactly (0.2 is 51 / 255) it is there."""
    opacity = OPACITY.copy()
    opacity[0, :3] = np.array([50, 51, 52], np.float32) / np.float32(255)
    opacity[1, :3] = np.array([127, 128, 129], np.float32) / np.float32(255)
    d = look_at_plate(replace(cutout(float(np.float32(threshold))), presence=presence), {FILE: image(opacity)}, (16, 16))
    seen = render(d.build(filter_width=1e-6), 2).pixels(1.0)
    there = opacity >= np.float32(threshold)
    # Interpolation at texel centres is exact only to rounding: a texel at the threshold may fall on either side there.
    clear = np.abs(opacity - threshold) > 1e-6
    assert np.array_equal(seen[..., 3][clear], there[clear].astype(np.float32))
    assert np.array_equal(seen[..., 0] > 0, seen[..., 3] > 0)


def test_a_flat_opacity_at_the_threshold_is_there() -> None:
    for code, there in ((50, 0.0), (51, 1.0), (52, 1.0)):
        opacity = np.full((4, 4, 4), code, np.float32) / np.float32(255)
        d = look_at_plate(cutout(0.2, "a"), {FILE: image(opacity)}, (4, 4))
        assert (render(d.build(), 4).pixels(1.0)[..., 3] == there).all()


def horizontal(y: float, half: float = 1.0, surface: int = 1) -> tuple[Mesh, Doubles]:
    h = half
    mesh = quad([[-h, 0, h], [h, 0, h], [h, 0, -h], [-h, 0, -h]], surface)
    return with_primvars(mesh, primvar("st", UNIT_ST)), translation(0, y, 0)


@pytest.mark.parametrize("instanced", [False, True])
def test_shadows(instanced: bool) -> None:
    """Seen from below the plate, straight down; the sun stands above it."""
    camera = replace(orthographic(look_at([0, 0.5, 0], [0, 0, 0], up=(0, 0, -1)), 1.0), window=(-1, 1, -1, 1))
    surfaces = [lambert(1.0), replace(cutout(0.5), emissive_color=(0, 0, 0))]
    mesh, matrix = horizontal(1.0)
    shapes = [(ground(2), np.eye(4))]
    more: dict[str, Any] = {}
    if instanced:
        more["prototype_shapes"], more["prototypes"] = [mesh], [Prototype("/p", (Placed(1, np.eye(4)),))]
        more["placements"] = [placement(0, matrix[None, :3])]
    else:
        shapes.append((mesh, matrix))
    sun = [light(LightType.DISTANT, DOWN)]
    d = describe(shapes, surfaces, sun, camera, (16, 16), textures={FILE: image(OPACITY)}, **more)
    lit = render(d.build(filter_width=1e-6), 2, max_depth=1).pixels(1.0)[..., 0] > 0
    assert np.array_equal(lit, OPACITY < 0.5)


def test_the_edge_of_two_triangles_is_no_hole() -> None:
    camera = replace(orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0), window=(-1, 1, -1, 1))
    d = describe(
        [(plate(), np.eye(4))], [cutout(0.5)], camera=camera, resolution=(63, 63), textures={FILE: image(np.ones((4, 4)))}
    )
    assert (render(d.build(filter_width=1e-7), 2).pixels(1.0)[..., 3] == 1).all()


def test_opacity_by_primvar_cuts_out() -> None:
    surface = replace(cutout(0.5), inputs=(("opacity", PrimvarInput("there", (1.0,))),))
    mesh = with_primvars(plate(), primvar("there", [[0.4], [0.6]], Interpolation.FACE))
    seen = render(look_at_plate(surface, {}, (8, 8), mesh).build(), 1).pixels(1.0)[..., 3]
    assert (seen[:3, :3] == 1).all()
    assert (seen[5:, 5:] == 0).all()


def test_the_instance_decides_over_its_cut_out() -> None:
    surface = replace(cutout(0.5), inputs=(("opacity", PrimvarInput("there", (1.0,))),))
    matrices = np.stack([translation(2 * i, 0, 0)[:3] for i in range(3)])
    camera = replace(orthographic(look_at([2, 0, 5], [2, 0, 0]), 1.0), window=(-3, 3, -1, 1))
    d = describe(
        surfaces=[surface], camera=camera, resolution=(3, 1), prototypes=[Prototype("/p", (Placed(0, np.eye(4)),))],
        prototype_shapes=[plate(half=0.9)],
        placements=[placement(0, matrices, (primvar("there", [1.0, 0.0, 0.5], Interpolation.INSTANCE),))],
    )  # fmt: skip
    assert render(d.build(filter_width=1e-3), 1).pixels(1.0)[0, :, 3].tolist() == [1, 0, 1]


def test_constant_ones_need_no_filter() -> None:
    for opacity, there in ((0.4, 0.0), (0.5, 1.0)):
        surface = Surface("/m", emissive_color=(1, 1, 1), opacity=opacity, opacity_threshold=0.5, thin=True)
        scene = look_at_plate(surface, {}, (4, 4)).build()
        assert not scene.has_cutouts
        assert not scene.has_thin
        assert (render(scene, 4).pixels(1.0)[..., 3] == there).all()


THIN = Surface("/thin", thin=True, diffuse_color=(0, 0, 0), use_specular_workflow=True, ior=1.0, roughness=1.0)
GAP = Surface("/gap", presence=True, diffuse_color=(0, 0, 0))


@pytest.mark.parametrize("layers", [1, 3])
def test_shadow_rays_count_a_shared_edge_once(layers: int) -> None:
    """Exactly below the diagonal of each plate, where two of its triangles meet."""
    surfaces = [lambert(1.0), replace(GAP, inputs=(("opacity", texture("r")),))]
    camera = replace(orthographic(look_at([0, 0.5, 0], [0, 0, 0], up=(0, 0, -1)), 1.0), window=(-1, 1, -1, 1))
    shapes = [(ground(2), np.eye(4)), *(horizontal(1.0 + i) for i in range(layers))]
    opacity = np.full((2, 2), 0.25)
    d = describe(shapes, surfaces, [light(LightType.DISTANT, DOWN)], camera, (9, 9), textures={FILE: image(opacity)})
    got = render(d.build(filter_width=1e-7), 4, max_depth=1).pixels(1.0)[..., 0] * np.pi
    np.testing.assert_allclose(got, 0.75**layers, rtol=1e-4)


@pytest.mark.parametrize("surface", [GAP, THIN])
def test_paths_count_a_shared_edge_once(surface: Surface) -> None:
    """Looking through the diagonal at a lamp behind: half of it arrives, a quarter would if both triangles counted."""
    surface = replace(surface, inputs=(("opacity", texture("r")),))
    camera = replace(orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0), window=(-1, 1, -1, 1))
    shapes = [(plate(), np.eye(4)), (plate(half=3, surface=1), translation(0, 0, -1))]
    d = describe(shapes, [surface, lambert(0.0, 1.0)], [], camera, (9, 9), textures={FILE: image(np.full((2, 2), 0.5))})
    got = render(d.build(filter_width=1e-7), 4096).pixels(1.0)[..., 0]
    diagonal = got[::-1].diagonal()
    other = got.diagonal()
    np.testing.assert_allclose(diagonal.mean(), np.delete(other, 4).mean(), atol=0.02)
    assert 0.4 < diagonal.mean() < 0.56


def test_an_opaque_texture_costs_no_see_through_shadows() -> None:
    for value, thin in ((1.0, False), (0.99, True)):
        surface = replace(GAP, inputs=(("opacity", texture("r")),))
        assert look_at_plate(surface, {FILE: image(np.full((2, 2), value))}, (2, 2)).build().has_thin == thin


def test_a_cut_outs_texture_keeps_its_finest_level_alone() -> None:
    """Far away, where others drop it: a filter reads no other. Its colours go by the footprint."""
    file = TextureFile("leaf", "raw")
    surface = replace(cutout(0.5), inputs=(("opacity", texture("a", file)), ("diffuse_color", texture(file=file))))
    rgba = RNG.random((256, 256, 4))
    images = look_at_plate(surface, {file: image(rgba)}, (8, 8)).build().texture_images
    assert [(i["channels"], i["first_level"], i["last_level"]) for i in images] == [(1, 0, 0), (3, 3, 8)]
