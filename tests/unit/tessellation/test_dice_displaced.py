"""Meshes that materials displace, against what is known of them in closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.displaced import (
    CUBE,
    POSITION,
    QUADS,
    SETTINGS,
    described,
    diced,
    holes,
    materialx,
    node,
    normals_by_corner,
    preview,
    uniform,
)

from primray import core
from primray.description import Mesh
from primray.tessellation.dice import Dicing, dice

SCHEMES = ["none", "bilinear", "catmullClark"]

# z = 0.2 sin(2 x) cos(3 y), in the shape's own space.
WAVES = materialx(
    "float inputs:displacement.connect = </m/product.outputs:out>\n float inputs:scale = 0.2",
    POSITION
    + node(
        "at", "ND_separate3_vector3", "float3 inputs:in.connect = </m/p.outputs:out>", "float outputs:outx\n float outputs:outy"
    )
    + node(
        "x2", "ND_multiply_float", "float inputs:in1.connect = </m/at.outputs:outx>\n float inputs:in2 = 2", "float outputs:out"
    )
    + node(
        "y3", "ND_multiply_float", "float inputs:in1.connect = </m/at.outputs:outy>\n float inputs:in2 = 3", "float outputs:out"
    )
    + node("sin", "ND_sin_float", "float inputs:in.connect = </m/x2.outputs:out>", "float outputs:out")
    + node("cos", "ND_cos_float", "float inputs:in.connect = </m/y3.outputs:out>", "float outputs:out")
    + node(
        "product",
        "ND_multiply_float",
        "float inputs:in1.connect = </m/sin.outputs:out>\n float inputs:in2.connect = </m/cos.outputs:out>",
        "float outputs:out",
    ),
)


def only(text: str, dicing: Dicing | None = None, at: Path | None = None) -> Mesh:
    (mesh,), warnings = diced(text, dicing, at)
    assert [w for w in warnings if w[0] != "dicing-limited"] == []
    return mesh


def heights(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.asarray(0.2 * np.sin(2 * x) * np.cos(3 * y))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_plane_of_waves(scheme: str) -> None:
    """Vertices have the heights, normals are those of the surface, and its area is that of the waves."""
    mesh = only(QUADS.replace("SCHEME", scheme) + WAVES, uniform(6))
    x, y, z = mesh.points.astype(np.float64).T
    np.testing.assert_allclose(z, heights(x, y), atol=1e-6)
    dx, dy = 0.4 * np.cos(2 * x) * np.cos(3 * y), -0.6 * np.sin(2 * x) * np.sin(3 * y)
    wanted = np.stack([-dx, -dy, np.ones_like(dx)], axis=1)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    inside = (np.minimum(x, y) > 0.01) & (np.maximum(x, y) < 1.99)
    at = mesh.triangles.ravel()
    cosines = np.vecdot(normals_by_corner(mesh), wanted[at])[inside[at]]
    assert np.degrees(np.arccos(np.minimum(cosines, 1))).max() < 0.4
    p = mesh.points[mesh.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2
    u, v = np.meshgrid((np.arange(2000) + 0.5) / 1000, (np.arange(2000) + 0.5) / 1000)
    slopes = (0.4 * np.cos(2 * u) * np.cos(3 * v)) ** 2 + (0.6 * np.sin(2 * u) * np.sin(3 * v)) ** 2
    covered = (x.max() - x.min()) * (y.max() - y.min())
    if scheme != "catmullClark":  # which rounds the corners off
        assert covered == pytest.approx(4, abs=1e-6)
        assert area == pytest.approx(float(np.sqrt(1 + slopes).sum()) * 1e-6, rel=2e-4)


@pytest.mark.parametrize("scheme", ["catmullClark", "loop"])
def test_a_constant_is_along_the_limit_normals(scheme: str) -> None:
    octahedron = """def Mesh "o" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "SCHEME"
        int[] faceVertexCounts = [3, 3, 3, 3, 3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5]
        point3f[] points = [(1,0,0), (-1,0,0), (0,1,0), (0,-1,0), (0,0,1), (0,0,-1)]
        rel material:binding = </m>
    }
    """.replace("SCHEME", scheme)
    still = only(octahedron + preview(""), uniform(4))
    moved = only(octahedron + preview("float inputs:displacement = 0.3"), uniform(4))
    assert still.normals is not None
    np.testing.assert_allclose(moved.points, still.points + np.float32(0.3) * still.normals, atol=1e-6)
    assert holes(moved) == 0


def sphere(rings: int = 48) -> str:
    """Polygons of unit radius with smooth normals; ends are triangles."""
    around = 2 * rings
    theta = np.pi * np.arange(1, rings) / rings
    phi = 2 * np.pi * np.arange(around) / around
    points = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    points += [(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for t in theta for p in phi]
    at = lambda r, k: 2 + r * around + k % around  # noqa: E731
    faces = [[0, at(0, k), at(0, k + 1)] for k in range(around)]
    faces += [[at(r, k), at(r + 1, k), at(r + 1, k + 1), at(r, k + 1)] for r in range(rings - 2) for k in range(around)]
    faces += [[1, at(rings - 2, k + 1), at(rings - 2, k)] for k in range(around)]
    listed = ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in points)
    return f"""def Mesh "sphere" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = {[len(f) for f in faces]}
        int[] faceVertexIndices = {[v for f in faces for v in f]}
        point3f[] points = [{listed}]
        normal3f[] normals = [{listed}] (
            interpolation = "vertex"
        )
        rel material:binding = </m>
    }}
    """


def test_a_sphere_becomes_a_larger_one() -> None:
    mesh = only(sphere() + preview("float inputs:displacement = 0.5"), uniform(1))
    radii = np.linalg.norm(mesh.points.astype(np.float64), axis=1)
    sagitta = 1 - np.cos(np.pi / 96) ** 2  # of faces inside the sphere that they are cut from
    assert radii.max() == pytest.approx(1.5, abs=1e-6)
    assert radii.min() > 1.5 - 1.1 * sagitta
    assert holes(mesh) == 0
    outwards = mesh.points[mesh.triangles.ravel()] / radii[mesh.triangles.ravel(), None]
    assert np.vecdot(normals_by_corner(mesh), outwards).min() > np.cos(np.radians(1.5))


def subsets(count: int) -> str:
    """The first faces of a cube, each with a material of its own."""
    return "\n".join(
        f"""def GeomSubset "s{k}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [{k}]
        rel material:binding = </m{k}>
    }}"""
        for k in range(count)
    )


def by_st(name: str, scale: float) -> str:
    """A displacement by noise of st, which differs across the cube's seams."""
    nodes = node("n", "ND_noise2d_float", f"float2 inputs:texcoord.connect = </{name}/big.outputs:out>", "float outputs:out")
    nodes += node(
        "big",
        "ND_multiply_vector2FA",
        f"float2 inputs:in1.connect = </{name}/st.outputs:out>\n float inputs:in2 = 7",
        "float2 outputs:out",
    )
    nodes += node("st", "ND_texcoord_vector2", "", "float2 outputs:out")
    return materialx(
        f"float inputs:displacement.connect = </{name}/n.outputs:out>\n float inputs:scale = {scale}", nodes, name=name
    )


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("creased", [False, True])
def test_no_cracks_at_seams_creases_and_subsets(scheme: str, creased: bool) -> None:
    """Split st, sharp edges, materials that displace by other amounts or not at all; near the camera finer than far away."""
    body = subsets(3)
    if creased:
        body += """
        int[] creaseLengths = [2, 5]
        int[] creaseIndices = [0, 1, 0, 2, 6, 4, 0]
        float[] creaseSharpnesses = [10, 10]
        """
    camera = """def Camera "c" {
        float focalLength = 30
        matrix4d xformOp:transform = ((0.707,-0.707,0,0), (0.408,0.408,-0.816,0), (0.577,0.577,0.577,0), (1.9,1.9,1.9,1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }
    """
    others = by_st("m", 0.3) + by_st("m0", 0.1) + by_st("m1", -0.2) + preview("", name="m2")
    mesh = only(camera + CUBE.replace("SCHEME", scheme).replace("BODY", body) + others, Dicing(4.0))
    assert len(mesh.triangles) > 2000
    assert holes(mesh) == 0
    p = mesh.points[mesh.triangles]
    sizes = np.linalg.norm(p[:, 1] - p[:, 0], axis=1)
    assert sizes.max() > 3 * sizes[sizes > 0].min()  # of several levels


def test_faces_that_say_nothing_stay_where_they_are() -> None:
    """At the edge between them the mean of both."""
    text = (
        CUBE.replace("SCHEME", "none").replace("BODY", subsets(1))
        + preview("")
        + preview("float inputs:displacement = 0.25", name="m0")
    )
    mesh = only(text, uniform(3))
    x, y, z = mesh.points.T
    left = np.abs(x - (-1.25)) < 1e-6
    assert left.sum() == 49  # all of the first face but its edges
    rim = (x < -1 - 1e-6) & ~left
    moved = np.linalg.norm(mesh.points[rim] - np.clip(mesh.points[rim], -1, 1), axis=1)
    np.testing.assert_allclose(np.sort(moved), [0.25 / 3] * 4 + [0.25 / 2] * 28, atol=1e-6)  # three faces meet in four of them
    assert np.abs(np.stack([y, z])[:, ~rim & ~left]).max() <= 1


def test_points_in_one_place_stay_together() -> None:
    """Polygons whose points are split at every edge, as many exporters write them."""
    corners = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    at = [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1), (1, -1, -1), (1, -1, 1), (1, 1, -1), (1, 1, 1)]
    text = f"""def Mesh "cube" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = {list(range(24))}
        point3f[] points = {[at[k] for k in corners]}
        texCoord2f[] primvars:st = {[(k % 4 // 2, (k % 4 + 1) // 2 % 2) for k in range(24)]} (
            interpolation = "vertex"
        )
        rel material:binding = </m>
    }}
    """
    mesh = only(text + by_st("m", 0.2), uniform(3))
    assert len(mesh.points) == 6 * 81 - 12 * 9 + 8
    assert holes(mesh) == 0


def test_concave_faces_and_faces_of_many_corners() -> None:
    text = """def Mesh "star" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4, 5]
        int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 6, 2]
        point3f[] points = [(0,0,0), (2,0,0), (0.5,0.5,0), (0,2,0), (3,0,0), (3,3,0), (0,3,0)]
        rel material:binding = </m>
    }
    """
    mesh = only(text + preview("float inputs:displacement = 0.5"), uniform(3))
    p = mesh.points[mesh.triangles].astype(np.float64)
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert (n[:, 2] > 0).all()
    np.testing.assert_allclose(mesh.points[:, 2], 0.5, atol=1e-6)
    flat = only(text + preview(""), uniform(3))
    q = flat.points[flat.triangles].astype(np.float64)
    assert n[:, 2].sum() == pytest.approx(np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])[:, 2].sum(), rel=1e-6)


VECTOR = materialx("vector3f inputs:displacement = (0.1, 0.2, 0.3)\n float inputs:scale = 2\n SPACE", kind="vector3")


@pytest.mark.parametrize(("space", "wanted"), [("", (-0.4, 0.2, 0.6)), ('token inputs:space = "object"', (0.2, 0.4, 0.6))])
@pytest.mark.parametrize("scheme", ["none", "bilinear"])
def test_vectors(scheme: str, space: str, wanted: tuple[float, float, float]) -> None:
    """Along the tangent of st, here turned by 90 degrees, or along the axes."""
    turned = QUADS.replace(
        "(0,0), (.5,0), (1,0), (0,.5), (.5,.5), (1,.5), (0,1), (.5,1), (1,1)",
        "(0,1), (0,.5), (0,0), (.5,1), (.5,.5), (.5,0), (1,1), (1,.5), (1,0)",
    )
    still = only(turned.replace("SCHEME", scheme) + preview(""), uniform(2))
    moved = only(turned.replace("SCHEME", scheme) + VECTOR.replace("SPACE", space), uniform(2))
    low, high = moved.points.min(axis=0), moved.points.max(axis=0)
    np.testing.assert_allclose(low, still.points.min(axis=0) + np.array(wanted), atol=1e-5)
    np.testing.assert_allclose(high, still.points.max(axis=0) + np.array(wanted), atol=1e-5)


def test_edges_are_measured_where_they_end_up() -> None:
    """Steep walls have as short edges as what lies flat."""
    camera = """def Camera "c" {
        token projection = "orthographic"
        float horizontalAperture = 40
        float verticalAperture = 40
        matrix4d xformOp:transform = ((1,0,0,0), (0,0.707,0.707,0), (0,-0.707,0.707,0), (1,-9,10,1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }
    """
    steep = WAVES.replace("inputs:scale = 0.2", "inputs:scale = 1.5")
    mesh = only(camera + QUADS.replace("SCHEME", "none") + steep, Dicing(4.0))
    p = mesh.points[mesh.triangles].astype(np.float64)
    edges = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2) * 64 / 4
    assert np.sqrt(2) * 2.0 >= edges.max() > 1.0  # faces' edges cover 2 pixels at most, diagonals more


FRAMES = (
    "[(0,0,0), (1,0,0), (2,0,0), (0,1,0), (1,1,0), (2,1,0), (0,2,0), (1,2,0), (2,2,0)]",
    "[(0,0,0), (1,0,0), (2,0,1), (0,1,0), (1,1,0), (2,1,1), (0,2,0), (1,2,0), (2,2,1)]",
)
NORMALS = tuple(f"{[(x, 0, 1)] * 9}" for x in (0, -0.5))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("with_normals", [False, True])
def test_moving_meshes_move_displaced(scheme: str, with_normals: bool) -> None:
    """Every time is as a mesh of its own would be there."""
    plain = QUADS.replace("SCHEME", scheme)
    points = f"point3f[] points.timeSamples = {{ 0: {FRAMES[0]}, 1: {FRAMES[1]}, }}\n point3f[] points = "
    turning = f"normal3f[] normals.timeSamples = {{ 0: {NORMALS[0]}, 1: {NORMALS[1]}, }}" if with_normals else ""
    camera = 'def Camera "c" {\n double shutter:open = 0\n double shutter:close = 1\n}\n'
    material = preview("float inputs:displacement = 0.25")
    moving = plain.replace("point3f[] points = ", points).replace("BODY", turning)
    (mesh,), _ = diced(camera + moving + material, uniform(3), settings=replace(SETTINGS, time_code=0.0))
    assert mesh.motion is not None
    assert mesh.normals is not None
    for k, step in ((0, 0), (1, -1)):
        held = f"normal3f[] normals = {NORMALS[k]}" if with_normals else ""
        alone = only(plain.replace(FRAMES[0], FRAMES[k]).replace("BODY", held) + material, uniform(3))
        np.testing.assert_allclose(mesh.motion.points[step], alone.points, atol=1e-6)
    assert mesh.motion.normals is not None
    assert mesh.motion.normals.shape == (len(mesh.motion.times), *mesh.normals.shape)


def test_world_space_is_where_a_shape_stands_once() -> None:
    world = POSITION.replace('"object"', '"world"')
    nodes = world + node(
        "z", "ND_extract_vector3", "float3 inputs:in.connect = </m/p.outputs:out>\n int inputs:index = 0", "float outputs:out"
    )
    material = materialx("float inputs:displacement.connect = </m/z.outputs:out>", nodes)
    place = 'double3 xformOp:translate = (10, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]'
    mesh = only(QUADS.replace("SCHEME", "none").replace("BODY", place) + material, uniform(2))
    np.testing.assert_allclose(mesh.points[:, 2], mesh.points[:, 0] + 10, atol=1e-5)
    group = 'def Xform "g" { BODY }\n'.replace("BODY", QUADS.replace("SCHEME", "none").replace("BODY", ""))
    copies = "".join(f'def Xform "i{k}" (instanceable = true\n prepend references = </g>) {{\n}}\n' for k in range(2))
    description, _ = described(group.replace("def Xform", "class Xform") + copies + material)
    (cage,) = description.shapes
    from primray.core.displacement_upload import displacements

    made, told = dice(core.compiled, description, uniform(2), 1, displacements(description, {}))
    assert [(code, path) for code, path, _ in told] == [("displacement-space", cage.path)]
    (mesh,) = (s for s in made.shapes if isinstance(s, Mesh))
    np.testing.assert_allclose(mesh.points[:, 2], mesh.points[:, 0], atol=1e-5)


def test_jumps_are_not_refined_for_ever() -> None:
    """At the edges of a cube its faces part by what they are displaced: no level makes that shorter."""
    (mesh,), warnings = diced(CUBE.replace("SCHEME", "none") + preview("float inputs:displacement = 0.5"), Dicing(4.0))
    (flat,), _ = diced(CUBE.replace("SCHEME", "none") + preview("float inputs:displacement = 0.001"), Dicing(4.0))
    assert warnings == []
    assert holes(mesh) == 0
    assert len(mesh.triangles) < 4 * len(flat.triangles)  # from farther away


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_mirrored_and_turned_over(scheme: str, orientation: str) -> None:
    """Outwards is where the shape's own normals point, wherever it stands; a graph reads them as they are there."""
    body = f"""uniform token orientation = "{orientation}"
    double3 xformOp:scale = (-2, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
    """
    nodes = node("n", "ND_normal_vector3", 'string inputs:space = "SPACE"', "float3 outputs:out") + node(
        "z", "ND_extract_vector3", "float3 inputs:in.connect = </m/n.outputs:out>\n int inputs:index = 2", "float outputs:out"
    )
    material = materialx("float inputs:displacement.connect = </m/z.outputs:out>\n float inputs:scale = 0.25", nodes)
    text = QUADS.replace("SCHEME", scheme).replace("BODY", body)
    up = 1 if orientation == "rightHanded" else -1
    constant = only(text + preview("float inputs:displacement = 0.25"), uniform(2))
    np.testing.assert_allclose(constant.points[:, 2], 0.25 * up, atol=1e-6)
    for space in ("object", "world"):
        read = only(text + material.replace("SPACE", space), uniform(2))
        np.testing.assert_allclose(read.points[:, 2], 0.25, atol=1e-6)  # a normal down, by what is then negative


def test_limits_make_edges_longer_and_are_told() -> None:
    (mesh,), warnings = diced(QUADS.replace("SCHEME", "none") + WAVES, Dicing(1.0, max_triangles=1000))
    assert len(mesh.triangles) <= 1000
    assert [code for code, _, _ in warnings] == ["dicing-limited"]
    (mesh,), warnings = diced(QUADS.replace("SCHEME", "none") + WAVES, Dicing(0.01, max_level=3))
    assert [(code, path) for code, path, _ in warnings] == [("dicing-limited", "/plane")]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_vectors_are_measured_along_tangents(scheme: str) -> None:
    """A shift of the whole along st's own direction makes no edge longer."""
    shifted = materialx("vector3f inputs:displacement = (0.25, 0, 0)", kind="vector3")
    still = materialx("vector3f inputs:displacement = (0, 0, 0.001)", kind="vector3")
    (moved,), told = diced(QUADS.replace("SCHEME", scheme) + shifted, Dicing(4.0))
    (flat,), _ = diced(QUADS.replace("SCHEME", scheme) + still, Dicing(4.0))
    assert told == []
    assert len(flat.triangles) / 4 <= len(moved.triangles) <= 4 * len(flat.triangles)


def test_vectors_on_a_cage_need_no_more_levels_than_they_are_long() -> None:
    """Tangents turn with the surface: vertices of coarse levels do not stand out among fine ones."""
    nodes = node(
        "n",
        "ND_noise2d_vector3",
        "float2 inputs:texcoord.connect = </m/big.outputs:out>\n vector3f inputs:amplitude = (0.2, 0.2, 0.3)",
        "float3 outputs:out",
    )
    nodes += node(
        "big",
        "ND_multiply_vector2FA",
        "float2 inputs:in1.connect = </m/st.outputs:out>\n float inputs:in2 = 5",
        "float2 outputs:out",
    )
    nodes += node("st", "ND_texcoord_vector2", "", "float2 outputs:out")
    material = materialx("vector3f inputs:displacement.connect = </m/n.outputs:out>", nodes, kind="vector3")
    dicing = Dicing(16.0)
    (moved,), told = diced(QUADS.replace("SCHEME", "catmullClark") + material, dicing)
    (flat,), _ = diced(QUADS.replace("SCHEME", "catmullClark") + preview("float inputs:displacement = 0.001"), dicing)
    assert told == []
    assert len(moved.triangles) < 12 * len(flat.triangles)
