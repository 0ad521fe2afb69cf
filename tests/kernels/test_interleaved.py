"""Worlds of many triangles alone, on CPUs with AVX-512 (the core's bvh/interleaved.hpp): Embree's hits, and no gaps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.cages import cube, uniform
from tests.described import box, describe, kernels, lambert, mesh, placement, rotation, scaling
from tests.kernels.test_few_triangles import (
    aimed_at_edges,
    assert_any_lanes_meet_the_same_bits,
    assert_rays_meet_what_embree_says,
)
from tests.kernels.test_intersection import rays, triangles
from tests.kernels.test_pairs import apart, bumps

from primray import core
from primray.description import Placed, Prototype, Sphere

pytestmark = pytest.mark.skipif(core.isa() != "v4", reason="skipped: no AVX-512")

SCENES = ("soup", "pairs", "lone", "mixed")


def scene(what: str) -> Any:
    if what == "soup":
        return describe([(mesh(*triangles(3000, seed=1)), np.eye(4))], [lambert(0.5)]).build()
    points, indices = bumps()
    sheet = mesh(points, indices if what in ("pairs", "mixed") else apart(indices))
    bar = [(box([0.5, 3, 0.4], 1), rotation([1, 2, 3], 30))] if what == "mixed" else []
    return describe([*bar, (sheet, np.eye(4))], [lambert(0.5), lambert(0.2)]).build()


@pytest.mark.parametrize("what", SCENES)
def test_rays_meet_what_embree_says(what: str) -> None:
    made = scene(what)
    assert kernels().has_hierarchy(made)
    assert_rays_meet_what_embree_says(made, *rays(seed=2))


@pytest.mark.parametrize("what", SCENES)
def test_any_number_of_lanes_meets_the_same_bits(what: str) -> None:
    assert_any_lanes_meet_the_same_bits(scene(what))


@pytest.mark.parametrize("what", ["soup", "pairs"])
def test_a_ray_does_not_depend_on_the_others(what: str) -> None:
    """All at once, where new rays take the places of those that end, and in calls of 16."""
    made = scene(what)
    o, d = rays(seed=3)
    stream, calls = kernels().intersect_stream(made, o, d), kernels().intersect(made, o, d, 16)
    hit = calls["primitive"] >= 0
    assert np.array_equal(stream["blocked"], calls["blocked"])
    assert np.array_equal(stream["primitive"], calls["primitive"])
    assert np.array_equal(stream["t"][hit], calls["t"][hit])
    assert np.array_equal(np.stack([stream["u"], stream["v"]], axis=1)[hit], calls["uv"][hit])


def test_of_triangles_in_one_place_the_first_is_met() -> None:
    """Whatever order the builder left them in; as many as take several leaves."""
    points, indices = triangles(1000, seed=1)
    copies = 12
    stacked = mesh(np.tile(points, (copies, 1)), np.concatenate([indices + k * len(points) for k in range(copies)]))
    made = describe([(stacked, np.eye(4))], [lambert(0.5)]).build()
    assert kernels().has_hierarchy(made)
    found = kernels().intersect(made, *rays(seed=2))
    assert (found["primitive"] >= 0).mean() > 0.1
    assert found["primitive"].max() < len(indices)


def test_no_ray_leaves_a_closed_mesh() -> None:
    """Aimed at edges from within, where rounding decides on which side they pass."""
    made = uniform(cube(), 4)
    body = mesh(made["points"], made["triangles"])
    built = describe([(body, np.eye(4))], [lambert(0.5)]).build()
    assert kernels().has_hierarchy(built)
    o, d = aimed_at_edges([body], 500_000, seed=5, within=0.15)
    found = kernels().intersect_stream(built, o, d)
    assert (found["primitive"] >= 0).all()
    assert (found["blocked"] == 1).all()


def test_worlds_with_more_than_triangles_are_left_to_embree() -> None:
    points, index = triangles(3000, seed=1)
    soup = mesh(points, index)
    prototype = Prototype("/p", (Placed(1, np.eye(4)),))
    placed = describe(
        [(soup, np.eye(4))],
        [lambert(0.5)],
        prototypes=[prototype],
        prototype_shapes=[box([1, 1, 1])],
        placements=[placement(0, [scaling(0.1, 0.1, 0.1)])],
    )
    assert not kernels().has_hierarchy(placed.build())
    assert not kernels().has_hierarchy(describe([(soup, np.eye(4)), (Sphere("/s", 0.5, 0), np.eye(4))], [lambert(0.5)]).build())
