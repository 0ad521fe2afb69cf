"""Values of options that are written as text."""

from __future__ import annotations

import pytest

from primray.cli.option_values import (
    ColorCorrection,
    Complexity,
    aovs_of,
    bytes_of,
    dicing_rate_of,
    frames_of,
    mask_of,
    purposes_of,
    render_settings_of,
    threads_of,
    time_codes_of,
    view_of,
)
from primray.color.ocio import check_view
from primray.errors import SettingsError
from primray.render.frames import parse_frames
from primray.settings import DEFAULT_DICING_RATE


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4G", 4 * 2**30),
        ("500M", 500 * 2**20),
        ("1.5GiB", 3 * 2**29),
        ("2048k", 2**21),
        ("1048576", 2**20),
        ("1TB", 2**40),
        (None, None),
    ],
)
def test_amounts_of_memory(text: str | None, expected: int | None) -> None:
    assert bytes_of(text) == expected


@pytest.mark.parametrize("text", ["", "G", "-1G", "4 GG", "1e3", "4X", "4", "1048575", "2k"])
def test_what_is_no_amount(text: str) -> None:
    with pytest.raises(SettingsError, match="4G"):
        bytes_of(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("default, render", ("default", "render")),
        ("render,proxy", ("default", "render", "proxy")),
        ("render proxy", ("default", "render", "proxy")),
        ("geometry,render", ("default", "render")),
        ("proxy,default", ("proxy", "default")),
        ("", ("default",)),
        (None, None),
    ],
)
def test_purposes(text: str | None, expected: tuple[str, ...] | None) -> None:
    assert purposes_of(text) == expected


def test_masks_by_commas_and_spaces() -> None:
    assert mask_of(["/a,/b /c", "/d"]) == ("/a", "/b", "/c", "/d")
    assert mask_of(None) is None


@pytest.mark.parametrize(("complexity", "rate"), [("low", 16.0), ("medium", 8.0), ("high", 4.0), ("veryhigh", 2.0)])
def test_complexities(complexity: str, rate: float) -> None:
    assert dicing_rate_of(DEFAULT_DICING_RATE, Complexity(complexity)) == rate
    assert dicing_rate_of(3.0, None) == 3.0
    with pytest.raises(SettingsError, match="give one"):
        dicing_rate_of(3.0, Complexity(complexity))


@pytest.mark.parametrize(("mode", "view"), [("disabled", "Raw"), ("sRGB", "Un-tone-mapped"), ("openColorIO", None)])
def test_color_corrections(mode: str, view: str | None) -> None:
    assert view_of(None, ColorCorrection(mode)) == view
    check_view(view)  # there is one
    assert view_of("Raw", None) == "Raw"
    with pytest.raises(SettingsError, match="give one"):
        view_of("Raw", ColorCorrection(mode))


def test_threads_as_husk_counts_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.report.report.usable_threads", lambda: 8)
    assert [threads_of(n) for n in (None, 3, 0, -1, -20)] == [None, 3, None, 7, 1]


def test_render_settings_by_name() -> None:
    assert [render_settings_of(text) for text in (None, "/a/b", "rs")] == [None, "/a/b", "/Render/rs"]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((None, None, None, False), None),
        ((None, None, None, True), None),
        (("1:5", None, None, False), "1:5"),
        (("7", 1, None, False), "7"),
        ((None, 3, None, False), "1:3x1"),
        (("1001", 10, 2.0, False), "1001:1019x2"),
    ],
)
def test_frames(given: tuple[str | None, int | None, float | None, bool], expected: str | None) -> None:
    text = frames_of(*given, None, None)
    assert (None if text is None else parse_frames(text)) == (None if expected is None else parse_frames(expected))


def test_frames_that_lists_name_twice_are_rendered_once() -> None:
    assert time_codes_of("1-3,2,4,1") == [1, 2, 3, 4]
    assert time_codes_of(None) is None


def test_the_default_time_and_frames_contradict() -> None:
    with pytest.raises(SettingsError, match="cannot be combined"):
        frames_of("1", None, None, True, None, None)


def test_outputs_are_parted_by_commas_but_for_those_within_light_path_expressions() -> None:
    texts = ["depth, C.{1,3}L,C.*<L.'key, fill'>", "C<RD>L,normal"]
    assert aovs_of(texts) == ("depth", "C.{1,3}L", "C.*<L.'key, fill'>", "C<RD>L", "normal")
