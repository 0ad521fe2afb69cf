"""AOVs against closed forms at every pixel: where, how far, which way it faces, what is on it and what it reflects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from pxr import Usd
from tests.images.aovs.seen import Ball, Box, Seen, look, rays, stage_of

from primray import render
from primray.aovs import AOVS
from primray.images.image import Image, pixels_sha256
from primray.settings import Filter, RenderSettings

SIZE = (72, 54)
PLACES = ("depth", "distance", "position", "camera_position", "normal", "geometric_normal", "camera_normal", "prim")

BODIES = """
def Sphere "a_ball"
{
    double radius = 1
}
def Cube "b_box"
{
    double size = 1
    double3 xformOp:translate = (1.75, 0.25, 0.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Cube "c_wall"
{
    double size = 1
    double3 xformOp:translate = (0, 0, -4)
    float3 xformOp:scale = (5, 3.5, 0.125)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""
SHAPES = (Ball((0, 0, 0), 1), Box((1.25, -0.25, 0), (2.25, 0.75, 1)), Box((-2.5, -1.75, -4.0625), (2.5, 1.75, -3.9375)))


def picture(stage: Usd.Stage, aovs: Sequence[str], size: tuple[int, int] = SIZE, **settings: object) -> Image:
    return render(stage, RenderSettings(resolution=size, spp=2, aovs=tuple(aovs), **settings))  # type: ignore[arg-type]


def values(image: Image, name: str) -> np.ndarray:
    found = image.aovs[name].values
    return found[..., 0] if found.shape[2] == 1 else found


def check_places(image: Image, seen: Seen, size: tuple[int, int], far: float) -> None:
    """`far`: the largest distance that floats near the camera must hold. Directions of rays are floats: points move by some
    2^-23 of their distance, the more the more the surface is seen edge-on."""
    assert image.camera is not None
    m = image.camera.world_from_camera
    assert np.mean(~seen.sure) < 0.1
    assert {int(n) for n in np.unique(seen.what)} >= {-1, 0}
    s = seen.sure
    assert np.array_equal(values(image, "prim")[s], (seen.what + 1)[s])
    there = s & (seen.what >= 0)
    with np.errstate(divide="ignore"):
        cosine = np.abs((seen.normal * seen.direction).sum(axis=2))
    slack = 2.0**-22 * far / np.maximum(cosine, 1e-3)[there]
    from_eye = (seen.point - m[:3, 3]) @ m[:3, :3]
    for name, expected in (
        ("depth", -from_eye[..., 2]),
        ("distance", seen.t),
        ("position", seen.point),
        ("camera_position", from_eye),
    ):
        found = values(image, name)
        error = np.abs(found[there] - expected[there])
        assert (error.max(axis=1) if error.ndim == 2 else error).max() > 0  # not the same computation
        assert ((error.max(axis=1) if error.ndim == 2 else error) <= slack).all(), name
        background = found[s & (seen.what < 0)]
        assert (np.isinf(background) if found.ndim == 2 else background == 0).all()
    for name, expected in (
        ("normal", seen.normal),
        ("geometric_normal", seen.normal),
        ("camera_normal", seen.normal @ m[:3, :3]),
    ):
        # A ball's normal turns as far as the point moves along its surface.
        assert (np.abs(values(image, name) - expected)[there].max(axis=1) <= 2 * slack + 2e-6).all(), name
        assert (values(image, name)[s & (seen.what < 0)] == 0).all()


def test_places_and_directions() -> None:
    image = picture(stage_of(BODIES, (1, 0.5, 6), (-5, 9, 3)), PLACES)
    assert image.camera is not None
    check_places(image, look(image.camera, SIZE, SHAPES), SIZE, 12.0)
    assert image.aovs["prim"].ids == {1: "/a_ball", 2: "/b_box", 3: "/c_wall"}


def test_orthographic() -> None:
    stage = stage_of(BODIES, (1, 0.5, 6), (-5, 9, 3))
    stage.GetPrimAtPath("/cam").GetAttribute("projection").Set("orthographic")
    for side in ("horizontalAperture", "verticalAperture"):
        stage.GetPrimAtPath("/cam").GetAttribute(side).Set(60.0)
    image = picture(stage, PLACES)
    assert image.camera is not None
    check_places(image, look(image.camera, SIZE, SHAPES), SIZE, 12.0)


def test_seen_from_inside_normals_face_the_viewer() -> None:
    image = picture(stage_of('def Sphere "a_ball"\n{\n    double radius = 20\n}\n', (3, 2, 1)), PLACES)
    assert image.camera is not None
    seen = look(image.camera, SIZE, (Ball((0, 0, 0), 20),))
    assert (seen.what == 0).all()
    direction = rays(image.camera, SIZE)[1]
    assert ((values(image, "normal") * direction).sum(axis=2) < 0).all()
    np.testing.assert_allclose(values(image, "normal"), seen.normal, atol=3e-6)


@pytest.mark.parametrize("offset", [1e5, 1e7])
def test_far_from_the_worlds_origin_only_the_distance_to_the_camera_counts(offset: float) -> None:
    """All moved together: positions stay as exact as near the origin, though a float there is a whole unit wide."""
    at = np.array([offset, -offset / 4, offset / 2])  # float matrices hold these exactly
    moved = 'def Xform "far"\n{\n    double3 xformOp:translate = ' + str(tuple(at.tolist()))
    text = moved + '\n    uniform token[] xformOpOrder = ["xformOp:translate"]\n' + BODIES + "}\n"
    image = picture(stage_of(text, tuple(at + (1, 0.5, 6)), (-5, 9, 3)), PLACES)
    assert image.camera is not None
    shapes = [Ball(at + s.center, s.radius) if isinstance(s, Ball) else Box(at + s.low, at + s.high) for s in SHAPES]
    seen = look(image.camera, SIZE, shapes)
    assert image.aovs["position"].values.dtype == np.float64
    check_places(image, seen, SIZE, 12.0)


def test_a_stretched_instance_has_the_normals_of_an_ellipsoid() -> None:
    text = """
def Xform "one" (
    instanceable = true
    references = </_ball>
)
{
    float3 xformOp:scale = (1.5, 0.5, -0.75)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
def Xform "two" (
    instanceable = true
    references = </_ball>
)
{
    double3 xformOp:translate = (5, 2, -12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
class "_ball"
{
    def Sphere "ball"
    {
        double radius = 1
    }
}
"""
    image = picture(stage_of(text), ("position", "normal", "geometric_normal", "instance"))
    near = values(image, "instance") == 1
    assert image.aovs["instance"].ids == {1: "/one", 2: "/two"}
    p = values(image, "position")[near]
    scale = np.array([1.5, 0.5, 0.75])
    np.testing.assert_allclose(((p / scale) ** 2).sum(axis=1), 1, atol=3e-6)
    gradient = p / scale**2
    expected = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    for name in ("normal", "geometric_normal"):
        np.testing.assert_allclose(values(image, name)[near], expected, atol=1e-5)


SQUARE = """
def Mesh "square"
{
    point3f[] points = [(-2, -1.5, 0), (2, -1.5, 0), (2, 1.5, 0), (-2, 1.5, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
MORE
}
"""


def test_smooth_normals_are_interpolated_and_made_unit_length() -> None:
    """Normals that lean with x: at both ends of every edge the same, so linear over the whole square."""
    lean = 'normal3f[] normals = [(-0.6, 0, 0.8), (0.6, 0, 0.8), (0.6, 0, 0.8), (-0.6, 0, 0.8)] (interpolation = "vertex")'
    image = picture(stage_of(SQUARE.replace("MORE", lean)), ("position", "normal", "geometric_normal", "prim"))
    there = values(image, "prim") == 1
    x = values(image, "position")[there][:, 0]
    n = np.stack([0.3 * x, 0 * x, 0.8 + 0 * x], axis=1)
    np.testing.assert_allclose(values(image, "normal")[there], n / np.linalg.norm(n, axis=1, keepdims=True), atol=2e-6)
    np.testing.assert_array_equal(values(image, "geometric_normal")[there], np.array([[0, 0, 1]] * int(there.sum())))


CUBE = """
def Mesh "cube"
{
    point3f[] points = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [4, 5, 6, 7, 1, 0, 3, 2, 5, 1, 2, 6, 0, 4, 7, 3, 7, 6, 2, 3, 0, 1, 5, 4]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (5, 5)] (interpolation = "faceVarying")
    int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]
    int[] primvars:side = [7, 16777216] (interpolation = "uniform")
    int[] primvars:side:indices = [0, 0, 1, 1, 0, 1]
    point3f[] primvars:rest = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1),
        (-1, 1, 1)] (interpolation = "vertex")
    float4[] primvars:whole = [(1, 2.5, -3, 4e5)] (interpolation = "constant")
}
"""


def test_primvars_of_every_interpolation() -> None:
    wanted = ("st", "primvar:st", "primvar:side", "primvar:rest", "primvar:whole", "primvar:none", "position", "normal", "prim")
    image = picture(stage_of(CUBE, (3, 2.5, 4), (-26, 36, 0)), wanted)
    there = values(image, "prim") == 1
    p, n = values(image, "position")[there], np.rint(values(image, "normal")[there]).astype(int)
    assert {tuple(row) for row in n.tolist()} == {(0, 0, 1), (1, 0, 0), (0, 1, 0)}
    # As the faces are laid out above: +Z from (-x, -y), +X from (-y, +z), +Y from (-x, +z).
    z, x = (n[:, 2] == 1)[:, None], (n[:, 0] == 1)[:, None]
    st = np.where(z, p[:, [0, 1]], np.where(x, np.stack([-p[:, 2], p[:, 1]], 1), np.stack([p[:, 0], -p[:, 2]], 1))) / 2 + 0.5
    np.testing.assert_allclose(values(image, "st")[there], st, atol=2e-6)
    np.testing.assert_array_equal(values(image, "st"), values(image, "primvar:st"))
    np.testing.assert_array_equal(values(image, "primvar:side")[there], np.where(x[:, 0], 16777216, 7))
    np.testing.assert_allclose(values(image, "primvar:rest")[there], p, atol=4e-6)
    np.testing.assert_array_equal(values(image, "primvar:whole")[there], [[1, 2.5, -3, 4e5]] * int(there.sum()))
    assert image.aovs["primvar:whole"].channels == ("whole.R", "whole.G", "whole.B", "whole.A")
    for name in wanted[:6]:
        assert (values(image, name)[~there] == 0).all()
    assert (values(image, "primvar:none") == 0).all()
    assert [d["code"] for d in image.report["diagnostics"] if d["code"] == "aov-empty"] == ["aov-empty"]


def test_a_primvar_that_a_material_reads_in_part_is_whole_in_its_aov() -> None:
    more = """
    color3f[] primvars:wear = [(0.25, 0.5, 0.75)] (interpolation = "constant")
    rel material:binding = </m>
"""
    material = """
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:roughness.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "wear"
        float outputs:result
    }
}
"""
    square = SQUARE.replace('def Mesh "square"', 'def Mesh "square" (\n    prepend apiSchemas = ["MaterialBindingAPI"]\n)')
    image = picture(stage_of(square.replace("MORE", more) + material), ("primvar:wear", "prim", "material"))
    there = values(image, "prim") == 1
    np.testing.assert_array_equal(values(image, "primvar:wear")[there], [[0.25, 0.5, 0.75]] * int(there.sum()))
    assert image.aovs["material"].ids == {1: "/m"}
    assert np.array_equal(values(image, "material") == 1, there)


def test_point_samples_are_taken_through_the_lens_and_the_pixels_centre() -> None:
    sharp = stage_of(BODIES)
    blurred = stage_of(BODIES)
    for name, value in (("fStop", 0.5), ("focusDistance", 2.0)):
        blurred.GetPrimAtPath("/cam").GetAttribute(name).Set(value)
    one, other = (picture(s, PLACES, filter=Filter.GAUSSIAN, filter_width=5.0) for s in (sharp, blurred))
    assert pixels_sha256(one.pixels) != pixels_sha256(other.pixels)
    for name in PLACES:
        assert np.array_equal(values(one, name), values(other, name))


def test_aovs_change_no_bit_of_the_picture() -> None:
    stage = stage_of(BODIES)
    alone, beside = picture(stage, ()), picture(stage, tuple(AOVS))
    assert alone.aovs == {}
    assert set(beside.aovs) == set(AOVS)
    assert pixels_sha256(alone.pixels) == pixels_sha256(beside.pixels)
    assert (values(beside, "samples") == 2).all()


def test_a_data_window_cuts_or_widens_all_of_them() -> None:
    """The pixels that a window and the whole have in common are the same; beyond the frame there is more of the same scene."""
    product = """
def RenderSettings "settings"
{
    rel camera = </cam>
    uniform int2 resolution = (72, 54)
    uniform float4 dataWindowNDC = WINDOW
}
"""
    names = (*PLACES, "albedo", "emission", "samples")

    def with_window(window: str) -> Image:
        return render(stage_of(BODIES + product.replace("WINDOW", window)), RenderSettings(spp=2, aovs=names))

    whole, part, more = (with_window(w) for w in ("(0, 0, 1, 1)", "(0.25, 0.5, 0.75, 1)", "(-0.25, 0, 1.25, 1)"))
    assert (part.resolution, more.resolution) == ((36, 27), (108, 54))
    for name in names:
        assert np.array_equal(values(part, name), values(whole, name)[:27, 18:54])
        assert np.array_equal(values(more, name)[:, 18:90], values(whole, name))


def test_clipping_planes_cut_what_is_seen_first() -> None:
    stage = stage_of(BODIES)
    stage.GetPrimAtPath("/cam").GetAttribute("clippingPlanes").Set([(0, 0, -1, -6)])  # all before z = 0 is cut off
    image = picture(stage, ("depth", "prim", "normal"))
    seen = values(image, "depth")[values(image, "prim") == 1]
    assert seen.min() >= 6
    assert seen.max() <= 7
    assert (values(image, "normal")[27, 36] > 0.9).any()  # of the ball's inside
