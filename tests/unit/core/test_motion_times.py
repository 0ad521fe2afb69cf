"""Motion sample times: one set for each group, uniform in the world, with the same motion as before."""

from __future__ import annotations

import numpy as np

from primray.core.motion_times import EVEN_TIMES, resampled, with_common_times
from primray.description import Mesh, Placed, PointMotion, Prototype, Shape
from primray.description.motion import segment_of

from ..conftest import make_description

TRIANGLE = np.array([[0, 1, 2]], np.int32)


def moving(path: str, times: list[float]) -> Mesh:
    steps = np.arange(len(times) * 9, dtype=np.float32).reshape(-1, 3, 3) ** 2
    return Mesh(path, steps[0], TRIANGLE, None, None, 0, motion=PointMotion(np.array(times), steps))


def points_at(motion: PointMotion, time: float) -> np.ndarray:
    k, within = segment_of(motion.times, time)
    return np.asarray(motion.points[k] * (1 - within) + motion.points[k + 1] * within)


def test_more_times_change_no_motion() -> None:
    mesh = moving("/a", [0.0, 0.25, 1.0])
    assert mesh.motion is not None
    made = resampled(mesh.motion, np.array([0.0, 0.25, 0.5, 1.0]))
    assert len(made.points) == 4
    for time in (0.0, 0.1, 0.25, 0.4, 0.5, 0.9, 1.0):
        np.testing.assert_allclose(points_at(made, time), points_at(mesh.motion, time), rtol=1e-5, atol=1e-4)


def test_shapes_of_one_prototype_get_the_union_of_their_times() -> None:
    shapes: list[Shape] = [moving("/a", [0.0, 0.5, 1.0]), moving("/b", [0.0, 0.25, 1.0])]
    placed = tuple(Placed(k, np.eye(4)) for k in range(2))
    description = make_description(prototypes=(Prototype("/p", placed),))
    made = with_common_times(description, shapes, [])
    times = [shapes[p.shape].motion.times.tolist() for p in made.prototypes[0].shapes]  # type: ignore[union-attr]
    assert times == [[0.0, 0.25, 0.5, 1.0]] * 2


def test_in_the_world_shapes_of_other_times_become_prototypes() -> None:
    shapes: list[Shape] = [moving("/a", [0.0, 0.5, 1.0]), moving("/b", [0.0, 0.25, 1.0])]
    description = make_description(static=tuple(Placed(k, np.eye(4)) for k in range(2)))
    made = with_common_times(description, shapes, [])
    assert [p.shape for p in made.static] == [0]  # its times are uniform
    assert [[p.shape for p in proto.shapes] for proto in made.prototypes] == [[1]]
    assert len(made.placements) == 1


def test_too_many_times_are_resampled_and_reported() -> None:
    many = np.append(np.linspace(0.0, 0.9, 2 * len(EVEN_TIMES)), 1.0).tolist()
    shapes: list[Shape] = [moving("/a", many)]
    warnings: list[tuple[str, str, str]] = []
    with_common_times(make_description(static=(Placed(0, np.eye(4)),)), shapes, warnings)
    assert isinstance(shapes[0], Mesh)
    assert shapes[0].motion is not None
    assert len(shapes[0].motion.times) == len(EVEN_TIMES)
    assert [(code, path) for code, path, _ in warnings] == [("motion", "/a")]


def test_a_scene_at_rest_is_returned_as_it_is() -> None:
    description = make_description()
    assert with_common_times(description, [], []) is description
