"""What patterns know of the place that is shaded: positions and vectors by space, of merged and instanced shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from tests import described
from tests.described import Described

from primray.description import (
    Camera,
    Doubles,
    Interpolation,
    Mesh,
    NodeOutput,
    Operand,
    Pattern,
    Placed,
    Primvar,
    Prototype,
    Sphere,
    Surface,
)

from ..pictured import Graph, Rows, emitting

SIZE = 8


def turned(x: float, y: float, z: float) -> Doubles:
    """Stands somewhere, turned and unevenly scaled, its front still towards +z."""
    m = described.translation(x, y, z) @ described.rotation((0, 0, 1), 30) @ described.scaling(2, 3, 1.5)
    return np.asarray(m)


def output(category: str, inputs: Mapping[str, Operand], type: str = "vector3") -> tuple[Graph, NodeOutput]:
    graph = Graph()
    return graph, graph.add(category, type, inputs)


def plane(primvars: tuple[Primvar, ...] = (), surface: int = 0) -> Mesh:
    """Wide enough for the picture; in its own space 0.25 above z = 0."""
    points = np.array([[-9, -9, 0.25], [9, -9, 0.25], [9, 9, 0.25], [-9, 9, 0.25]], np.float32)
    return Mesh("/plane", points, np.array([[0, 1, 2], [0, 2, 3]], np.int32), None, None, surface, primvars)


def seen(graph: Graph, source: NodeOutput, matrix: Doubles, place: str = "static", lanes: int = 0) -> Rows:
    """(SIZE, SIZE, 3), the lowest row first: with its sign, from straight ahead of the plane."""
    eye = matrix @ described.translation(0.1, 0.2, 1.0)
    camera = described.orthographic(described.translation(*eye[:3, 3]), SIZE / 2)
    found = []
    for sign in (1.0, -1.0):
        surface, mesh = emitting(graph.nodes, source, sign), plane((st(),))
        made = described.describe([(mesh, matrix)], [surface], camera=camera, resolution=(SIZE, SIZE))
        if place == "instanced":
            made = instanced(mesh, surface, matrix, camera)
        image = described.render(made.build(), 1, max_depth=1, lanes=lanes, splits=1).pixels()
        found.append(np.asarray(image[::-1, :, :3], np.float64))
    return found[0] - found[1]


def st() -> Primvar:
    return Primvar("st", Interpolation.POINT, np.array([[0, 0], [2, 0], [2, 1], [0, 1]], np.float32))


def instanced(mesh: Mesh, surface: Surface, matrix: Doubles, camera: Camera) -> Described:
    inner = described.translation(5, -3, 2)
    prototype = Prototype("/p", (Placed(0, inner),))
    return described.describe(
        (), [surface], camera=camera, resolution=(SIZE, SIZE), prototypes=[prototype], prototype_shapes=[mesh],
        placements=[described.placement(0, [matrix @ np.linalg.inv(inner)])],
    )  # fmt: skip


def pixel_points(matrix: Doubles) -> Rows:
    """(SIZE, SIZE, 3) where pixels' centres are on the plane, in its own space."""
    eye = (matrix @ described.translation(0.1, 0.2, 1.0))[:2, 3]
    at = np.arange(SIZE) + 0.5 - SIZE / 2
    x, y = np.meshgrid(eye[0] + at, eye[1] + at)
    z = np.full_like(x, (matrix @ [0, 0, 0.25, 1])[2])
    world = np.stack([x, y, z, np.ones_like(x)], axis=-1)
    return np.asarray((world @ np.linalg.inv(matrix).T)[..., :3])


PLACES = ["static", "instanced"]
SHIFTS = [(0.0, 0.0, 0.0), (4e6, -3e6, 2e6)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shift", SHIFTS, ids=["near", "far"])
def test_object_position(place: str, shift: tuple[float, float, float]) -> None:
    """Samples lie anywhere in their pixel: half of one off at most, and as exact where the shape stands far away."""
    matrix = turned(*shift)
    graph, source = output("position", {"space": "object"})
    found = seen(graph, source, matrix, place)
    assert np.abs(found[..., :2] - pixel_points(matrix)[..., :2]).max() < 0.36  # half a pixel by the plane's scales
    np.testing.assert_allclose(found[..., 2], 0.25, atol=2e-6)


@pytest.mark.parametrize("place", PLACES)
def test_spaces_agree(place: str) -> None:
    """The world's point, taken to the shape's own space, is the point of that space; and vectors go with points."""
    matrix = turned(10, 20, 30)
    graph = Graph()
    own, world = graph.add("position", "vector3", {"space": "object"}), graph.add("position", "vector3", {"space": "world"})
    back = graph.add("transformpoint", "vector3", {"in": world, "fromspace": "world", "tospace": "object"})
    np.testing.assert_allclose(
        seen(graph, graph.add("subtract", "vector3", {"in1": back, "in2": own}), matrix, place), 0, atol=2e-5
    )
    there = graph.add("transformpoint", "vector3", {"in": own, "fromspace": "object", "tospace": "world"})
    np.testing.assert_allclose(
        seen(graph, graph.add("subtract", "vector3", {"in1": there, "in2": world}), matrix, place), 0, atol=2e-5
    )


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", ["vector", "normal"])
@pytest.mark.parametrize("way", [("object", "world"), ("world", "object")])
def test_vectors_by_space(place: str, kind: str, way: tuple[str, str]) -> None:
    matrix, given = turned(1, 2, 3), np.array([0.3, -0.5, 0.8])
    graph, source = output(f"transform{kind}", {"in": tuple(given), "fromspace": way[0], "tospace": way[1]})
    linear = matrix[:3, :3] if way[1] == "world" else np.linalg.inv(matrix[:3, :3])
    want = linear @ given if kind == "vector" else np.linalg.inv(linear).T @ given
    want = want if kind == "vector" else want / np.linalg.norm(want)
    np.testing.assert_allclose(seen(graph, source, matrix, place), np.broadcast_to(want, (SIZE, SIZE, 3)), atol=2e-6)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("space", ["object", "world"])
def test_normal_and_tangents(place: str, space: str) -> None:
    matrix = turned(1, 2, 3)
    axes = matrix[:3, :3] if space == "world" else np.eye(3)
    for name, axis in (("normal", 2), ("tangent", 0), ("bitangent", 1)):
        graph, source = output(name, {"space": space, "index": (0.0,)})
        want = axes[:, axis] / np.linalg.norm(axes[:, axis])
        found = seen(graph, source, matrix, place)
        np.testing.assert_allclose(found, np.broadcast_to(want, found.shape), atol=2e-6, err_msg=name)


def test_world_position() -> None:
    graph, source = output("position", {"space": "world"})
    found = seen(graph, source, turned(10, 20, 30))
    np.testing.assert_allclose(found[..., 2], 30 + 0.25 * 1.5, atol=1e-5)
    assert (np.diff(found[..., 0], axis=1) > 0).all()
    assert (np.diff(found[..., 1], axis=0) > 0).all()


def test_view_is_from_the_camera() -> None:
    graph, source = output("viewdirection", {"space": "world"})
    np.testing.assert_allclose(seen(graph, source, turned(1, 2, 3)), np.broadcast_to([0, 0, -1], (SIZE, SIZE, 3)), atol=1e-6)


def test_coordinates_and_properties() -> None:
    """st, and what a shape does not have."""
    graph, source = output("texcoord", {"index": (0.0,)}, "vector3")
    matrix = np.eye(4)
    found, at = seen(graph, source, matrix), pixel_points(matrix)
    np.testing.assert_allclose(found[..., 0], (at[..., 0] + 9) / 9, atol=0.07)
    np.testing.assert_allclose(found[..., 2], 0)
    graph, source = output("geompropvalue", {"geomprop": "nowhere", "default": (1.0, 2.0, 3.0)})
    np.testing.assert_array_equal(seen(graph, source, matrix), np.broadcast_to([1, 2, 3], (SIZE, SIZE, 3)))


def test_names_of_geometry_stand_for_values() -> None:
    graph, source = output("add", {"in1": "Pobject", "in2": (0.0, 0.0, 0.5)})
    np.testing.assert_allclose(seen(graph, source, np.eye(4))[..., 2], 0.75, atol=1e-6)


def test_sphere() -> None:
    """Its own space is about its centre, whatever it is scaled by."""
    graph, source = output("position", {"space": "object"})
    matrix = described.translation(3, 4, 5) @ described.scaling(2, 2, 2)
    found = []
    for sign in (1.0, -1.0):
        camera = described.orthographic(described.translation(3, 4, 15), 1.2)
        surface = emitting(graph.nodes, source, sign)
        made = described.describe([(Sphere("/s", 0.5, 0), matrix)], [surface], camera=camera, resolution=(SIZE, SIZE))
        found.append(np.asarray(described.render(made.build(), 1, max_depth=1, splits=1).pixels()[..., :3], np.float64))
    p = found[0] - found[1]
    lengths = np.linalg.norm(p, axis=-1)
    assert (lengths > 0).sum() > 20
    np.testing.assert_allclose(lengths[lengths > 0], 0.5, atol=1e-5)


def test_frame_and_time() -> None:
    """Those of the description: 36 is one second and a half."""
    graph = Graph()
    frame, time = graph.add("frame", "float", {}), graph.add("time", "float", {"fps": (24.0,)})
    surface = emitting(graph.nodes, graph.add("combine3", "color3", {"in1": frame, "in2": time, "in3": (1.0,)}))
    surface = replace(surface, pattern=Pattern(tuple(graph.nodes)))
    made = described.describe(
        [(plane(), np.eye(4))], [surface], camera=described.orthographic(described.translation(0, 0, 1), 1)
    )
    made = replace(made, description=replace(made.description, time_code=36.0))
    np.testing.assert_array_equal(described.render(made.build(), 1, max_depth=1).pixels()[0, 0, :3], [36, 1.5, 1])


def test_color_of_geometry() -> None:
    """displayColor, of which a colour with alpha has 1."""
    graph = Graph()
    color = graph.add("geomcolor", "color4", {"index": (0.0,)})
    alpha = graph.add("extract", "float", {"in": color, "index": (3.0,)})
    values = np.array([[0.25, 0.5, 0.75]], np.float32)
    for source, want in ((color, [0.25, 0.5, 0.75]), (alpha, [1, 1, 1])):
        surface = replace(emitting(graph.nodes, source), pattern=Pattern(tuple(graph.nodes)))
        shape = plane((Primvar("displayColor", Interpolation.CONSTANT, values),))
        camera = described.orthographic(described.translation(0, 0, 1), 1)
        made = described.describe([(shape, np.eye(4))], [surface], camera=camera)
        np.testing.assert_array_equal(described.render(made.build(), 1, max_depth=1).pixels()[0, 0, :3], want)


@pytest.mark.parametrize("place", PLACES)
def test_holes_know_their_place(place: str) -> None:
    """A cut-out where its own x is negative: the filter has no ray to ask."""
    graph, source = output("position", {"space": "object"})
    x = graph.add("extract", "float", {"in": source, "index": (0.0,)})
    there = graph.add("ifgreater", "float", {"value1": x, "value2": (0.0,), "in1": (1.0,), "in2": (0.0,)})
    white = emitting(graph.nodes, there)
    surface = replace(white, inputs=(("opacity", white.inputs[0][1]),), emissive_color=(1.0, 1.0, 1.0), opacity_threshold=0.5)
    matrix = described.translation(1e5, 0, 0)
    camera = described.orthographic(matrix @ described.translation(0, 0, 1), SIZE / 2)
    mesh = plane()
    made = described.describe([(mesh, matrix)], [surface], camera=camera, resolution=(SIZE, SIZE))
    if place == "instanced":
        made = instanced(mesh, surface, matrix, camera)
    found = described.render(made.build(), 1, max_depth=1).pixels()[..., 0]
    np.testing.assert_array_equal(found, np.broadcast_to(np.arange(SIZE) >= SIZE / 2, found.shape))
