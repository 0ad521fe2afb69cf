"""Plans of adaptive sampling: which tiles double their samples first, and what that costs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import pytest

from primray.core import TILE
from primray.sampling.adaptive import MOST, make_plan, tile_pixels


@dataclass
class FakeFilm:
    """Film of tiles in a row, with equal samples; rays by tile."""

    columns: int
    rays: float = 2.0
    resolution: tuple[int, int] = field(init=False)
    tiles: tuple[int, int] = field(init=False)

    def __post_init__(self) -> None:
        self.resolution, self.tiles = (TILE * self.columns, TILE), (self.columns, 1)
        self.next = np.full((2, self.columns), 8, np.uint32)
        self.tile_rays = np.full(self.columns, self.rays * 16.0 * TILE * TILE)


def plan_of(film: FakeFilm, errors: list[float], **more: Any) -> Any:
    return make_plan(cast(Any, film), np.array(errors), 16, **more)


def test_tiles_at_the_edges_are_smaller() -> None:
    film = FakeFilm(2)
    film.resolution = (TILE + 3, TILE - 1)
    assert tile_pixels(cast(Any, film)).tolist() == [TILE * (TILE - 1), 3 * (TILE - 1)]


def test_the_tile_with_the_largest_error_doubles_first() -> None:
    plan = plan_of(FakeFilm(9), [1.0] * 8 + [50.0])
    assert plan.order[0] == 8
    assert plan.levels[0] == 0
    assert len(plan.order) == 9 * 4


def test_a_tile_whose_samples_cost_more_waits() -> None:
    film = FakeFilm(12)
    film.tile_rays[:6] *= 4
    order = plan_of(film, [1.0] * 12).order.tolist()
    assert set(order[:6]) == set(range(6, 12))


def test_ends_grow_with_the_samples_and_are_powers_of_two_times_the_first() -> None:
    plan = plan_of(FakeFilm(4), [1.0, 2.0, 4.0, 8.0])
    before = np.full(4, 8)
    for samples in (16, 20, 24, 32, 64):
        ends = plan.ends(samples)
        assert (ends[0] == ends[1]).all()
        assert (ends[0] >= before).all()
        assert set((ends[0] // 8).tolist()) <= {1, 2, 4, 8, 16}
        assert 2 * ends[0].mean() <= samples
        before = ends[0]
    assert plan.ends(16)[0].tolist() == [8] * 4


def test_no_tile_is_worth_more_than_the_limit() -> None:
    """An error that is estimated much too large does not take all samples of a frame."""
    film, errors = FakeFilm(64), [1.0] * 63 + [1e12]
    others = plan_of(film, errors).order[: 4 + 63].tolist()
    assert others.count(63) <= np.log2(MOST) + 1


def test_samples_for_a_part_of_the_error() -> None:
    plan = plan_of(FakeFilm(4), [1.0] * 4)
    errors = np.ones(4)
    assert plan.samples_for(errors, 16.0, 1.0, 0.5) == pytest.approx(20.0)  # one tile of four has doubled
    assert plan.samples_for(errors, 16.0, 0.5, 0.5) == pytest.approx(32.0)  # each has
    assert plan.samples_for(errors, 16.0, 0.01, 0.5) == np.inf  # more than it plans
