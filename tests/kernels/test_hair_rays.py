"""What rays meet of hair and of other curves: walls that are left from within, and what stands before and behind them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import Described, box, describe, kernels, lambert, translation
from tests.kernels.scenes import strands

from primray.description import Curves, Doubles, Hair, Shape, Surface

RADIUS = 0.1
HAIR = Surface("/hair", hair=Hair())


def tube(surface: int) -> Curves:
    """Straight, along y from -1 to 1."""
    controls = np.array([(0, y, 0, RADIUS) for y in np.linspace(-1, 1, 4)], np.float32)
    return Curves("/tube", controls, np.array([1], np.int32), surface)


def scene(*shapes: Shape) -> Described:
    return describe([(shape, np.eye(4)) for shape in shapes], [HAIR, lambert(0.5)])


def directions(count: int, seed: int) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32)


@pytest.mark.parametrize("packet", [True, False])
def test_shadow_rays_leave_hair_and_nothing_else(packet: bool) -> None:
    """From within, through walls and ends: a fibre lets them out, another tube does not. From outside both stop them."""
    d = directions(2000, 1)
    inside = np.random.default_rng(2).uniform([-0.05, -0.9, -0.05], [0.05, 0.9, 0.05], (len(d), 3))
    for surface, stopped in ((0, 0.0), (1, 1.0)):
        found = kernels().intersect(scene(tube(surface)).build(), inside, d, 0, packet)
        assert found["blocked"].mean() == stopped
        assert (found["geometry"] >= 0).all()  # nearest hits are seen
        outside = inside - 5 * d.astype(float)
        assert kernels().intersect(scene(tube(surface)).build(), outside, d, 0, packet)["blocked"].all()


def test_what_leaves_a_fibre_is_stopped_by_the_next() -> None:
    beside = tube(0)
    moved = Curves("/next", beside.controls + np.array([0.5, 0, 0, 0], np.float32), beside.segments, 0)
    o = np.zeros((2, 3))
    d = np.array([[1, 0, 0], [-1, 0, 0]], np.float32)
    assert kernels().intersect(scene(beside, moved).build(), o, d)["blocked"].tolist() == [1, 0]


def test_the_nearest_of_curves_and_triangles() -> None:
    """Curves of the world are traced apart from what else it has: of both, the nearer is met."""
    hair, block = (strands(40, 0, 5), np.eye(4)), (box([0.3, 0.5, 0.3], 1), translation(0.2, 0.4, 0))
    o = np.random.default_rng(3).uniform([-2, -0.5, 2], [2, 2, 3], (4000, 3))
    to = np.random.default_rng(4).uniform([-1, 0, -0.5], [1, 1, 0.5], (4000, 3)) - o
    d = (to / np.linalg.norm(to, axis=1)[:, None]).astype(np.float32)

    def met(*shapes: tuple[Shape, Doubles]) -> dict[str, np.ndarray]:
        found = kernels().intersect(describe(list(shapes), [HAIR, lambert(0.5)]).build(), o, d)
        return {**found, "t": np.where(found["geometry"] >= 0, found["t"], np.inf)}

    both, curves, triangles = met(hair, block), met(hair), met(block)
    nearest = np.minimum(curves["t"], triangles["t"])
    np.testing.assert_allclose(both["t"], nearest, rtol=1e-5)
    first, second = curves["t"] < triangles["t"], triangles["t"] < curves["t"]
    for nearer, other, surface in ((first, triangles, 0), (second, curves, 1)):
        assert (nearer & np.isfinite(other["t"])).sum() > 10
        assert (both["surface"][nearer] == surface).all()
    # Strands this thick bend within their own radius here and there, where a wall has two sides.
    assert np.mean(both["blocked"] != np.isfinite(nearest)) < 2e-3
