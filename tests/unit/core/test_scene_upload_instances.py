"""Placements in the core: what is left out is named, and far, huge and nested ones keep their digits."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np
from tests.described import box, core_module, describe, kernels, lambert, orthographic, placement, translation

from primray.core.inputs import filled
from primray.core.scene_upload import add_placement, upload
from primray.description import Doubles, Placed, Placement, Prototype, Shape

CUBE = Prototype("/cube", (Placed(0, np.eye(4)),))
NO_TABLE = np.zeros(0, np.float32)


def test_singular_and_non_finite_instances_are_left_out_by_number() -> None:
    matrices = np.array([translation(2.0 * i, 0, 0) for i in range(40000)])
    matrices[[3, 39999], :3, :3] = 0.0
    matrices[20000, 0, 0] = np.nan
    core = core_module()
    builder = core.SceneBuilder((0.0, 0.0, 0.0), 1.0)
    number = builder.begin_prototype((0.0, 0.0, 0.0), 1.0)
    cube = box([1, 1, 1])
    mesh = filled(core.MeshInput(), points=cube.points, triangles=cube.triangles, surfaces=np.zeros(1, np.int32))
    builder.add_mesh(mesh, np.eye(4))
    assert add_placement(builder, placement(0, matrices), 0, number).tolist() == [3, 20000, 39999]


def test_one_warning_a_placement_says_how_many() -> None:
    matrices = np.array([np.eye(4), np.zeros((4, 4)), translation(3, 0, 0)])
    made = describe(
        [], [lambert(0.5)], prototypes=[CUBE], prototype_shapes=[box([1, 1, 1])], placements=[placement(0, matrices)]
    )
    scene, warnings, _ = upload(made.description, {}, 1.0, NO_TABLE)
    assert [(code, path, message[:11]) for code, path, message in warnings] == [("singular-transform", "/cube", "1 instances")]
    o, d = np.array([[0.0, 0, 9], [3.0, 0, 9], [6.0, 0, 9]]), np.array([[0, 0, -1]] * 3, np.float32)
    hits = kernels().intersect(scene, o, d)
    assert (hits["geometry"] >= 0).tolist() == [True, True, False]


def heights(placements: list[Placement], prototypes: list[Prototype], at: Doubles) -> Doubles:
    """Where rays straight down meet the scene, relative to the camera; its origin is (1e7, 0, 1e7)."""
    camera = orthographic(translation(1e7, 0, 1e7), 1.0)
    made = describe(
        [], [lambert(0.5)], camera=camera, prototypes=prototypes, prototype_shapes=[box([1, 1, 1])], placements=placements
    )
    hits = kernels().intersect(made.build(), at + [0, 5.0, 0], np.array([[0, -1, 0]] * len(at), np.float32))
    return np.asarray(hits["p"], np.float64)


def test_two_levels_far_from_the_origin() -> None:
    """A group as large as its distance from the camera: errors are of the size of float's rounding of the group."""
    inner = np.array([translation(x, 0, z) for x in (-1000, 0, 1000) for z in (-1000, 0, 1000)])
    outer = np.array([translation(1e7 + 1000, 0.25, 1e7), translation(1e7 - 5000, 0, 1e7)])
    nested = [CUBE, Prototype("/group", (), (placement(0, inner),))]
    at = np.array([[1e7, 0, 1e7], [1e7 + 1000, 0, 1e7 + 1000]])
    found = heights([placement(1, outer)], nested, at)
    flat = heights([placement(0, (outer[:, None] @ inner[None]).reshape(-1, 4, 4))], [CUBE], at)
    np.testing.assert_allclose(flat[:, 1], 0.75, atol=1e-6)
    np.testing.assert_allclose(found, flat, atol=2000 * 2.0**-22)


def test_shapes_that_are_handed_over_are_let_go() -> None:
    shape = box([1, 1, 1])
    description = describe([(shape, np.eye(4))], [lambert(0.5)]).description
    shapes: list[Shape] = [shape]
    held = weakref.ref(shape.points)
    description = replace(description, shapes=())
    del shape
    scene, _, _ = upload(description, {}, 1.0, NO_TABLE, shapes)
    assert shapes == []
    assert held() is None
    hits = kernels().intersect(scene, np.array([[0.0, 0, 9]]), np.array([[0, 0, -1]], np.float32))
    assert hits["geometry"][0] >= 0


def test_boxes_of_arrays_in_any_layout() -> None:
    points = np.random.default_rng(3).normal(size=(20000, 3)).astype(np.float32)
    expected = np.array([points.min(axis=0), points.max(axis=0)], np.float64)
    layouts = [points, np.asfortranarray(points), np.repeat(points, 2, axis=0)[::2]]
    assert np.array_equal(core_module().boxes(layouts * 20), np.array([expected] * 60))


def test_bounds_of_a_scene_with_prototypes() -> None:
    """Corners of all that is placed, whatever the box of the last prototype is."""
    made = describe([(box([1, 1, 1]), np.eye(4))], [lambert(0.5)], prototypes=[Prototype("/p", (Placed(1, np.eye(4)),))],
                    prototype_shapes=[box([2, 2, 2])], placements=[placement(0, [translation(5, 0, 0)])])  # fmt: skip
    _, _, bounds = upload(made.description, {}, 1.0, NO_TABLE)
    assert bounds is not None
    np.testing.assert_allclose(np.array(bounds), np.array([[-0.5, -1, -1], [6, 1, 1]]))
