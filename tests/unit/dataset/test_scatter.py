"""Things on surfaces: their boxes are apart, they stand on the surface, and stay inside of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from primray.dataset import Draws
from primray.dataset.scatter import Box, Scattering, Surfaces, are_apart, place_all
from primray.errors import SettingsError

UP = np.array([0.0, 1.0, 0.0])
SQUARE = np.array([[[-2, 0, -2], [-2, 0, 2], [2, 0, 2]], [[-2, 0, -2], [2, 0, 2], [2, 0, -2]]], np.float64)
UNIT = (np.array([-0.5, -0.5, -0.5]), np.array([0.5, 0.5, 0.5]))


def box_at(x: float, turn_deg: float = 0.0) -> Box:
    angle = math.radians(turn_deg)
    world = np.eye(4)
    world[:3, :3] = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    world[0, 3] = x
    return Box.of(UNIT, world)


@pytest.mark.parametrize(
    ("x", "turn", "apart"),
    [(0.99, 0, False), (1.0, 0, True), (1.2, 45, False), (0.5 + math.sqrt(0.5) + 1e-3, 45, True), (1.15, 45, False)],
)
def test_boxes_are_apart_where_a_plane_separates_them(x: float, turn: float, apart: bool) -> None:
    assert are_apart(box_at(0), box_at(x, turn)) is apart
    assert are_apart(box_at(x, turn), box_at(0)) is apart


def test_boxes_that_only_an_axis_of_edges_separates_are_apart() -> None:
    """Two sticks that cross at a small distance: no face's plane separates them."""
    one = Box(np.zeros(3), np.eye(3), np.array([0.1, 0.1, 5.0]))
    s = math.sqrt(0.5)
    turned = np.array([[s, 0, s], [0, 1, 0], [-s, 0, s]]) @ np.array([[s, -s, 0], [s, s, 0], [0, 0, 1]])
    points = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-5, 5)])
    for height in (0.2, 0.24, 0.26, 0.5):
        other = Box(np.array([0, height, 0]), turned, np.array([0.1, 0.1, 5.0]))
        axis = np.cross(np.array([0, 0, 1.0]), turned[:, 2])
        a, b = points @ axis, (points @ turned.T + other.center) @ axis
        separate = a.max() < b.min() or b.max() < a.min()
        if separate:
            assert are_apart(one, other)
    assert not are_apart(one, Box(np.array([0, 0.1, 0]), turned, np.array([0.1, 0.1, 5.0])))
    assert are_apart(one, Box(np.array([0, 0.5, 0]), turned, np.array([0.1, 0.1, 5.0])))


def arranged(seed: int, count: int = 8, **how: float) -> dict[str, np.ndarray]:
    things = {f"/t{k}": (UNIT, np.diag([0.3 + 0.05 * k, 0.5, 0.4])) for k in range(count)}
    return place_all(things, Surfaces(SQUARE, UP, 45), [], Scattering(**how), Draws(seed, 0, "props"))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(10))
def test_things_stand_on_the_surface_inside_of_it_and_apart(seed: int) -> None:
    placed = arranged(seed, gap=0.02)
    boxes = [Box.of(UNIT, world) for world in placed.values()]
    for k, box in enumerate(boxes):
        assert all(are_apart(box.grown(0.0099), other.grown(0.0099)) for other in boxes[:k])
    for world in placed.values():
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        points = corners @ world[:3, :3].T + world[:3, 3]
        assert points[:, 1].min() == pytest.approx(0)
        assert np.abs(points[:, [0, 2]]).max() <= 2 + 1e-9


def test_they_depend_on_the_seed_alone() -> None:
    assert np.array_equal(arranged(1)["/t3"], arranged(1)["/t3"])
    assert not np.array_equal(arranged(1)["/t3"], arranged(2)["/t3"])


def test_points_are_uniform_over_the_area() -> None:
    """Of a large and a small triangle, 8 to 1: binomial, four standard deviations."""
    triangles = np.array([[[0, 0, 0], [0, 0, 4], [4, 0, 0]], [[10, 0, 0], [10, 0, 1], [12, 0, 0]]], np.float64)
    surfaces, draws = Surfaces(triangles, UP, 45), Draws(0, 0, "p")
    points = np.array([surfaces.point(draws)[0] for _ in range(2000)])
    large = (points[:, 0] < 5).sum()
    assert abs(large / 2000 - 8 / 9) < 4 * math.sqrt(8 / 81 / 2000)
    assert points[points[:, 0] < 5].mean(axis=0)[[0, 2]] == pytest.approx([4 / 3, 4 / 3], abs=4 * math.sqrt(16 / 18 / 1800))


def test_obstacles_are_avoided_and_what_faces_down_is_no_surface() -> None:
    wall = Box(np.zeros(3), np.eye(3), np.array([0.5, 1, 2.0]))
    things = {"/a": (UNIT, np.eye(3)), "/b": (UNIT, np.eye(3))}
    placed = place_all(things, Surfaces(SQUARE, UP, 45), [wall], Scattering(), Draws(0, 0, "x"))
    assert all(abs(world[0, 3]) > 0.9 for world in placed.values())
    assert not Surfaces(SQUARE[:, ::-1], UP, 45)


def test_what_does_not_fit_is_named() -> None:
    with pytest.raises(SettingsError, match="no place was found") as caught:
        arranged(0, count=40)
    assert caught.value.code == "dataset-crowded"
    assert caught.value.where.startswith("/t")


def test_things_lean_with_the_surface_unless_they_are_upright() -> None:
    slope = np.array([[[-2, -1, -2], [-2, -1, 2], [2, 1, 2]], [[-2, -1, -2], [2, 1, 2], [2, 1, -2]]], np.float64)
    things = {"/a": (UNIT, np.diag([0.5, 0.5, 0.5]))}
    for upright in (True, False):
        how = Scattering(upright=upright)
        world = place_all(things, Surfaces(slope, UP, 45), [], how, Draws(0, 0, "x"))["/a"]
        leans = np.array([-1, 2, 0]) / math.sqrt(5)
        assert world[:3, 1] / 0.5 == pytest.approx(UP if upright else leans)


def separated_by_an_axis(a: Box, b: Box) -> bool:
    """The textbook's 15 axes, by the corners' projections."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    p, q = ((corners * box.half) @ box.axes.T + box.center for box in (a, b))
    axes = [*a.axes.T, *b.axes.T, *(np.cross(u, v) for u in a.axes.T for v in b.axes.T)]
    gaps = [max((q @ n).min() - (p @ n).max(), (p @ n).min() - (q @ n).max()) for n in axes if n @ n > 1e-9]
    return bool(max(gaps) >= 0)


def test_random_boxes_are_apart_where_one_of_the_15_axes_says_so() -> None:
    found = []
    for k in range(400):
        draws = Draws(3, k, "boxes")
        a, b = (
            Box(
                np.array([draws.uniform(-1, 1) for _ in range(3)]),
                draws.rotation(),
                np.array([draws.uniform(0.1, 0.9) for _ in range(3)]),
            )
            for _ in range(2)
        )
        assert are_apart(a, b) is separated_by_an_axis(a, b)
        found.append(are_apart(a, b))
    assert 100 < sum(found) < 350
