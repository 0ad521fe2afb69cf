"""Pixels are the texels: orientation, channels, scale and bias, transforms, tiles, and primvars of every kind."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    image,
    lambert,
    light,
    look_at,
    orthographic,
    placement,
    render,
    scaling,
    translation,
)
from tests.textured import (
    FILE,
    ST,
    UNIT_ST,
    Numbers,
    glowing,
    look_at_plate,
    pixels_of,
    plate,
    primvar,
    texture,
    with_primvars,
)

from primray.core.scene import inverse_cdf
from primray.core.scene_upload import upload
from primray.description import (
    Interpolation,
    LightType,
    Mesh,
    Placed,
    Primvar,
    PrimvarInput,
    Prototype,
    Sphere,
    Surface,
    TextureFile,
    Wrap,
)
from primray.settings import Filter
from primray.textures.texture import Texture

RNG = np.random.default_rng(0)
PICTURE = (RNG.integers(0, 256, (5, 7, 4)) / 255).astype(np.float32)
CLOSE = 2e-3  # of a texel's distance from its neighbours: what is left of the filter's width, and half floats


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("channels", ["rgb", "r", "g", "b", "a"])
@pytest.mark.conforms(
    "UsdUVTexture.inputs:file",
    "UsdUVTexture.inputs:st",
    "UsdUVTexture.outputs:r",
    "UsdUVTexture.outputs:g",
    "UsdUVTexture.outputs:b",
    "UsdUVTexture.outputs:a",
    "UsdUVTexture.outputs:rgb",
)
def test_every_channel_the_right_way_up(count: int, channels: str) -> None:
    picture = PICTURE[:, :, :count]
    r, g, b, a = np.moveaxis(PICTURE, 2, 0)
    one = np.ones((5, 7))
    rgba = {1: (r, r, r, one), 2: (r, r, r, g), 3: (r, g, b, one), 4: (r, g, b, a)}[count]
    wanted = np.stack(rgba[:3] if channels == "rgb" else [rgba["rgba".index(channels)]] * 3, axis=-1)
    got = pixels_of(look_at_plate(glowing(texture(channels)), {FILE: image(picture)}, (7, 5)))
    np.testing.assert_allclose(got, wanted, atol=CLOSE)


@pytest.mark.conforms("UsdUVTexture.inputs:scale", "UsdUVTexture.inputs:bias")
def test_scale_and_bias() -> None:
    value = texture(scale=(2, -1, 0.5, 1), bias=(0.5, 1, 0, 0))
    got = pixels_of(look_at_plate(glowing(value), {FILE: image(PICTURE)}, (7, 5)))
    wanted = PICTURE[..., :3] * [2, -1, 0.5] + [0.5, 1, 0]
    np.testing.assert_allclose(got, wanted, atol=2 * CLOSE)
    scalar = texture("g", scale=(9, -1, 9, 9), bias=(9, 1, 9, 9))
    got = pixels_of(look_at_plate(glowing(scalar), {FILE: image(PICTURE)}, (7, 5)))
    np.testing.assert_allclose(got[..., 0], 1 - PICTURE[..., 1], atol=CLOSE)


def test_negative_emission_is_none() -> None:
    got = pixels_of(look_at_plate(glowing(texture(bias=(-0.5,) * 4)), {FILE: image(PICTURE)}, (7, 5)))
    np.testing.assert_allclose(got, np.maximum(PICTURE[..., :3] - 0.5, 0), atol=CLOSE)


@pytest.mark.conforms("UsdTransform2d.inputs:rotation", "UsdTransform2d.inputs:translation")
def test_st_transform() -> None:
    """A quarter turn counter-clockwise about the origin, then one to the right: s' = 1 - t, t' = s."""
    square = PICTURE[:5, :5]
    got = pixels_of(look_at_plate(glowing(texture(st_transform=(0, -1, 1, 1, 0, 0))), {FILE: image(square)}, (5, 5)))
    s, t = np.meshgrid((np.arange(5) + 0.5) / 5, 1 - (np.arange(5) + 0.5) / 5)
    column, row = np.floor((1 - t) * 5).astype(int), 4 - np.floor(s * 5).astype(int)
    np.testing.assert_allclose(got, square[row, column, :3], atol=CLOSE)


@pytest.mark.parametrize("wrap", [Wrap.BLACK, Wrap.CLAMP, Wrap.REPEAT, Wrap.MIRROR])
@pytest.mark.conforms("UsdUVTexture.inputs:wrapS", "UsdUVTexture.inputs:wrapT")
def test_wraps_outside(wrap: Wrap) -> None:
    st = [[-1, -1], [2, -1], [2, 2], [-1, 2]]
    picture = PICTURE[:3, :3, :3]
    got = pixels_of(look_at_plate(glowing(texture(wrap=wrap)), {FILE: image(picture)}, (9, 9), plate(st)))
    if wrap is Wrap.BLACK:
        wanted = np.zeros((9, 9, 3))
        wanted[3:6, 3:6] = picture
    else:
        modes: dict[Wrap, Any] = {Wrap.CLAMP: "edge", Wrap.REPEAT: "wrap", Wrap.MIRROR: "symmetric"}
        wanted = np.pad(picture, ((3, 3), (3, 3), (0, 0)), modes[wrap])
    np.testing.assert_allclose(got, wanted, atol=CLOSE)


def test_the_file_says_how_to_wrap() -> None:
    st = [[1, 0], [2, 0], [2, 1], [1, 1]]
    value = texture(wrap=Wrap.USE_METADATA)
    for own, lit in ((Wrap.REPEAT, True), (Wrap.BLACK, False)):
        textures = {FILE: image(np.ones((2, 2, 3)), wrap_s=own, wrap_t=own)}
        assert (pixels_of(look_at_plate(glowing(value), textures, (3, 3), plate(st))) > 0).all() == lit


def test_tiles() -> None:
    """Four tiles of which one is missing; nothing filters across their borders."""
    file = TextureFile("tiles.<UDIM>.exr", "raw")
    colors = {1001: (1, 0, 0), 1002: (0, 1, 0), 1012: (0, 0, 1)}
    tiles = [(number, Texture(np.full((2, 3, 3), c, np.float32))) for number, c in colors.items()]
    value = texture(file=file, fallback=(0.25, 0.5, 0.75, 1), scale=(0.5,) * 4)
    got = pixels_of(look_at_plate(glowing(value), {file: tiles}, (8, 8), plate([[0, 0], [2, 0], [2, 2], [0, 2]])))
    assert (got[4:, :4] == [0.5, 0, 0]).all()
    assert (got[4:, 4:] == [0, 0.5, 0]).all()
    assert (got[:4, 4:] == [0, 0, 0.5]).all()
    assert (got[:4, :4] == [0.25, 0.5, 0.75]).all()
    outside = plate([[-2, 9], [-1, 9], [-1, 12], [-2, 12]])
    assert (pixels_of(look_at_plate(glowing(value), {file: tiles}, (3, 3), outside)) == [0.25, 0.5, 0.75]).all()


@pytest.mark.conforms("UsdUVTexture.inputs:fallback")
def test_a_file_that_cannot_be_read_gives_its_fallback() -> None:
    value = texture(fallback=(0.25, 0.5, 0.75, 1), scale=(9,) * 4)
    assert (pixels_of(look_at_plate(glowing(value), {}, (2, 2))) == [0.25, 0.5, 0.75]).all()
    surface = replace(lambert(0.0, emission=1.0), inputs=(("opacity", texture("a", fallback=(0, 0, 0, 0.5))),))
    d = look_at_plate(replace(surface, lambert=False, opacity_threshold=0.6), {}, (2, 2))
    assert (pixels_of(d) == 0).all()


def one_triangle_pair(interpolation: Interpolation, values: Numbers) -> Mesh:
    return with_primvars(plate(), primvar("glow", values, interpolation))


GLOW = glowing(PrimvarInput("glow", (0.125, 0.25, 0.5)))


def test_primvars_of_every_kind() -> None:
    def look(interpolation: Interpolation, values: Numbers) -> np.ndarray:
        return pixels_of(look_at_plate(GLOW, {}, (4, 4), one_triangle_pair(interpolation, values)))

    assert (look(Interpolation.CONSTANT, [[1, 2, 3]]) == [1, 2, 3]).all()
    assert (look(Interpolation.CONSTANT, [[2]]) == 2).all()
    by_face = look(Interpolation.FACE, [[1, 0, 0], [0, 1, 0]])
    assert (by_face[3, 1:] == [1, 0, 0]).all()  # below the diagonal
    assert (by_face[0, :3] == [0, 1, 0]).all()
    x, y = np.meshgrid((np.arange(4) + 0.5) / 4, 1 - (np.arange(4) + 0.5) / 4)
    by_point = look(Interpolation.POINT, [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    np.testing.assert_allclose(by_point, np.stack([x, y, np.ones((4, 4))], axis=-1), atol=1e-3)
    corners = [[0, 0], [1, 0], [1, 1], [5, 5], [5, 5], [5, 5]]
    by_corner = look(Interpolation.CORNER, corners)
    below = (y < x - 0.1)[..., None] & np.ones(3, bool)
    np.testing.assert_allclose(by_corner[below], np.stack([x, y, y], axis=-1)[below], atol=1e-3)
    assert (by_corner[0, 0] == 5).all()
    assert (pixels_of(look_at_plate(GLOW, {}, (2, 2))) == [0.125, 0.25, 0.5]).all()  # nobody has it


def test_corners_of_a_mirrored_mesh() -> None:
    corners = [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]
    mesh = one_triangle_pair(Interpolation.CORNER, corners)
    camera = replace(orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0), window=(-1, 1, -1, 1))
    d = describe([(mesh, scaling(-1, 1, 1))], [GLOW], camera=camera, resolution=(4, 4))
    straight = pixels_of(look_at_plate(GLOW, {}, (4, 4), mesh))
    np.testing.assert_allclose(pixels_of(d), straight[:, ::-1], atol=2e-3)


def test_primvars_on_spheres_and_on_parts_of_meshes() -> None:
    camera = orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0)
    sphere = Sphere("/s", 4.0, 0, (primvar("glow", [[3.0, 2.0, 1.0]], Interpolation.CONSTANT),))
    d = describe([(sphere, np.eye(4))], [GLOW], camera=camera, resolution=(2, 2))
    assert (pixels_of(d) == [3, 2, 1]).all()
    # A cut-out on one of a mesh's two triangles: the core has it apart from the other, each with its own rows.
    mesh = one_triangle_pair(Interpolation.FACE, [[1, 0, 0], [0, 1, 0]])
    mesh = replace(mesh, surface=np.array([1, 0], np.int32))
    cutout = replace(GLOW, opacity_threshold=0.5, inputs=(*GLOW.inputs, ("opacity", PrimvarInput("absent", (0.7,)))))
    got = pixels_of(describe([(mesh, np.eye(4))], [GLOW, cutout], camera=camera, resolution=(4, 4)))
    assert (got[3, 1:] == [1, 0, 0]).all()
    assert (got[0, :3] == [0, 1, 0]).all()


def instanced(matrices: np.ndarray, *primvars: Primvar, own: tuple[Primvar, ...] = ()) -> Described:
    """Three plates side by side, each filling a pixel."""
    shape = with_primvars(plate(half=0.9), *own)
    camera = replace(orthographic(look_at([2, 0, 5], [2, 0, 0]), 1.0), window=(-3, 3, -1, 1))
    return describe(
        surfaces=[GLOW], camera=camera, resolution=(3, 1), prototypes=[Prototype("/p", (Placed(0, np.eye(4)),))],
        prototype_shapes=[shape], placements=[placement(0, matrices, tuple(primvars))],
    )  # fmt: skip


def test_the_primvar_of_a_shape_is_nearer_than_its_instances() -> None:
    """An instance's are constant at its root, as if inherited from there (UsdGeomPointInstancer)."""
    matrices = np.stack([translation(2 * i, 0, 0)[:3] for i in range(3)])
    own = (primvar("glow", [[9.0]], Interpolation.CONSTANT),)
    glow = primvar("glow", [[1.0], [2.0], [3.0]], Interpolation.INSTANCE)
    assert (pixels_of(instanced(matrices, own=own)) == 9).all()
    assert pixels_of(instanced(matrices, glow))[0, :, 0].tolist() == [1, 2, 3]
    assert (pixels_of(instanced(matrices, glow, own=own)) == 9).all()


def test_instances_that_are_left_out_take_their_primvars_along() -> None:
    matrices = np.stack([translation(0, 0, 0)[:3], np.zeros((3, 4)), translation(2, 0, 0)[:3], translation(4, 0, 0)[:3]])
    described = instanced(matrices, primvar("glow", [[1.0], [7.0], [2.0], [3.0]], Interpolation.INSTANCE))
    scene, warnings, _ = upload(described.description, {}, 1e-3, inverse_cdf(Filter.BOX, 1e-3))
    assert [code for code, _, _ in warnings] == ["singular-transform"]
    assert render(scene, 1).pixels(1.0)[0, :, 0].tolist() == [1, 2, 3]


def test_what_is_not_finite_is_black() -> None:
    mesh = one_triangle_pair(Interpolation.CONSTANT, [[np.nan, np.inf, 1.0]])
    assert (pixels_of(look_at_plate(GLOW, {}, (2, 2), mesh)) == [0, 0, 1]).all()


def test_a_furnace_gives_the_albedo() -> None:
    """Under an even sky of 1 a convex Lambert surface shows its albedo exactly; coated ones never more than 1."""
    sky = [light(LightType.DOME)]
    surface = replace(lambert(0.5), inputs=(("diffuse_color", texture()),))
    got = pixels_of(look_at_plate(surface, {FILE: image(PICTURE)}, (7, 5), lights=sky))
    np.testing.assert_allclose(got, PICTURE[..., :3], atol=CLOSE)
    rough, white = TextureFile("rough", "raw"), np.ones((1, 1, 3))
    scalars = (("roughness", "r"), ("metallic", "g"), ("clearcoat", "b"))
    inputs = (("diffuse_color", texture(file=rough)), *((name, texture(channel)) for name, channel in scalars))
    varying = Surface("/m", inputs=inputs)
    d = look_at_plate(varying, {FILE: image(PICTURE), rough: image(white)}, (7, 5), lights=sky)
    got = pixels_of(d, 4096)
    assert got.max() < 1.01
    assert got.min() > 0.4  # rough metal loses what scatters twice


def test_inputs_are_kept_within_what_they_mean() -> None:
    """Values out of range act as the nearest that is in it."""

    def look(value: float) -> np.ndarray:
        fields = ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "opacity")
        surface = Surface("/m", inputs=tuple((f, PrimvarInput("x", (value,))) for f in fields))
        return pixels_of(look_at_plate(surface, {}, (2, 2), lights=[light(LightType.DOME)]), 16)

    for beyond, bound in ((7.0, 1.0), (-2.0, 0.0), (1e30, 1.0)):
        assert np.array_equal(look(beyond), look(bound))


def test_st_of_other_names_and_fallbacks() -> None:
    other = PrimvarInput("map1", (0.5 / 7, 0.5 / 5))
    got = pixels_of(look_at_plate(glowing(texture(st=other)), {FILE: image(PICTURE)}, (2, 2)))
    np.testing.assert_allclose(got, np.broadcast_to(PICTURE[4, 0, :3], (2, 2, 3)), atol=CLOSE)
    mesh = with_primvars(plate(np.zeros((4, 2))), primvar("map1", UNIT_ST))
    surface = replace(
        glowing(texture(st=other)),
        inputs=(("emissive_color", texture(st=other)), ("diffuse_color", texture(st=ST))),
    )
    got = pixels_of(look_at_plate(surface, {FILE: image(PICTURE)}, (7, 5), mesh))
    np.testing.assert_allclose(got, PICTURE[..., :3], atol=CLOSE)
