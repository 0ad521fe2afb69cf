"""The hierarchy of our own for worlds of triangles alone (the core's accel/interleaved.hpp): Embree's hits, and no gaps."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cages import cube, uniform
from tests.described import describe, kernels, lambert, mesh
from tests.kernels.test_few_triangles import aimed_at_edges
from tests.kernels.test_intersection import rays, triangles
from tests.kernels.test_pairs import apart, bumps

from primray import core

pytestmark = pytest.mark.skipif(core.isa() != "v4", reason="skipped: no AVX-512")


def scene(what: str) -> object:
    if what == "soup":
        return describe([(mesh(*triangles(3000, seed=1)), np.eye(4))], [lambert(0.5)]).build()
    points, indices = bumps()
    return describe([(mesh(points, indices if what == "pairs" else apart(indices)), np.eye(4))], [lambert(0.5)]).build()


@pytest.mark.parametrize("what", ["soup", "pairs", "lone"])
def test_rays_meet_what_embree_says(what: str) -> None:
    made = scene(what)
    o, d = rays(seed=2)
    ours = kernels().intersect_interleaved(made, o, d)
    embree = kernels().intersect(made, o, d, embree=True)
    hit = embree["primitive"] >= 0
    assert hit.mean() > 0.1
    same = ours["primitive"] == embree["primitive"]
    # Rays through an edge may fall to either side.
    assert same.mean() > 0.999
    assert ((ours["primitive"] >= 0) == hit).mean() > 0.9997
    assert np.array_equal(ours["blocked"] == 1, ours["primitive"] >= 0)
    steep = hit & same & (np.abs(np.sum(embree["ng"] * d, axis=1)) > 0.05)
    reach = np.maximum(embree["t"], np.abs(embree["p"]).max(axis=1))
    assert (np.abs(ours["t"] - embree["t"])[steep] < 2e-5 * reach[steep]).all()
    assert (np.abs(np.stack([ours["u"], ours["v"]], axis=1) - embree["uv"])[steep] < 2e-3).all()


def test_a_ray_does_not_depend_on_the_others() -> None:
    made = scene("pairs")
    o, d = rays(seed=3)
    whole = kernels().intersect_interleaved(made, o, d)
    some = kernels().intersect_interleaved(made, o[7::13].copy(), d[7::13].copy())
    for name, column in some.items():
        np.testing.assert_array_equal(column, whole[name][7::13])


def test_no_ray_leaves_a_closed_mesh() -> None:
    """Aimed at edges from within, where rounding decides on which side they pass."""
    made = uniform(cube(), 4)
    body = mesh(made["points"], made["triangles"])
    built = describe([(body, np.eye(4))], [lambert(0.5)]).build()
    o, d = aimed_at_edges([body], 500_000, seed=5, within=0.15)
    found = kernels().intersect_interleaved(built, o, d)
    assert (found["primitive"] >= 0).all()
    assert (found["blocked"] == 1).all()
