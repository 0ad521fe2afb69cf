"""Sums that depend on neither order nor grouping, and lose nothing that matters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.described import core_module


def exact_sum(terms: np.ndarray, group: int = 16) -> tuple[int, int, int, float]:
    return core_module().exact_sum(terms, group)


def terms(kind: str, count: int, rng: np.random.Generator) -> np.ndarray:
    if kind == "alike":
        made = rng.random(count)
    elif kind == "wide":
        made = 10.0 ** rng.uniform(-35, 38, count)
    elif kind == "signed":
        made = rng.standard_normal(count) * 10.0 ** rng.uniform(-10, 10, count)
    else:
        made = np.where(rng.random(count) < 0.01, 1e7, 1e-3)
    return made.astype(np.float32)


@pytest.mark.parametrize("kind", ["alike", "wide", "signed", "sparse"])
def test_order_and_grouping_do_not_show(kind: str) -> None:
    rng = np.random.default_rng(1)
    for count in (1, 2, 16, 333, 4096):
        values = terms(kind, count, rng)
        sums = {exact_sum(rng.permutation(values), group) for group in (1, 2, 7, 16, 64)}
        assert len(sums) == 1


@pytest.mark.parametrize("kind", ["alike", "wide", "signed", "sparse"])
def test_sums_are_right_to_the_largest_term(kind: str) -> None:
    rng = np.random.default_rng(2)
    values = terms(kind, 4096, rng)
    exact = math.fsum(values.tolist())
    assert exact_sum(values)[3] == pytest.approx(exact, abs=4096 * 2.0**-40 * float(np.abs(values).max()), rel=1e-15)


@pytest.mark.parametrize("value", [1.0, 0.1, 1e-30, 3e38, 2.0**-40, 2.0**40, np.nextafter(np.float32(2.0**40), np.float32(0))])
def test_a_million_of_one_value(value: float) -> None:
    value = float(np.float32(value))
    assert exact_sum(np.full(1_000_000, value, np.float32), 32)[3] / 1_000_000 == pytest.approx(value, rel=1e-12)


def test_nothing_is_zero() -> None:
    assert exact_sum(np.zeros(5, np.float32))[3] == 0.0
    assert exact_sum(np.array([1.0, -1.0], np.float32))[3] == 0.0
