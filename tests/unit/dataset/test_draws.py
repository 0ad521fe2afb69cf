"""Random numbers of data sets: what they are a function of, and how they are distributed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from primray.dataset import Draws
from primray.dataset.distributions import distribution_of
from primray.dataset.document import document_of_values
from primray.errors import SettingsError


def test_they_are_the_same_on_every_machine_and_in_every_version() -> None:
    assert [Draws(7, 3, "lamp").bits(), Draws(-1, 0, "").bits()] == [4321912194709174831, 9413342625348679583]
    assert Draws(7, 3, "lamp").uniform() == (4321912194709174831 >> 11) * 2.0**-53


def test_each_depends_on_seed_index_and_name_alone() -> None:
    def first(seed: int, index: int, name: str) -> int:
        return Draws(seed, index, name).bits()

    assert len({first(s, k, n) for s in range(3) for k in range(3) for n in ("a", "b", "a\nb", "")}) == 36
    assert Draws(1, 2, "a").of("b").bits() != Draws(1, 2, "b").of("a").bits()


def test_numbers_are_uniform() -> None:
    """Chi-square over 64 cells of 6,400 numbers, 63 degrees of freedom; 113 is exceeded once in 10,000."""
    draws = Draws(0, 0, "uniform")
    cells = np.bincount([int(64 * draws.uniform()) for _ in range(6400)], minlength=64)
    assert ((cells - 100.0) ** 2 / 100).sum() < 113


def test_whole_numbers_below_a_count_are_as_likely() -> None:
    draws = Draws(0, 0, "below")
    counts = np.bincount([draws.below(5) for _ in range(5000)], minlength=5)
    assert len(counts) == 5
    assert ((counts - 1000.0) ** 2 / 1000).sum() < 23.5  # 4 degrees of freedom, once in 10,000


def test_normal_numbers_have_mean_0_and_variance_1() -> None:
    draws = Draws(0, 0, "normal")
    found = np.array([draws.normal() for _ in range(10_000)])
    assert abs(found.mean()) < 4 / 100
    assert abs(found.var() - 1) < 4 * math.sqrt(2 / 10_000)


def test_rotations_are_rotations_and_uniform() -> None:
    found = np.array([Draws(0, k, "r").rotation() for k in range(2000)])
    assert np.allclose(found @ found.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(found), 1)
    # Of uniform rotations the image of an axis is uniform on the sphere: means 0, variances 1/3.
    assert np.abs(found.mean(axis=0)).max() < 4.5 / math.sqrt(3 * 2000)
    assert np.abs((found**2).mean(axis=0) - 1 / 3).max() < 4.5 * math.sqrt(4 / 45 / 2000)


def test_shuffled_items_are_all_there() -> None:
    assert sorted(Draws(0, 0, "s").shuffled(range(50))) == list(range(50))
    assert Draws(0, 0, "s").shuffled(range(50)) != list(range(50))


@pytest.mark.parametrize(
    ("to", "holds"),
    [
        ({"uniform": [2, 3]}, lambda v: 2 <= v <= 3),
        ({"uniform": [[0, 5], [1, 6]]}, lambda v: 0 <= v[0] <= 1 and 5 <= v[1] <= 6),
        ({"log_uniform": [1e-3, 1e3]}, lambda v: 1e-3 <= v <= 1e3),
        ({"normal": [5, 1], "within": [4.5, 5.5]}, lambda v: 4.5 <= v <= 5.5),
        ({"whole": [-2, 2]}, lambda v: v in (-2, -1, 0, 1, 2)),
        ({"choice": ["a", [1, 2]]}, lambda v: v in ("a", [1, 2])),
        ({"choice": ["a", "b"], "weights": [0, 1]}, lambda v: v == "b"),
        (3, lambda v: v == 3),
        ([1, 2, 3], lambda v: v == [1, 2, 3]),
    ],
)
def test_values_are_of_their_distribution(to: object, holds: object) -> None:
    distribution = distribution_of(document_of_values(to))
    assert all(holds(distribution.draw(Draws(0, k, "x"))) for k in range(200))  # type: ignore[operator]


def test_logarithms_are_uniform() -> None:
    distribution = distribution_of(document_of_values({"log_uniform": [0.01, 100]}))
    logs = np.log10([distribution.draw(Draws(0, k, "x")) for k in range(2000)])
    assert abs(logs.mean()) < 4 * math.sqrt(16 / 12 / 2000)


def test_values_in_order_follow_the_index() -> None:
    distribution = distribution_of(document_of_values({"in_order": [1, 2, 3]}))
    assert [distribution.draw(Draws(9, k, "x")) for k in range(5)] == [1, 2, 3, 1, 2]


@pytest.mark.parametrize(
    ("to", "says"),
    [
        ({"unifrom": [1, 2]}, "did you mean uniform?"),
        ({}, "it must have one of uniform"),
        ({"uniform": [1, 2], "choice": [1]}, "it must have one of"),
        ({"uniform": [2, 1]}, "the least is above the greatest"),
        ({"uniform": [1]}, "a list of two"),
        ({"uniform": [[1, 2], [3]]}, "2 and 1 numbers"),
        ({"log_uniform": [0, 1]}, "above 0"),
        ({"choice": []}, "a list of values"),
        ({"choice": [1, 2], "weights": [1]}, "a list of 2 numbers"),
        ({"choice": [1, 2], "weights": [0, 0]}, "one of them above it"),
        ({"uniform": [0, 1], "weights": [1, 2]}, "weights is for choice only"),
        ({"normal": [0, -1]}, "must not be below 0"),
        ({"whole": [1.5, 2]}, "a whole number"),
        ({"uniform": [0, "x"]}, "it must be a number, not 'x'"),
    ],
)
def test_what_is_no_distribution_says_why(to: object, says: str) -> None:
    with pytest.raises(SettingsError, match=says) as caught:
        distribution_of(document_of_values(to, key="vary.x.to"))
    assert caught.value.code == "dataset-config"
    assert "vary.x.to" in caught.value.where
