"""Meshes that are hard to hit right: slivers, nothing but edges, the same place twice, grazing light, far vertices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.described import look_at, rotation, scaling, translation
from tests.hard.meshes.mesh_stages import DOME, camera_prim, codes, mesh_prim, picture, place, prim, rows

from primray.description import Doubles

Measured = Callable[[str], None]

EYE = look_at([0, 0, 10], [0, 0, 0])
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def strip(slivers: int, width: float, start: float) -> tuple[Doubles, list[list[int]]]:
    """A rectangle one unit high of this many triangles, each `width` wide at its base."""
    x = start + width * np.arange(slivers + 2) / 2
    points = np.stack([x, np.where(np.arange(slivers + 2) % 2, 0.5, -0.5), np.zeros(slivers + 2)], axis=1)
    return points, [[i, i + 1, i + 2] if i % 2 else [i, i + 2, i + 1] for i in range(slivers)]


@pytest.mark.parametrize("start", [-1e-4, 1.0], ids=["about the origin", "at 1, where they are one float wide"])
@pytest.mark.parametrize("aspect", [1e5, 1e7])
@pytest.mark.hard_case(
    "Meshes",
    "a rectangle of slivers, aspect and place: %s",
    expected="no hole, and the same light as on one rectangle",
)
def test_slivers(aspect: float, start: float, measured: Measured) -> None:
    slivers = round(4e-4 * aspect)
    points, faces = strip(slivers, 1 / aspect, start)
    middle = start + 1e-4
    eye = camera_prim(look_at([middle, 0.1, 1], [middle, 0.1, 0]), 4e-5, orthographic=True)
    image = picture(eye + DOME + mesh_prim(points, faces), (32, 32), 16, max_depth=1)
    assert (image.pixels[..., 3] == 1).all()
    assert np.abs(image.pixels[..., :3] - 0.5).max() < 1e-6
    assert set(codes(image)) <= {"faces-degenerate"}
    measured("no hole; the light to 1e-6")


def test_slivers_of_any_direction() -> None:
    """Turned, points are rounded by more than such slivers are wide: still no hole, nothing black and nothing undefined."""
    points, faces = strip(2000, 1e-7, -1e-4)
    turn = translation(0.3, 0.2, 0.1) @ rotation((1, 2, 3), 50)
    at = turn @ np.array([[-5e-5, 0, 0.0, 1], [-5e-5, 0, 1.0, 1]]).T
    eye = camera_prim(look_at(at[:3, 1], at[:3, 0]), 2e-5, orthographic=True)
    image = picture(eye + DOME + mesh_prim(points, faces, matrix=turn), (32, 32), 16)
    assert image.pixels[..., 3].mean() > 0.99
    assert np.isfinite(image.pixels).all()
    assert image.pixels[..., :3].min() > 0.2


FLAT_FACES = [[0, 0, 0], [0, 1, 1], [0, 1, 4], [2, 2, 2, 2], [0, 1, 0, 1]]


@pytest.mark.parametrize("scheme", ["none", "catmullClark", "bilinear", "loop"])
@pytest.mark.hard_case(
    "Meshes", "faces without area (points, lines, repeated vertices) among others, subdivision %s", expected="as without them"
)
def test_faces_without_area(scheme: str, measured: Measured) -> None:
    points = np.vstack([SQUARE, (SQUARE[0] + SQUARE[1]) / 2])
    good = [[0, 1, 2], [0, 2, 3]] if scheme == "loop" else [[0, 1, 2, 3]]
    bad = [f for f in FLAT_FACES if scheme != "loop" or len(f) == 3]
    eye = camera_prim(EYE, 0.15)
    image = picture(eye + DOME + mesh_prim(points, [*good, *bad], scheme=scheme), (24, 24), 16)
    without = picture(eye + DOME + mesh_prim(points, good, scheme=scheme), (24, 24), 16)
    assert np.isfinite(image.pixels).all()
    if scheme == "none":
        assert codes(image) == ["faces-degenerate"]
        np.testing.assert_array_equal(image.pixels, without.pixels)
    else:
        assert image.pixels[..., 3].max() == 1
        assert set(codes(image)) <= {"cage-topology", "faces-degenerate"}
    if scheme == "bilinear":
        np.testing.assert_allclose(image.pixels, without.pixels, atol=1e-3)
    measured("equal" if scheme == "none" else "finite, the rest is drawn" if scheme != "bilinear" else "equal to 1e-3")


def test_emitting_faces_without_area() -> None:
    glow = prim(
        "Material",
        "glow",
        "token outputs:surface.connect = </glow/s.outputs:surface>",
        prim("Shader", "s", 'uniform token info:id = "UsdPreviewSurface"', "color3f inputs:emissiveColor = (9, 9, 9)",
             "token outputs:surface"),
    )  # fmt: skip
    lamp = mesh_prim(
        np.vstack([SQUARE, SQUARE[0]]) + [0, 0, 3], [[0, 1, 2, 3], *FLAT_FACES], "rel material:binding = </glow>", name="lamp"
    )
    lamp = lamp.replace('"lamp"', '"lamp" (prepend apiSchemas = ["MaterialBindingAPI"])')
    image = picture(
        camera_prim(look_at([4, 0, 4], [0, 0, 0]), 0.3) + glow + lamp + mesh_prim(SQUARE, [[0, 1, 2, 3]]), (16, 16), 64
    )
    assert "invalid-samples" not in codes(image)
    assert image.pixels[8, 8, 0] > 0.5


RED, GREEN = (0.8, 0.1, 0.1), (0.1, 0.8, 0.1)
TWICE = {
    "the same faces": mesh_prim(SQUARE, [[0, 1, 2, 3]], name="green", color=GREEN),
    "split along the other diagonal": mesh_prim(SQUARE[[1, 2, 3, 0]], [[0, 1, 2, 3]], name="green", color=GREEN),
    "turned around": mesh_prim(SQUARE, [[3, 2, 1, 0]], name="green", color=GREEN),
    "turned by 30 degrees": mesh_prim(SQUARE * 3, [[0, 1, 2, 3]], name="green", color=GREEN, matrix=rotation((0, 0, 1), 30)),
    "instanced": prim(
        "Xform", "a", place(scaling(1, 1, 1)), mesh_prim(SQUARE, [[0, 1, 2, 3]], name="green", color=GREEN)
    ).replace('"a"', '"a" (instanceable = true)'),
}


@pytest.mark.parametrize("twin", TWICE)
@pytest.mark.parametrize("tilt", [0, 35])
@pytest.mark.hard_case(
    "Meshes",
    "two surfaces in one plane, the second: %s",
    expected="each sample is one or the other, never black, the same in every run",
    plain_float="samples between the two are black where their own twin shadows them",
)
def test_coplanar_surfaces(twin: str, tilt: float, measured: Measured) -> None:
    turned = rotation((1, 1, 0), tilt)
    red = mesh_prim(SQUARE, [[0, 1, 2, 3]], name="red", color=RED)
    both = prim("Xform", "both", place(turned), red + TWICE[twin])
    text = camera_prim(EYE, 0.05) + DOME + both
    image = picture(text, (64, 64), 1, max_depth=1, threads=1)
    pixels = image.pixels[..., :3]
    of_one = np.minimum(np.abs(pixels - RED).max(axis=2), np.abs(pixels - GREEN).max(axis=2))
    assert of_one.max() < 1e-6
    again = picture(text, (64, 64), 1, max_depth=1, threads=2)
    np.testing.assert_array_equal(image.pixels, again.pixels)
    measured("all samples are one or the other")


def test_a_face_twice_in_one_mesh() -> None:
    text = camera_prim(EYE, 0.05) + DOME + mesh_prim(SQUARE, [[0, 1, 2, 3], [0, 1, 2, 3], [1, 2, 3, 0], [3, 2, 1, 0]])
    assert np.abs(picture(text, (32, 32), 4, max_depth=1).pixels[..., :3] - 0.5).max() < 1e-6


# Grazing rays.


def grazing(
    elevation_deg: float, size: float, matrix: Doubles | None = None, light: str = "distant"
) -> tuple[np.ndarray, float]:
    """Ground seen and lit at this elevation, and its exact radiance with albedo 0.5."""
    a = np.radians(elevation_deg)
    m = np.eye(4) if matrix is None else matrix
    ground = mesh_prim(SQUARE[:, [0, 2, 1]] * [size, 1, -size], [[0, 1, 2, 3]])
    eye = camera_prim(
        look_at([-0.5 * size * np.cos(a), 0.5 * size * np.sin(a), 0], [0, 0, 0]), np.sin(a) * 0.4, orthographic=False
    )
    sun = prim("DistantLight", "sun", "float inputs:intensity = 1", "bool inputs:normalize = 1", "float inputs:angle = 0",
               place(look_at([np.cos(a) * 0.6, np.sin(a), np.cos(a) * 0.8], [0, 0, 0])))  # fmt: skip
    image = picture(prim("Xform", "world", place(m), eye + ground + sun), (32, 32), 4, max_depth=2)
    sine = np.sin(a) / np.hypot(np.cos(a), np.sin(a))
    return image.pixels, 0.5 / np.pi * sine


@pytest.mark.parametrize("elevation", [1.0, 0.1, 0.01], ids=["89", "89.9", "89.99"])
@pytest.mark.parametrize("turned", [False, True], ids=["level", "turned"])
@pytest.mark.hard_case(
    "Meshes",
    "a plane lit and seen at an angle, level or turned: %s",
    expected="irradiance as the cosine says, no acne",
    plain_float="a cosine of 1.7e-4 is known to 4e-4 of itself",
)
def test_grazing_light(elevation: float, turned: bool, measured: Measured) -> None:
    pixels, exact = grazing(elevation, 1000, translation(3, 1, 2) @ rotation((1, 2, 3), 70) if turned else None)
    seen = pixels[pixels[..., 3] == 1][:, :3]
    assert len(seen) > 200
    off = float(np.abs(seen / exact - 1).max())
    assert off < 3e-3
    measured("the cosine to 3e-3, no pixel darker")


# Shadows of a surface on itself.

ROUND = {
    "an exact sphere": prim("Sphere", "s"),
    "an ellipsoid": prim("Sphere", "s", place(translation(0.2, 0, 0) @ rotation((1, 2, 3), 40) @ scaling(1, 0.01, 0.3))),
    "a diced cage": mesh_prim(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]],
        scheme="catmullClark",
    ),
    "a cylinder": prim("Cylinder", "c"),
    "a sphere of radius 1e-4 at 1000": prim("Sphere", "s", "double radius = 1e-4"),
}  # fmt: skip


@pytest.mark.parametrize("shape", ROUND)
@pytest.mark.hard_case(
    "Meshes",
    "a convex body under a white sky, one scattering: %s",
    expected="no ray meets the body it leaves",
)
def test_convex_bodies_do_not_shadow_themselves(shape: str, measured: Measured) -> None:
    small = "1e-4" in shape
    at = np.array([1000.0, 500, -300]) if small else np.zeros(3)
    grey = "{\ncolor3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]\n"
    made = ROUND[shape] if "Mesh" in ROUND[shape] else ROUND[shape].replace("{\n", grey, 1)
    body = prim("Xform", "body", place(translation(*at)), made)
    eye = camera_prim(look_at(at + (np.array([3, 2, 6.0]) * (1e-4 if small else 1)), at), 0.2)
    image = picture(eye + DOME + body, (64, 64), 16, max_depth=1)
    inside = image.pixels[image.pixels[..., 3] == 1][:, :3]
    assert len(inside) > 30
    assert inside.max() < 0.5 + 1e-6
    lost = float(0.5 - inside.mean())
    assert lost < (1e-4 if shape == "a diced cage" else 1e-6)
    measured("none" if lost < 1e-6 else "fewer than 2 of 10,000")


def waves(n: int, height: float, *, smooth: bool) -> str:
    """A square of n x n faces displaced by noise of this slope."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    z = rng.uniform(-height / n, height / n, x.shape)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    normals = None
    if smooth:
        p = points[triangles]
        face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        normals = np.zeros_like(points)
        np.add.at(normals, triangles.ravel(), np.repeat(face, 3, axis=0))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
    return mesh_prim(points, triangles.tolist(), normals=normals)


@pytest.mark.parametrize("smooth", [False, True], ids=["faceted", "smooth"])
@pytest.mark.hard_case(
    "Meshes",
    "a surface of 20,000 triangles displaced by noise, %s, lit steeper than its steepest slope",
    expected="no point shadows another: no acne",
)
def test_displaced_surfaces(smooth: bool, measured: Measured) -> None:
    """Slopes are at most 1 along x and y (54.8 degrees), the sun stands at 60."""
    sun = prim("DistantLight", "sun", "float inputs:intensity = 1", "bool inputs:normalize = 1", "float inputs:angle = 0",
               place(look_at([np.cos(np.radians(60)), 0, np.sin(np.radians(60))], [0, 0, 0], (0, 0, 1))))  # fmt: skip
    image = picture(camera_prim(EYE, 0.09) + sun + waves(100, 1.0, smooth=smooth), (128, 128), 1, max_depth=1)
    assert (image.pixels[..., 3] == 1).all()
    assert image.pixels[..., 0].min() > 0.5 / np.pi * np.cos(np.radians(54.8 + 30))
    measured("no pixel in shadow")


# Vertices beyond floats.

FAR = mesh_prim([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0], [0, 0, 0]], [[0, 1, 2], [1, 3, 2], [0, 4, 1]], name="cube")


def one_far(x: str) -> str:
    """The last vertex, of one face of three, elsewhere."""
    return FAR.replace("(0, 0, 0)", f"({x}, 3, -5)")


INSTANCER = """def PointInstancer "pi"
{
    rel prototypes = </pi/cube>
    point3f[] positions = [(0, 0, 0), (0, -3, 0)]
    int[] protoIndices = [0, 0]
%s}
"""
PLACED = {
    "alone": "%s",
    "with others": "%s" + prim("Sphere", "other", place(translation(30, 0, 0))),
    "instanced": 'def Xform "a" (instanceable = true)\n{\n%s}\n',
    "in a point instancer": INSTANCER,
}


@pytest.mark.parametrize("where", PLACED)
@pytest.mark.parametrize("x", ["1e19", "1e25", "1e36", "1e38", "-3e38"])
@pytest.mark.hard_case(
    "Meshes",
    "one vertex of a mesh at %s",
    expected="its faces are drawn or named in a diagnostic, the others are as they were",
    plain_float="the whole mesh vanishes: the scale follows the vertex; Embree leaves out bounds beyond 1.8e18",
)
def test_one_vertex_far_away(x: str, where: str, measured: Measured) -> None:
    eye = camera_prim(EYE, 0.1)
    image = picture(eye + DOME + PLACED[where] % one_far(x), (32, 32), 16)
    without = picture(eye + DOME + PLACED[where] % FAR.replace("[3, 3, 3]", "[3, 3]").replace(", 0, 4, 1]", "]"), (32, 32), 16)
    found = [c for c in codes(image) if c != "camera-chosen"]
    assert len(found) == 1
    assert found[0] in ("too-far", "faces-dropped", "far-edges")
    if found[0] != "far-edges":
        assert (image.pixels[..., 3] == 1).mean() > 0.7
        np.testing.assert_allclose(image.pixels, without.pixels, atol=2e-3)
    assert np.isfinite(image.pixels).all()
    measured(f"`{found[0]}`")


@pytest.mark.parametrize("x", ["1e30", "3e38"])
@pytest.mark.hard_case("Instances", "an instance at %s beside one at 0", expected="a diagnostic, the other is drawn")
def test_an_instance_far_away(x: str, measured: Measured) -> None:
    positions = PLACED["in a point instancer"].replace("(0, -3, 0)", f"({x}, 0, 0)")
    text = positions % mesh_prim(SQUARE, [[0, 1, 2, 3]], name="cube")
    image = picture(camera_prim(EYE, 0.05) + DOME + text, (16, 16), 4)
    assert codes(image) == ["too-far"]
    assert (image.pixels[..., 3] == 1).all()
    measured("`too-far`")


def test_a_sphere_far_away() -> None:
    far = prim("Sphere", "far", place(translation(1e30, 0, 0)))
    image = picture(camera_prim(EYE, 0.05) + DOME + prim("Sphere", "near") + far, (16, 16), 4)
    assert codes(image) == ["too-far"]
    assert (image.pixels[..., 3] == 1).all()


def test_rows_are_exact() -> None:
    """The text of points has every bit of a float."""
    values = np.random.default_rng(0).normal(size=(100, 3)).astype(np.float32)
    read = np.array([float(x) for x in rows(values).replace("(", "").replace(")", "").strip("[]").split(",")], np.float32)
    np.testing.assert_array_equal(read.reshape(-1, 3), values)
