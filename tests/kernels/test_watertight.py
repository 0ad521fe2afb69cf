"""Closed cages let no ray through, whatever level their faces are diced to: rays aimed at their edges.

From a thousandth of an edge away from its ends: at a vertex to the last bit, where no edge's sign is more than rounding,
Embree lets rays through on any mesh of small triangles.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.cages import cube, dice, octahedron, seen_from, uniform
from tests.described import describe, kernels, lambert, mesh

from primray.tessellation.dice import Dicing

MESHES = {
    "uniform": lambda: uniform(cube(), 4),
    "one level": lambda: uniform(cube(), 1),
    "creased": lambda: uniform(
        cube(crease_lengths=[5], crease_points=[0, 1, 3, 2, 0], crease_sharpnesses=[10.0]),
        4,
    ),
    "adaptive": lambda: dice(cube(), Dicing(8.0, 0, 7), seen_from([0.4, 0.2, 0.9], [0.3, 0.2, 0.0])),
    "adaptive loop": lambda: dice(octahedron(), Dicing(8.0, 0, 7), seen_from([0.4, 0.2, 0.7], [0.3, 0.2, 0.0])),
}


def leaks(name: str, rays: int, seed: int) -> int:
    """How many miss, of rays from around towards points on edges and on into the body, and of others from within."""
    made = MESHES[name]()
    points, triangles = made["points"], made["triangles"]
    scene = describe([(mesh(points, triangles), np.eye(4))], [lambert(0.5)]).build()
    rng = np.random.default_rng(seed)
    chunk, missed = 250_000, 0
    for _ in range(0, rays, chunk):
        side = rng.integers(0, 3, chunk)
        t = triangles[rng.integers(0, len(triangles), chunk)]
        a, b = points[t[np.arange(chunk), side]], points[t[np.arange(chunk), (side + 1) % 3]]
        target = a + rng.uniform(0.001, 0.999, (chunk, 1)) * (b - a)
        inner = rng.uniform(-0.15, 0.15, (chunk, 3))  # within each of these bodies
        outwards = rng.random(chunk) < 0.5
        from_outside = inner + 3 * (target - inner)
        origin = np.where(outwards[:, None], inner, from_outside)
        d = target - origin
        h = kernels().intersect(scene, origin, (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32))
        missed += int((h["primitive"] < 0).sum())
    return missed


@pytest.mark.parametrize("name", MESHES)
def test_no_ray_passes(name: str) -> None:
    assert leaks(name, 250_000, seed=1) == 0


@pytest.mark.long
@pytest.mark.parametrize("name", ["uniform", "adaptive"])
def test_no_ray_of_ten_million_passes(name: str) -> None:
    assert leaks(name, 10_000_000, seed=2) == 0


def test_a_gap_is_found() -> None:
    """The same rays through a mesh whose vertices are off by a thousandth in one triangle."""
    made = uniform(cube(), 2)
    points = np.concatenate([made["points"], made["points"][made["triangles"][0]] * np.float32(0.999)])
    triangles = made["triangles"].copy()
    triangles[0] = len(made["points"]) + np.arange(3)
    MESHES["torn"] = lambda: {"points": points, "triangles": triangles}
    try:
        assert leaks("torn", 250_000, seed=3) > 0
    finally:
        del MESHES["torn"]
