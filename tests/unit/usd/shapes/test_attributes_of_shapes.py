"""Every attribute of UsdGeom's implicit shapes, meshes and points: authored, the description is what the schema says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import UsdGeom

from primray import core
from primray.description import Mesh, Sphere, SubdivisionMesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.mesh.authored import is_closed

from ..usd_text import stage_of, translate_text


def conforms(row: str, *values: Any, state: str = "honoured") -> Any:
    return pytest.param(row, *values, marks=pytest.mark.conforms(row, state=state), id=f"{row}-{values[0]}")


def shape_of(text: str) -> Any:
    (shape,) = translate_text(text)[0].shapes
    return shape


def box(text: str) -> tuple[list[float], list[float]]:
    """The only shape's bounds in its own space."""
    shape = shape_of(text)
    if isinstance(shape, Sphere):
        return [-shape.radius] * 3, [shape.radius] * 3
    return shape.points.min(axis=0).tolist(), shape.points.max(axis=0).tolist()


# Row, what is authored beside it, and the half size of the shape's box (UsdGeom schema.usda, each class).
SIZES = [
    conforms("Cube.size", "double size = 6", (3, 3, 3)),
    conforms("Cube.size", "", (1, 1, 1)),
    conforms("Sphere.radius", "double radius = 3", (3, 3, 3)),
    conforms("Sphere.radius", "", (1, 1, 1)),
    conforms("Cylinder.height", "double height = 6", (1, 1, 3)),
    conforms("Cylinder.height", "", (1, 1, 1)),
    conforms("Cylinder.radius", "double radius = 3", (3, 3, 1)),
    conforms("Cylinder.axis", 'uniform token axis = "X"\ndouble height = 6', (3, 1, 1)),
    conforms("Cylinder.axis", 'uniform token axis = "Y"\ndouble height = 6', (1, 3, 1)),
    conforms("Capsule.height", "double height = 6", (0.5, 0.5, 3.5)),  # the caps come on top of the height
    conforms("Capsule.height", "", (0.5, 0.5, 1)),
    conforms("Capsule.radius", "double radius = 3", (3, 3, 3.5)),
    conforms("Capsule.axis", 'uniform token axis = "X"', (1, 0.5, 0.5)),
    conforms("Capsule.axis", 'uniform token axis = "Y"', (0.5, 1, 0.5)),
    conforms("Cone.height", "double height = 6", (1, 1, 3)),
    conforms("Cone.height", "", (1, 1, 1)),
    conforms("Cone.radius", "double radius = 3", (3, 3, 1)),
    conforms("Cone.axis", 'uniform token axis = "X"\ndouble height = 6', (3, 1, 1)),
    conforms("Cone.axis", 'uniform token axis = "Y"\ndouble height = 6', (1, 3, 1)),
    conforms("Cylinder_1.height", "double height = 6", (1, 1, 3)),
    conforms("Cylinder_1.radiusTop", "double radiusTop = 3", (3, 3, 1)),
    conforms("Cylinder_1.radiusBottom", "double radiusBottom = 3", (3, 3, 1)),
    conforms("Cylinder_1.axis", 'uniform token axis = "X"\ndouble height = 6', (3, 1, 1)),
    conforms("Capsule_1.height", "double height = 6", (0.5, 0.5, 3.5)),
    conforms("Capsule_1.axis", 'uniform token axis = "X"', (1, 0.5, 0.5)),
    conforms("Plane.width", "double width = 6", (3, 1, 0)),
    conforms("Plane.width", "", (1, 1, 0)),
    conforms("Plane.length", "double length = 6", (1, 3, 0)),
    conforms("Plane.axis", 'uniform token axis = "X"\ndouble width = 6', (0, 1, 3)),
    conforms("Plane.axis", 'uniform token axis = "Y"\ndouble width = 6', (3, 0, 1)),
]


@pytest.mark.parametrize(("row", "authored", "half"), SIZES)
def test_sizes(row: str, authored: str, half: tuple[float, ...]) -> None:
    low, high = box(f'def {row.partition(".")[0]} "s"\n{{\n{authored}\n}}\n')
    assert high == pytest.approx(half, abs=1e-6)
    assert low == pytest.approx([-x for x in half], abs=1e-6)


@pytest.mark.parametrize(
    ("row", "end"),
    [
        conforms("Cylinder_1.radiusTop", 1),
        conforms("Cylinder_1.radiusBottom", -1),
        conforms("Capsule_1.radiusTop", 1),
        conforms("Capsule_1.radiusBottom", -1),
    ],
)
def test_each_radius_is_at_its_end(row: str, end: int) -> None:
    """The top is at +axis. A capsule's radius is that of the sphere about the end of its spine."""
    kind, _, name = row.partition(".")
    points = shape_of(f'def {kind} "s"\n{{\ndouble height = 8\ndouble {name} = 3\n}}\n').points
    if kind == "Capsule_1":
        assert (points[:, 2] * end).max() == pytest.approx(4 + 3)
        assert (points[:, 2] * end).min() == pytest.approx(-4 - 0.5)
        assert np.linalg.norm(points - [0, 0, 4 * end], axis=1).min() == pytest.approx(3)
    else:
        ends = {side: np.abs(points[np.isclose(points[:, 2], 4 * side)][:, :2]).max() for side in (1, -1)}
        assert (ends[end], ends[-end]) == pytest.approx((3, 1))


EXTENT = "float3[] extent = [(-50, -50, -50), (50, 50, 50)]"
BOUNDED = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone", "Cylinder_1", "Capsule_1", "Plane")


@pytest.mark.parametrize(
    "row", [pytest.param(k, marks=pytest.mark.conforms(f"{k}.extent", "Boundable.extent")) for k in BOUNDED]
)
def test_an_extent_frames_the_picture_and_changes_no_shape(row: str) -> None:
    """UsdGeomBBoxCache takes authored extents for the truth; so does usdrecord's camera. Our own looks at what is drawn."""
    usdrecord = RenderSettings(auto_camera="usdrecord")
    plain, _ = translate_text(f'def {row} "s"\n{{\n}}\n', usdrecord)
    authored, _ = translate_text(f'def {row} "s"\n{{\n{EXTENT}\n}}\n', usdrecord)
    assert box(f'def {row} "s"\n{{\n}}\n') == box(f'def {row} "s"\n{{\n{EXTENT}\n}}\n')
    near, far = (np.linalg.norm(d.camera.world_from_camera[:3, 3]) for d in (plain, authored))
    assert far > 10 * near
    own = [translate_text(f'def {row} "s"\n{{\n{more}\n}}\n')[0].camera for more in ("", EXTENT)]
    assert own[0] == own[1]


QUAD = """def Mesh "m"
{{
    uniform token subdivisionScheme = "{scheme}"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    {more}
}}
"""


def quad(more: str = "", scheme: str = "none") -> str:
    return QUAD.format(more=more, scheme=scheme)


@pytest.mark.conforms("PointBased.points")
def test_points_of_a_mesh() -> None:
    shape = shape_of(quad().replace("(1, 1, 0)", "(5, 6, 7)"))
    assert shape.points.tolist() == [[0, 0, 0], [1, 0, 0], [5, 6, 7], [0, 1, 0]]


@pytest.mark.conforms("Mesh.faceVertexCounts", "Mesh.faceVertexIndices")
def test_faces_of_a_mesh() -> None:
    triangles = quad().replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[3, 1, 2, 0, 1, 3]")
    assert shape_of(triangles).triangles.tolist() == [[3, 1, 2], [0, 1, 3]]


@pytest.mark.conforms("Mesh.subdivisionScheme")
@pytest.mark.parametrize("scheme", ["none", "catmullClark", "bilinear", "loop", ""])
def test_schemes(scheme: str) -> None:
    """The schema's default is catmullClark."""
    text = quad(scheme=scheme) if scheme else quad().replace('    uniform token subdivisionScheme = "none"\n', "")
    if scheme == "loop":
        text = text.replace("[4]", "[3]").replace("[0, 1, 2, 3]", "[0, 1, 2]")
    shape = shape_of(text)
    assert isinstance(shape, Mesh if scheme == "none" else SubdivisionMesh)
    assert getattr(shape, "scheme", "none") == (scheme or "catmullClark")


CAGE = quad("BODY", "catmullClark")
# Row, what is authored, the cage's member and its value; each differs from the default.
RULES = [
    conforms("Mesh.interpolateBoundary", 'token interpolateBoundary = "none"', "interpolate_boundary", "none"),
    conforms("Mesh.interpolateBoundary", 'token interpolateBoundary = "edgeOnly"', "interpolate_boundary", "edgeOnly"),
    *(
        conforms(
            "Mesh.faceVaryingLinearInterpolation",
            f'token faceVaryingLinearInterpolation = "{rule}"',
            "face_varying_interpolation",
            rule,
        )
        for rule in ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
    ),
    conforms("Mesh.triangleSubdivisionRule", 'token triangleSubdivisionRule = "smooth"', "triangle_rule", "smooth"),
    conforms("Mesh.holeIndices", "int[] holeIndices = [0]", "holes", [0]),
    conforms("Mesh.cornerIndices", "int[] cornerIndices = [2]\nfloat[] cornerSharpnesses = [3]", "corner_points", [2]),
    conforms("Mesh.cornerSharpnesses", "int[] cornerIndices = [2]\nfloat[] cornerSharpnesses = [3]", "corner_sharpnesses", [3]),
]
CREASE = "int[] creaseIndices = [1, 2, 3]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [2.5]"
RULES += [
    conforms("Mesh.creaseIndices", CREASE, "crease_points", [1, 2, 3]),
    conforms("Mesh.creaseLengths", CREASE, "crease_lengths", [3]),
    conforms("Mesh.creaseSharpnesses", CREASE, "crease_sharpnesses", [2.5]),
]


@pytest.mark.parametrize(("row", "authored", "member", "expected"), RULES)
def test_rules_of_subdivision(row: str, authored: str, member: str, expected: Any) -> None:
    found = getattr(shape_of(CAGE.replace("BODY", authored)), member)
    assert (found if isinstance(found, str) else np.asarray(found).tolist()) == expected


@pytest.mark.conforms("Mesh.holeIndices")
def test_holes_of_polygons() -> None:
    two = quad("int[] holeIndices = [1]").replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    assert shape_of(two).triangles.tolist() == [[0, 1, 2]]


@pytest.mark.conforms("PointBased.normals")
def test_normals() -> None:
    normals = "normal3f[] normals = [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, 2)] (interpolation = 'vertex')"
    assert np.asarray(shape_of(quad(normals)).normals).tolist() == [[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 1]]


@pytest.mark.conforms("Gprim.orientation")
@pytest.mark.parametrize("kind", ["Mesh", "Cube", "Cylinder", "Plane"])
def test_orientation(kind: str) -> None:
    """Left-handed shapes face the other way, and so do their normals."""

    def facing(orientation: str) -> tuple[np.ndarray, np.ndarray]:
        authored = f'uniform token orientation = "{orientation}"'
        shape = shape_of(quad(authored) if kind == "Mesh" else f'def {kind} "s"\n{{\n{authored}\n}}\n')
        p = shape.points[shape.triangles]
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        smooth = None if shape.normals is None else np.asarray(shape.normals)[::3]
        return n, n if smooth is None else smooth

    (right, right_smooth), (left, left_smooth) = facing("rightHanded"), facing("leftHanded")
    assert np.allclose(left.sum(axis=0), -right.sum(axis=0))
    assert ((left * left_smooth).sum(axis=1) > 0).all()
    assert ((right * right_smooth).sum(axis=1) > 0).all()
    centers = np.sign((left * right).sum(axis=1))
    assert (centers < 0).all()


@pytest.mark.conforms("Gprim.orientation")
def test_a_left_handed_sphere_faces_inwards_where_it_would_matter() -> None:
    """An exact sphere faces outwards; only glass would show that."""
    glass = """def Material "g"
{
    token outputs:surface.connect = </g/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = OPACITY
        token outputs:surface
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    uniform token orientation = "leftHanded"
    rel material:binding = </g>
}
"""
    settings = RenderSettings(resolution=(32, 32))
    description, told = translate_text(glass.replace("OPACITY", "0"), settings)
    assert "/ball" not in [path for _, path in told]
    (mesh,) = core.dice(description, settings)[0].shapes
    assert isinstance(mesh, Mesh)
    assert mesh.normals is not None
    assert np.abs(mesh.normals + mesh.points).max() < 3e-7
    assert is_closed(mesh.points, mesh.triangles)
    (opaque,) = translate_text(glass.replace("OPACITY", "1"))[0].shapes
    assert isinstance(opaque, Sphere)


@pytest.mark.conforms("Gprim.primvars:displayColor")
def test_display_color() -> None:
    description, _ = translate_text('def Sphere "s"\n{\ncolor3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]\n}\n')
    assert description.surfaces[0].diffuse_color == pytest.approx((0.1, 0.2, 0.3))
    description, _ = translate_text('def Sphere "s"\n{\n}\n')
    assert description.surfaces[0].diffuse_color == pytest.approx((0.18, 0.18, 0.18))


@pytest.mark.conforms("Gprim.primvars:displayOpacity")
def test_display_opacity() -> None:
    description, _ = translate_text('def Sphere "s"\n{\nfloat[] primvars:displayOpacity = [0.25]\n}\n')
    assert (description.surfaces[0].opacity, description.surfaces[0].presence) == (0.25, True)


POINTS = """def Points "p"
{
    point3f[] points = [(0, 0, 0), (4, 0, 0)]
    float[] widths = [1, 2]
    MORE
}
"""


@pytest.mark.conforms("PointBased.points", "Points.widths")
def test_points_are_spheres_of_their_widths() -> None:
    description, _ = translate_text(POINTS.replace("MORE", ""))
    (placement,) = description.placements
    matrices = np.concatenate(list(placement.chunks()))
    assert matrices[:, 0, 0].tolist() == [0.5, 1.0]
    assert matrices[:, :3, 3].tolist() == [[0, 0, 0], [4, 0, 0]]


UP = "[(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)]"
MOVING = f"""point3f[] points.timeSamples = {{
        1: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
        3: [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    }}
    vector3f[] velocities.timeSamples = {{ 1: {UP}, 3: {UP} }}
    vector3f[] accelerations.timeSamples = {{ 1: {UP}, 3: {UP} }}"""


@pytest.mark.conforms("PointBased.velocities", "PointBased.accelerations")
@pytest.mark.parametrize("time", [1.0, 1.5, 2.0, 3.0, 4.0])
def test_velocities_move_points_between_samples(time: float) -> None:
    moving = quad().replace("point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]", MOVING)
    stage = stage_of(moving)
    (oracle,) = UsdGeom.PointBased(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh))).ComputePointsAtTimes([time], time)
    (shape,) = translate(stage, RenderSettings(time_code=time))[0].shapes
    assert isinstance(shape, Mesh | SubdivisionMesh)
    assert np.array_equal(shape.points, np.array(oracle))
    spheres = translate(stage_of(moving.replace("def Mesh", "def Points")), RenderSettings(time_code=time))[0]
    assert np.allclose(spheres.placements[0].levels[0].rows(0, 4)[:, :, 3], np.array(oracle), atol=1e-7)
