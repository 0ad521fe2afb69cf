"""Triangles put side by side: which meshes, and that they stay the same triangles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from primray.description.geometry import FEWEST_PAIRED_TRIANGLES, is_paired
from primray.usd.mesh.triangulate import Triangles, paired_triangles, reversed_triangles, triangulate

SIDE = 20
Ints = npt.NDArray[np.int32]


def faces_of_grid() -> Ints:
    """(F, 4) points of a grid's quads."""
    a = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    return np.stack([a, a + 1, a + SIDE + 2, a + SIDE + 1], axis=1).astype(np.int32)


def of_quads() -> Triangles:
    at = np.arange((SIDE + 1) * (SIDE + 1))
    points = np.stack([at % (SIDE + 1), at // (SIDE + 1), 0 * at], axis=1).astype(np.float32)
    return triangulate(points, np.full(SIDE * SIDE, 4, np.int32), faces_of_grid().ravel())


def of_triangles(order: npt.NDArray[np.intp], turns: tuple[int, int] = (0, 0)) -> Triangles:
    """Faces of three corners: the grid's two kinds, each turned, in this order."""
    quads = faces_of_grid()
    points = np.concatenate([np.roll(quads[:, [0, 1, 2]], turns[0], axis=1), np.roll(quads[:, [0, 2, 3]], turns[1], axis=1)])[
        order
    ]
    return Triangles(points, np.arange(points.size, dtype=np.int32).reshape(-1, 3), np.arange(len(points), dtype=np.int32))


def rows(triangles: Triangles) -> set[tuple[int, ...]]:
    """Each triangle from its lowest point on, in its winding, with the corners of those points and its face."""
    found = set()
    for points, corners, face in zip(triangles.points, triangles.corners, triangles.faces, strict=True):
        k = int(points.argmin())
        found.add((*np.roll(points, -k).tolist(), *np.roll(corners, -k).tolist(), int(face)))
    return found


ALL = np.arange(2 * SIDE * SIDE)
BY_ROWS = ALL.reshape(2, SIDE, SIDE).swapaxes(0, 1).ravel()
SIDE_BY_SIDE = ALL.reshape(2, -1).T.ravel()


@pytest.mark.parametrize(
    "triangles",
    [
        of_quads(),
        reversed_triangles(of_quads()),
        of_triangles(ALL),
        of_triangles(ALL, (1, 2)),
        of_triangles(ALL, (2, 2)),
        of_triangles(BY_ROWS),
        of_triangles(SIDE_BY_SIDE, (0, 1)),
        reversed_triangles(of_triangles(BY_ROWS, (2, 0))),
    ],
)
def test_what_pairs(triangles: Triangles) -> None:
    assert len(triangles.points) >= FEWEST_PAIRED_TRIANGLES
    made = paired_triangles(triangles)
    assert is_paired(made.points)
    assert rows(made) == rows(triangles)
    for name in ("points", "corners", "faces"):
        assert getattr(made, name).dtype == np.int32
        assert getattr(made, name).flags.c_contiguous


def test_triangles_of_quads_are_not_turned() -> None:
    """Whatever hangs on where a triangle begins stays."""
    first, second = of_quads().points[::2], of_quads().points[1::2]
    made = paired_triangles(of_quads()).points
    assert np.array_equal(made[::2], second)
    assert np.array_equal(made[1::2], first)


@pytest.mark.parametrize(
    "triangles",
    [
        of_triangles(np.random.default_rng(1).permutation(len(ALL))),
        of_triangles(ALL[:-1]),
        Triangles(*(getattr(of_quads(), name)[: FEWEST_PAIRED_TRIANGLES - 2] for name in ("points", "corners", "faces"))),
    ],
)
def test_what_does_not_pair_stays(triangles: Triangles) -> None:
    assert paired_triangles(triangles) is triangles
    assert not is_paired(triangles.points)
