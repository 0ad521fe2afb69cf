"""What curves can be that nobody meant: still pictures without holes, crashes or numbers that are not finite."""

from __future__ import annotations

import numpy as np
import pytest

from .test_tubes import AOVS, FLAT
from .views import centres, cubic, curves, linear, look, values

WHITE = "color3f[] primvars:displayColor = [(1, 1, 1)]"
STRANGE = {
    "coincident points": cubic("[(0, 0, 0), (0, 0, 0), (0, 0, 0), (1, 0, 0)]", FLAT.format(0.5)),
    "all in one place": cubic("[(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)]", FLAT.format(0.5)),
    "a loop tighter than its radius": cubic("[(0, 0, 0), (1, 1, 0), (-1, 1, 0), (0.05, 0, 0)]", FLAT.format(1.5)),
    "a turn on the spot": linear("[(-1, 0, 0), (1, 0, 0), (-1, 0.001, 0)]", FLAT.format(0.5)),
    "back and forth": linear("[(-1, 0, 0), (1, 0, 0), (-1, 0, 0)]", FLAT.format(0.5)),
    "twice the same vertex": linear("[(-1, 0, 0), (0, 0, 0), (0, 0, 0), (1, 0.5, 0)]", FLAT.format(0.5)),
    "a cusp": cubic("[(-1, 0, 0), (1, 1, 0), (-1, 1, 0), (1, 0, 0)]", FLAT.format(0.2)),
    "wider than long": cubic("[(0, 0, 0), (0.001, 0, 0), (0.002, 0, 0), (0.003, 0, 0)]", FLAT.format(2)),
    "tiny": cubic("[(0, 0, 0), (1e-7, 0, 0), (2e-7, 0, 0), (3e-7, 0, 0)]", FLAT.format(1e-8)),
    "huge": cubic("[(-1e6, 0, 0), (-1, 0, 0), (1, 0, 0), (1e6, 0, 0)]", FLAT.format(0.5)),
}


@pytest.mark.parametrize("what", STRANGE)
def test_strange_curves(what: str) -> None:
    image = look(curves(STRANGE[what] + "\n" + WHITE), *AOVS, spp=4, max_depth=3)
    assert np.isfinite(image.pixels).all()
    assert image.pixels[..., :3].max() < 1.02
    there = np.isfinite(values(image, "distance"))
    if what not in ("all in one place", "tiny"):
        assert there.any()
    lengths = np.linalg.norm(values(image, "geometric_normal")[there], axis=1)
    assert np.abs(lengths - 1).max(initial=0) < 1e-3


def test_a_turn_in_one_place_is_closed_by_half_a_ball() -> None:
    """Where a line runs back on itself, its last disc is seen from neither side."""
    image = look(curves(STRANGE["back and forth"]), *AOVS)
    x, y = centres()
    tube = (np.abs(x) < 1) & (np.abs(y) < 0.25)
    ball = (x >= 1) & (np.hypot(x - 1, y) < 0.25)
    assert np.array_equal(np.isfinite(values(image, "distance")), tube | ball)


@pytest.mark.parametrize("size", [64, 65])
@pytest.mark.parametrize("turn", [0, 1])
def test_no_ray_comes_through_between_segments(size: int, turn: int) -> None:
    """Joints in the pixels' planes: a polyline with a vertex at each pixel's edge or centre, along both axes."""
    at = [(k - size / 2) * 4 / size for k in range(1, 2 * size, 3)]
    points = [f"({x / 2}, 0, 0)" if turn == 0 else f"(0, {x / 2}, 0)" for x in at]
    image = look(curves(linear("[" + ", ".join(points) + "]", FLAT.format(0.8))), *AOVS, size=size)
    x, y = centres(size)
    along, across = (x, y) if turn == 0 else (y, x)
    inside = (along > at[0] / 2 + 1e-3) & (along < at[-1] / 2 - 1e-3) & (np.abs(across) < 0.39)
    assert np.isfinite(values(image, "distance"))[inside].all()
    assert (values(image, "position")[inside][:, 2] > 0).all()


def test_a_curve_of_many_vertices() -> None:
    count = 100_000
    t = np.linspace(0, 40 * np.pi, count)
    points = "[" + ", ".join(f"({1.5 * np.sin(a):.5f}, {a / 35 - 1.8:.5f}, {0.1 * np.cos(a):.5f})" for a in t) + "]"
    image = look(curves(linear(points, FLAT.format(0.05), counts=f"[{count}]")), *AOVS)
    assert 0.3 < np.isfinite(values(image, "distance")).mean() < 0.9
