"""Whose turn it is."""

from __future__ import annotations

from typing import Any

import pytest

from primray_service.dispatcher import fair_share
from primray_service.limits import Quotas


@pytest.mark.parametrize(
    ("waiting", "slots", "served", "passed_over"),
    [
        ([(50, "a")], {}, {}, set()),
        ([(50, "a"), (50, "b")], {}, {}, set()),  # never served: the queue's order
        ([(50, "a"), (50, "b")], {}, {"a": 1.0}, {"a"}),
        ([(50, "a"), (50, "b"), (50, "c")], {}, {"a": 3.0, "b": 1.0, "c": 2.0}, {"a", "c"}),
        ([(50, "a"), (50, "b")], {"b": 1}, {"a": 2.0, "b": 1.0}, set()),  # b has a slot, a has none
        ([(60, "a"), (50, "b")], {}, {"a": 2.0, "b": 1.0}, set()),
    ],
)
def test_whose_turn_it_is(waiting: Any, slots: dict[str, int], served: dict[str, float], passed_over: set[str]) -> None:
    quotas = fair_share.quotas_of_next_claim(lambda tenant: Quotas(), waiting, slots, served)
    assert {tenant for _, tenant in waiting if quotas(tenant).running_jobs == 0} == passed_over
