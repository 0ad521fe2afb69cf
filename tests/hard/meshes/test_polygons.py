"""Faces of many corners, concave and touching themselves: as much is covered as their outline holds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from tests.described import look_at, rotation
from tests.hard.meshes.mesh_stages import DOME, camera_prim, codes, mesh_prim, picture
from tests.unit.usd.usd_text import translate_text

from primray.description import Doubles, Mesh

Measured = Callable[[str], None]


def star(points: int, inner: float) -> Doubles:
    a = np.pi * np.arange(2 * points) / points
    r = np.where(np.arange(2 * points) % 2, inner, 1.0)
    return np.stack([r * np.cos(a), r * np.sin(a)], axis=1)


def blob(n: int) -> Doubles:
    """Any simple outline that its centre sees."""
    rng = np.random.default_rng(n)
    a = 2 * np.pi * (np.arange(n) + rng.uniform(0, 0.9, n)) / n
    return rng.uniform(0.2, 1, n)[:, None] * np.stack([np.cos(a), np.sin(a)], axis=1)


def comb(teeth: int) -> Doubles:
    x = np.linspace(-1, 1, 2 * teeth + 1)
    top = [[x[i], (0.9 if i % 2 else -0.7)] for i in range(2 * teeth, -1, -1)]
    return np.array([[-1, -0.9], [1, -0.9], *top])


def spiral(turns: int, steps: int) -> Doubles:
    a = np.linspace(0, 2 * np.pi * turns, steps)
    r = 0.1 + 0.8 * a / a[-1]
    way = np.stack([np.cos(a), np.sin(a)], axis=1)
    return np.concatenate([way * r[:, None], (way * (r + 0.04)[:, None])[::-1]])


def square(half: float) -> Doubles:
    return half * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def with_hole() -> Doubles:
    """A square hole, joined to the outside by an edge that is walked both ways."""
    outside, hole = square(0.9), square(0.4)[::-1]
    return np.concatenate([outside, outside[:1], np.roll(hole, 1, axis=0), np.roll(hole, 1, axis=0)[:1]])


def with_many_holes() -> Doubles:
    """Nine holes in a row of bridges, each from the hole before it."""
    ring, back = [*square(0.95), square(0.95)[0]], [square(0.95)[0]]
    for k in range(9):
        hole = np.array([-0.8 + 0.2 * k, -0.8 + 0.2 * k]) + square(0.06)[[0, 3, 2, 1]]
        ring += [hole[0], hole[1], hole[2]]
        back = [hole[2], hole[3], hole[0], *back]
    return np.array([*ring, *back[:-1]])


def with_spikes() -> Doubles:
    spikes = np.array([[0.9, 0], [0, 0], [0.9, 0], [0.9, 0.3], [-0.5, 0.3], [0.9, 0.3]])
    return np.insert(square(0.9), 2, spikes, axis=0)


def on_sides(outline: Doubles, each: int) -> Doubles:
    sides = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    return np.concatenate([a + (b - a) * np.linspace(0, 1, each, endpoint=False)[:, None] for a, b in sides])


POLYGONS: dict[str, Callable[[], Doubles]] = {
    **{f"{n} corners": partial(blob, n) for n in (3, 4, 5, 7, 12, 33, 100, 200)},
    "a star of 5": lambda: star(5, 0.382),
    "a star of 100, thin": lambda: star(100, 0.05),
    "a comb of 40 teeth": lambda: comb(40),
    "a spiral": lambda: spiral(4, 90),
    "a hole by a bridge": with_hole,
    "nine holes by bridges": with_many_holes,
    "two squares that touch at a corner": lambda: np.concatenate([square(0.5) - 0.5, square(0.5)[[0, 1, 2, 3]] + 0.5])[
        [2, 3, 0, 1, 4, 5, 6, 7]
    ],
    "every corner twice": lambda: np.repeat(star(7, 0.5), 2, axis=0),
    "every corner three times": lambda: np.repeat(comb(5), 3, axis=0),
    "ten corners on each side": lambda: on_sides(star(5, 0.4), 10),
    "a spike out and back": lambda: np.insert(square(0.8), 2, np.array([[0.8, 0], [0.99, 0], [0.8, 0]]), axis=0),
    "spikes inwards": with_spikes,
}


def area(outline: Doubles) -> float:
    x, y = outline.T
    return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def stage(outline: Doubles, turn: Doubles) -> str:
    points = np.concatenate([outline, np.zeros((len(outline), 1))], axis=1) @ turn[:3, :3].T
    eye = camera_prim(turn @ look_at([0, 0, 5], [0, 0, 0]), 1.0, orthographic=True)
    return eye + DOME + mesh_prim(points, [list(range(len(outline)))])


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.hard_case(
    "Meshes",
    "one face: %s",
    expected="its triangles have its area to 1e-5, its picture covers it to 2e-3",
)
def test_area(name: str, measured: Measured) -> None:
    outline = POLYGONS[name]()
    exact = area(outline)
    for turn in (np.eye(4), rotation((1, 2, 3), 77)):
        text = stage(outline, turn)
        (shape,) = translate_text(text)[0].shapes
        assert isinstance(shape, Mesh)
        p = shape.points.astype(np.float64)[shape.triangles]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        assert abs(np.linalg.norm(cross, axis=1).sum() / 2 - exact) < 1e-5
        image = picture(text, (64, 64), 16, max_depth=1)
        assert abs(4 * image.pixels[..., 3].astype(np.float64).mean() - exact) < 2e-3 * 4
        covered = image.pixels[image.pixels[..., 3] == 1]
        assert (np.abs(covered[:, :3] - 0.5) < 1e-6).all()
    measured("so it is")


CROSSING = {
    "a figure of eight": np.array([[-1.0, -1], [1, 1], [1, -1], [-1, 1]]),
    "a pentagram": star(5, 1.0)[::4],
    "200 random corners": np.random.default_rng(5).uniform(-1, 1, (200, 2)),
    "all in one line": np.stack([np.linspace(-1, 1, 20), np.linspace(-1, 1, 20)], axis=1),
    "all in one point": np.zeros((20, 2)),
    "out and back": np.array([[-1.0, 0], [1, 0], [0, 0], [-0.5, 0]]),
}


@pytest.mark.parametrize("name", CROSSING)
@pytest.mark.hard_case(
    "Meshes", "one face that crosses itself or is flat: %s", expected="something within its outline, or a diagnostic"
)
def test_crossing(name: str, measured: Measured) -> None:
    outline = CROSSING[name]
    text = stage(outline, np.eye(4))
    image, again = picture(text, (32, 32), 16), picture(text, (32, 32), 16, threads=1)
    assert np.isfinite(image.pixels).all()
    np.testing.assert_array_equal(image.pixels, again.pixels)
    if np.linalg.matrix_rank(outline - outline[0], tol=1e-9) < 2:
        assert codes(image) == ["faces-degenerate"]
        assert not image.pixels[..., 3].any()
        measured("nothing, `faces-degenerate`")
    else:
        assert image.pixels[..., 3].mean() > 0.05
        measured("drawn")
