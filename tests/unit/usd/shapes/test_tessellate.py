"""Tessellated shapes: closed, outward, of the right size, on the right axis, with normals that belong to the surface."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from primray.description import Mesh
from primray.usd.mesh.authored import is_closed
from primray.usd.shapes.tessellate import Tessellated, capsule, cone, cube, cylinder, plane

from ..usd_text import translate_text

PI = math.pi
SOLIDS: dict[str, tuple[Callable[[str], Tessellated], float, tuple[float, float, float]]] = {
    "cube": (lambda axis: cube(2.0), 8.0, (2, 2, 2)),
    "cone": (lambda axis: cone(0.5, 3.0, axis), PI * 0.25, (1, 1, 3)),
    "cylinder": (lambda axis: cylinder(0.5, 0.5, 3.0, axis), PI * 0.75, (1, 1, 3)),
    "frustum": (lambda axis: cylinder(1.0, 0.5, 3.0, axis), PI * (1 + 0.5 + 0.25), (2, 2, 3)),
    "capsule": (lambda axis: capsule(0.5, 0.5, 2.0, axis), PI * 0.5 + 4 / 3 * PI * 0.125, (1, 1, 3)),
}


def volume(made: Tessellated) -> float:
    a, b, c = made.points[made.triangles].astype(np.float64).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("name", SOLIDS)
def test_solids(name: str, axis: str) -> None:
    make, expected, size = SOLIDS[name]
    made = make(axis)
    assert is_closed(made.points, made.triangles)
    assert volume(made) == pytest.approx(expected, rel=4e-3)  # 64 segments; the sign says that faces look outwards
    order = {"X": (2, 0, 1), "Y": (1, 2, 0), "Z": (0, 1, 2)}[axis]
    assert np.ptp(made.points, axis=0) == pytest.approx([size[k] for k in order], rel=1e-3)
    if made.normals is not None:
        p = made.points[made.triangles].astype(np.float64)
        face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        face /= np.linalg.norm(face, axis=1)[:, None]
        assert np.linalg.norm(made.normals, axis=1) == pytest.approx(np.ones(len(made.normals)), abs=1e-6)
        assert (np.einsum("tck,tk->tc", made.normals.reshape(-1, 3, 3), face) > 0.98).all()


def test_apex_and_wider_end_are_on_the_right_side() -> None:
    made = cone(1.0, 2.0, "Y")
    assert made.points[made.points[:, 1] > 0.9].tolist() == [[0, 1, 0]]
    made = cylinder(1.0, 0.25, 2.0, "X")
    assert np.abs(made.points[made.points[:, 0] < 0][:, 1:]).max() == pytest.approx(1)
    assert np.abs(made.points[made.points[:, 0] > 0][:, 1:]).max() == pytest.approx(0.25)


# Radii at the bottom and the top, and the height of the spine. In the last three one sphere holds the other.
HULLS = [(0.5, 0.5, 2.0), (1.0, 0.4, 2.0), (0.4, 1.0, 2.0), (1.0, 0.0, 1.1), (1.0, 0.4, 0.61)]
HULLS += [(1.0, 0.4, 0.6), (0.2, 1.0, 0.3), (1.0, 0.5, 0.0)]


@pytest.mark.parametrize(("bottom", "top", "height"), HULLS)
def test_a_capsule_is_the_hull_of_two_spheres(bottom: float, top: float, height: float) -> None:
    """A convex body is how far it reaches in each direction; a hull reaches as far as what reaches farthest."""
    made = capsule(bottom, top, height, "Z")
    assert is_closed(made.points, made.triangles)
    for angle in np.linspace(-PI / 2, PI / 2, 41):
        direction = np.array([math.cos(angle), 0.0, math.sin(angle)])
        expected = max(bottom - height / 2 * direction[2], top + height / 2 * direction[2])
        assert (made.points @ direction).max() == pytest.approx(expected, abs=2e-3)


def test_a_hull_has_the_area_of_its_spheres_and_cone() -> None:
    """Zones of both spheres up to where the cone touches them, and the cone: with caps that bulge it was 7 % more."""
    made = capsule(1.0, 0.4, 2.0, "Z")
    a, b, c = made.points[made.triangles].astype(np.float64).transpose(1, 0, 2)
    sine = (1.0 - 0.4) / 2.0
    cone_area = PI * (1.0 + 0.4) * math.sqrt(1 - sine**2) * math.sqrt(2.0**2 - 0.6**2)
    expected = 2 * PI * (1 + sine) + 2 * PI * 0.4**2 * (1 - sine) + cone_area
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize(("bottom", "top"), [(0.5, 0.5), (1.0, 0.4), (1.5, 0.1)])
def test_a_negative_height_turns_a_capsule_over(bottom: float, top: float) -> None:
    over, upright = capsule(bottom, top, -2.0, "Z"), capsule(top, bottom, 2.0, "Z")
    np.testing.assert_array_equal(over.points, upright.points)


def test_an_automatic_camera_frames_the_hull() -> None:
    """USD's own computed extent of a Capsule_1 is that of larger spheres; an authored one is taken for the truth."""
    capsule_1 = 'def Capsule_1 "s"\n{\ndouble radiusTop = 0.4\ndouble radiusBottom = 1\ndouble height = 0.1\nEXTENT\n}\n'
    alone = translate_text(capsule_1.replace("EXTENT", ""))[0]
    same = "float3[] extent = [(-1, -1, -1.05), (1, 1, 0.95)]"
    told = translate_text(capsule_1.replace("EXTENT", same))[0]
    np.testing.assert_allclose(alone.camera.world_from_camera, told.camera.world_from_camera, atol=1e-5)


def test_capsule_of_two_radii_is_smooth_where_its_parts_meet() -> None:
    """UsdGeomCapsule_1: "cylinder tangent and sphere tangent are coincident", so normals agree on both sides of each seam."""
    made = capsule(1.0, 0.4, 2.0, "Z")
    assert made.normals is not None
    corners = made.triangles.ravel()
    for point in range(len(made.points)):
        n = made.normals[corners == point]
        if abs(made.points[point, :2]).max() > 1e-6:
            assert np.abs(n - n[0]).max() < 1e-5


@pytest.mark.parametrize(
    ("axis", "normal", "size"), [("X", (1, 0, 0), (0, 5, 3)), ("Y", (0, 1, 0), (3, 0, 5)), ("Z", (0, 0, 1), (3, 5, 0))]
)
def test_planes_face_their_axis(axis: str, normal: tuple[int, ...], size: tuple[int, ...]) -> None:
    made = plane(3.0, 5.0, axis)
    assert np.ptp(made.points, axis=0).tolist() == list(size)
    p = made.points[made.triangles]
    assert (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) @ normal > 0).all()


@pytest.mark.parametrize("kind", ["Cone", "Cylinder", "Capsule"])
def test_a_negative_radius_is_its_size(kind: str) -> None:
    made = [translate_text(f'def {kind} "s"\n{{\n    double radius = {r}\n}}\n')[0].shapes[0] for r in (0.5, -0.5)]
    assert isinstance(made[0], Mesh)
    assert isinstance(made[1], Mesh)
    np.testing.assert_array_equal(made[0].points, made[1].points)
    np.testing.assert_array_equal(made[0].triangles, made[1].triangles)
