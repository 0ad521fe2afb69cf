"""Ranges of bytes in a Range header (RFC 9110, section 14)."""

from __future__ import annotations

import pytest

from primray_service.http.file_answer import MOST_RANGES, byte_ranges


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("bytes=0-9", [(0, 10)]),
        ("bytes=90-", [(90, 100)]),
        ("bytes=-10", [(90, 100)]),
        ("bytes=-1000", [(0, 100)]),
        ("bytes=50-1000", [(50, 100)]),
        ("bytes=50-59, 0-9", [(0, 10), (50, 60)]),
        ("bytes=0-9, 10-19, 15-29", [(0, 30)]),
        ("bytes=100-, 0-0", [(0, 1)]),
        ("bytes=100-", []),
        ("bytes=-0", []),
    ],
)
def test_ranges_of_a_file_of_a_hundred_bytes(header: str, found: list[tuple[int, int]]) -> None:
    ranges = byte_ranges(header, 100)
    assert ranges is not None
    assert [(each.begin, each.end) for each in ranges] == found


@pytest.mark.parametrize("header", [None, "lines=0-9", "bytes=9-0", "bytes=a-b", "bytes=-", "bytes=0-9,,"])
def test_headers_that_are_ignored(header: str | None) -> None:
    assert byte_ranges(header, 100) is None


def test_too_many_ranges_are_ignored() -> None:
    assert byte_ranges("bytes=" + ",".join(f"{2 * n}-{2 * n}" for n in range(MOST_RANGES)), 1000) is not None
    assert byte_ranges("bytes=" + ",".join(f"{2 * n}-{2 * n}" for n in range(MOST_RANGES + 1)), 1000) is None


def test_the_header_of_a_range() -> None:
    ranges = byte_ranges("bytes=10-19", 100)
    assert ranges is not None
    assert (ranges[0].size, ranges[0].content_range(100)) == (10, "bytes 10-19/100")
