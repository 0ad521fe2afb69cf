"""How many chunks fit on which nodes, and what each may use."""

from __future__ import annotations

import pytest

pytest.importorskip("ray", reason="skipped: no ray")

from primray_service.executor.ray.driver.cluster import Resources, room, selector

GiB = 2**30


def test_a_chunk_takes_eight_cores_of_large_nodes() -> None:
    found = room({"a": Resources(32, 64 * GiB), "b": Resources(20, 64 * GiB)}, None, 64 * GiB)
    assert (found.cores, found.slots, found.total) == (8, {"a": 4, "b": 2}, 6)
    assert found.memory_bytes == 16 * GiB


def test_a_chunk_takes_all_of_the_smallest_node() -> None:
    found = room({"a": Resources(4, 8 * GiB), "b": Resources(9, 32 * GiB)}, None, 4 * GiB)
    assert (found.cores, found.slots, found.memory_bytes) == (4, {"a": 1, "b": 2}, 4 * GiB)


def test_nodes_that_are_too_small_get_none() -> None:
    found = room({"a": Resources(4, 8 * GiB), "b": Resources(16, 32 * GiB)}, 16, 64 * GiB)
    assert (found.cores, found.slots, found.memory_bytes) == (16, {"a": 0, "b": 1}, 32 * GiB)


def test_no_nodes() -> None:
    found = room({}, None, GiB)
    assert (found.cores, found.total, found.memory_bytes) == (8, 0, GiB)


def test_nodes_are_chosen_by_label_and_refusal() -> None:
    assert selector({"pool": "render"}, []) == {"pool": "render"}
    assert selector({"pool": "render"}, ["a", "b"]) == {"pool": "render", "ray.io/node-id": "!in(a, b)"}
