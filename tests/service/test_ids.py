"""ULIDs sort by time, and have the alphabet and length of their specification."""

from __future__ import annotations

from primray_service.ids import ALPHABET, job_id, ulid


def test_the_layout_of_the_specification() -> None:
    text = ulid(1469918176.385, bytes(10))
    assert text == "01ARYZ6S41" + 16 * "0"
    assert ulid(0.0, b"\xff" * 10) == 10 * "0" + 16 * "Z"


def test_they_sort_by_time_and_differ() -> None:
    assert ulid(1.0) < ulid(1.5) < ulid(1e9)
    assert len({ulid(1.0) for _ in range(100)}) == 100
    assert set(job_id(1.0).removeprefix("job_")) <= set(ALPHABET)
