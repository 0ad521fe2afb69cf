"""Frame lists as usdrecord and husk read them."""

from __future__ import annotations

import pytest

from primray.errors import LimitError, SettingsError
from primray.render.frames import frame_list, names_ends, parse_frames, with_ends


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("1", [1]),
        ("-3", [-3]),
        ("1.5", [1.5]),
        ("1:4", [1, 2, 3, 4]),
        ("4:1", [4, 3, 2, 1]),
        ("1:10x4", [1, 5, 9]),
        ("10:1x-4", [10, 6, 2]),
        ("0:1x0.25", [0, 0.25, 0.5, 0.75, 1]),
        ("0:0.3x0.1", [0, 0.1, 0.2, 0.3]),  # 0.3 / 0.1 is below 3 in binary
        ("1-4", [1, 2, 3, 4]),
        ("1-10x4", [1, 5, 9]),
        ("-3 - -1", [-3, -2, -1]),
        ("4-1,7", [4, 3, 2, 1, 7]),
        ("1-10:4", [1, 5, 9]),
        ("10-1:-4", [10, 6, 2]),
        ("-3--1:2, 7", [-3, -1, 7]),
        ("1001:1008:3", [1001, 1004, 1007]),
        ("10:1:-4, 7", [10, 6, 2, 7]),
        ("1e-1", [0.1]),
        ("1,5", [1, 5]),
        ("1:3, 7", [1, 2, 3, 7]),
    ],
)
def test_frame_lists(text: str, frames: list[float]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["1-100:2", "7", "1-3,9-5:-2", "-10 - -2:4", "0-0"])
def test_range_expressions_are_those_of_open_job_description(text: str) -> None:
    model = pytest.importorskip("openjd.model", reason="skipped: no openjd")
    assert sorted(parse_frames(text)) == sorted(model.IntRangeExpr.from_str(text))


def test_ends_by_name() -> None:
    assert names_ends("1,start:10")
    assert not names_ends("1:10x2")
    assert parse_frames(with_ends("start:endx10, end", 1001, 1025.5)) == [1001, 1011, 1021, 1025.5]
    assert parse_frames(with_ends("start:end:10", 1001, 1025.5)) == [1001, 1011, 1021]
    with pytest.raises(SettingsError, match="'start:end:x' is not a frame list"):
        with_ends("start:end:x", 1, 2)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "1:",
        ":3",
        "1:2:",
        "1:2:0",
        "1:2:3:4",
        "1:5:2x2",
        "1-9:2:2",
        "1-2-3",
        "1-9:0",
        "1-9:2x2",
        "start:end",  # of no stage
        "1-",
        "--1",
        "1x2",
        "1:5x0",
        "1,,2",
        "nan",
        "inf",
        "0:1x1e-9999999",
    ],
)
def test_what_is_no_frame_list(text: str) -> None:
    with pytest.raises(SettingsError, match="not a frame list"):
        parse_frames(text)


@pytest.mark.parametrize("text", ["1:1000000000", "0:1x1e-9", "1:90000,1:90000", "0:1e9x1e-9999"])
def test_too_many_frames(text: str) -> None:
    with pytest.raises(LimitError):
        parse_frames(text)


@pytest.mark.parametrize(
    ("first", "count", "increment", "frames"),
    [
        ("1", 3, None, [1, 2, 3]),
        ("5", 1, 2.0, [5]),
        ("0", 3, 0.25, [0, 0.25, 0.5]),
        ("10", 3, -4.0, [10, 6, 2]),
        ("-1", 2, 1.0, [-1, 0]),
    ],
)
def test_husks_frames(first: str, count: int, increment: float | None, frames: list[float]) -> None:
    assert parse_frames(frame_list(first, count, increment)) == frames


@pytest.mark.parametrize(
    ("first", "count", "increment", "why"),
    [
        ("1:5", 2, None, "a list of frames already"),
        ("1-5", 2, None, "a list of frames already"),
        ("1,5", 2, None, "a list of frames already"),
        ("1", 0, None, "must be above 0"),
        ("1", 2, 0.0, "must be above 0"),
        ("one", 2, None, "not a frame list"),
        ("1", 2, float("nan"), "not a frame list"),
    ],
)
def test_what_is_no_start_count_or_increment(first: str, count: int, increment: float | None, why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        frame_list(first, count, increment)


def test_too_many_frames_by_their_count() -> None:
    with pytest.raises(LimitError):
        frame_list("1", 10**9, None)


@pytest.mark.parametrize("text", ["1:2000000000", "2000000000", "1-2000000000:2", "1:1e99", "1e9999999"])
def test_numbers_beyond_the_largest_are_named(text: str) -> None:
    with pytest.raises(SettingsError, match=r"(2000000000|1e\d+) in .* is beyond 1,000,000,000"):
        parse_frames(text)
