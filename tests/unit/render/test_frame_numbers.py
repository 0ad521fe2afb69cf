"""Frame lists as usdrecord reads them, and the frame's place in names."""

from __future__ import annotations

import pytest

from primray.errors import LimitError, SettingsError
from primray.render.frame_numbers import check_names, name_of_frame, parse_frames


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
        ("1e-1", [0.1]),
        ("1,5", [1, 5]),
        ("1:3, 7", [1, 2, 3, 7]),
    ],
)
def test_frame_lists(text: str, frames: list[float]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "1:",
        ":3",
        "1:2:3",
        "1-2-3",
        "1-",
        "--1",
        "1x2",
        "1:5x0",
        "1,,2",
        "nan",
        "inf",
        "1:1e99",
        "1e9999999",
        "0:1x1e-9999999",
    ],
)
def test_what_is_no_frame_list(text: str) -> None:
    with pytest.raises(SettingsError, match="no frame list"):
        parse_frames(text)


@pytest.mark.parametrize("text", ["1:1000000000", "0:1x1e-9", "1:90000,1:90000", "0:1e9x1e-9999"])
def test_too_many_frames(text: str) -> None:
    with pytest.raises(LimitError):
        parse_frames(text)


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("a.####.exr", 7, "a.0007.exr"),
        ("a.####.exr", -7, "a.-007.exr"),
        ("a.#.exr", 123, "a.123.exr"),
        ("a.###.##.exr", 1.5, "a.001.50.exr"),
        ("a.%04d.exr", 7, "a.0007.exr"),
        ("a.%d.exr", 7, "a.7.exr"),
        ("a.$F4.exr", 7, "a.0007.exr"),
        ("a.$F.exr", 7, "a.7.exr"),
        ("a.<F4>.exr", 7, "a.0007.exr"),
        ("a.exr", 7, "a.exr"),
    ],
)
def test_names(name: str, frame: float, expected: str) -> None:
    assert name_of_frame(name, frame) == expected


def test_fractional_frames_need_decimals() -> None:
    with pytest.raises(SettingsError, match="decimals"):
        name_of_frame("a.####.exr", 1.5)


def test_names_are_checked_against_the_frames() -> None:
    check_names(["a.exr"], None)
    check_names(["a.exr"], [1.0])
    check_names(["a.####.exr", "a.####.png"], [1.0, 2.0])
    for names, frames in [
        (["a.exr"], [1.0, 2.0]),
        (["a.####.exr"], None),
        (["a.exr", "a.exr"], None),
        (["a.#.#.exr"], [0.04, 0.01]),
    ]:
        with pytest.raises(SettingsError):
            check_names(names, frames)
