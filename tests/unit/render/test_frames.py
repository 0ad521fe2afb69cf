"""The frame's place in the names of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from primray.errors import SettingsError
from primray.render.frames import check_names, default_name, frame_name, name_of_frame


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("a.####.exr", 7, "a.0007.exr"),
        ("a.####.exr", -7, "a.-007.exr"),
        ("a.#.exr", 123, "a.123.exr"),
        ("a.###.##.exr", 1.5, "a.001.50.exr"),
        ("a.%04d.exr", 7, "a.0007.exr"),
        ("a.%d.exr", 7, "a.7.exr"),
        ("a.%g.exr", 7, "a.7.exr"),
        ("a.%g.exr", 7.25, "a.7.25.exr"),
        ("a.$F4.exr", 7, "a.0007.exr"),
        ("a.$F.exr", 7, "a.7.exr"),
        ("a.$FF.exr", 7.5, "a.7.5.exr"),
        ("a.$FF.exr", 7, "a.7.exr"),
        ("a.<F4>.exr", 7, "a.0007.exr"),
        ("a.<F>.exr", 7, "a.7.exr"),
        ("a.<FF>.exr", 0.1, "a.0.1.exr"),
        ("a.exr", 7, "a.exr"),
        ("take#2/a.#.exr", 7, "take#2/a.7.exr"),
        ("/x.%d/$F4/<F>/a.##.exr", 7, "/x.%d/$F4/<F>/a.07.exr"),
        ("a.####.exr", None, "a.####.exr"),
    ],
)
def test_names(name: str, frame: float | None, expected: str) -> None:
    assert name_of_frame(name, frame) == expected


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("f/a.exr", None, "f/a.exr"),
        ("f/a.exr", 7, "f/a.0007.exr"),
        ("a.exr", -7, "a.-007.exr"),
        ("a.exr", 1.5, "a.1.5.exr"),
        ("a.$F2.exr", 7, "a.07.exr"),
        ("a.0007.exr", 7, "a.0007.exr"),
        ("a_0007.exr", 7, "a_0007.exr"),
        ("a_7.exr", 7, "a_7.0007.exr"),  # a number of something else, such as of the second product of one name
        ("a.0007.exr", 8, "a.0007.0008.exr"),
        ("a7.exr", 7, "a7.0007.exr"),
        ("a.0000.exr", 0, "a.0000.exr"),
        ("a.17.exr", 7, "a.17.0007.exr"),
    ],
)
def test_a_name_without_a_place_gets_the_number_before_its_extension(name: str, frame: float | None, expected: str) -> None:
    assert frame_name(name).numbered(frame) == expected


def test_only_a_files_own_name_has_holders() -> None:
    assert frame_name("a.#.exr").has_holder
    assert not frame_name("take#2/a.exr").has_holder


def test_what_is_named_after_a_stage_is_literal() -> None:
    assert default_name("shot#1", many=False).of(7) == "shot#1.exr"
    assert default_name("shot#1", many=True).of(7) == "shot#1.0007.exr"


def test_fractional_frames_need_decimals() -> None:
    with pytest.raises(SettingsError, match="decimals"):
        name_of_frame("a.####.exr", 1.5)


@pytest.mark.parametrize(
    ("names", "frames"),
    [
        (["a.exr"], None),
        (["a.exr"], [1.0]),
        (["a.####.exr"], None),  # no frames: a name like any other
        (["$N.exr"], None),
        (["a.####.exr", "a.####.png"], [1.0, 2.0]),
        (["a.$NAME.#.exr"], [1.0, 2.0]),
        (["a.$FF.exr"], [1.0, 1.5]),
    ],
)
def test_names_that_go_with_frames(names: list[str], frames: list[float] | None) -> None:
    check_names([frame_name(name) for name in names], frames)


@pytest.mark.parametrize(
    ("names", "frames", "why"),
    [
        (["a.exr"], [1.0, 2.0], "need a placeholder for the frame number"),
        (["take#2/a.exr"], [1.0, 2.0], "need a placeholder for the frame number"),
        (["a.exr", "a.exr"], None, "twice"),
        (["a.exr", "./a.exr"], None, "twice"),
        (["a.exr", "b/../a.exr"], [1.0], "twice"),
        (["a.####.exr", "a.0002.exr"], [2.0], "twice"),
        (["a.####.exr", "a.%04d.exr"], [1.0, 2.0], "twice"),
        (["a.#.#.exr"], [0.04, 0.01], "same name"),
        (["a.$N.exr"], [1.0], "index in the sequence"),
        (["a.<N4>.exr"], [1.0], "index in the sequence"),
    ],
)
def test_names_that_do_not(names: list[str], frames: list[float] | None, why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        check_names([frame_name(name) for name in names], frames)


def test_a_link_does_not_hide_that_an_output_is_named_twice(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path)
    names = [frame_name(str(tmp_path / name)) for name in ("a.exr", "link/a.exr")]
    with pytest.raises(SettingsError, match="twice") as error:
        check_names(names, None)
    assert (error.value.code, error.value.where) == ("output-name", str(names[1]))
