"""Numeric options name the value that they refuse and the form that they take; a size may be one word."""

from __future__ import annotations

import shlex

import pytest

from primray.cli import run
from primray.cli.foreign_command_lines import translate_foreign_flags
from primray.cli.quick import render_arguments
from primray.errors import SettingsError


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["--spp", "64k"], "'64k' is not a whole number: write it without a unit, such as 64000"),
        (["--time-limit", "30s"], "'30s' is not a number: write it without a unit, such as 30"),
        (["--target-error", "1%"], "'1%' is not a number: write it without a unit, such as 0.01"),
        (["--threads", "many"], "'many' is not a whole number"),
        (["--region", "0", "0", "x", "1"], "'x' is not a number; expected 4 numbers: LEFT BOTTOM RIGHT TOP"),
        (["--res", "abc", "200"], "'abc' is not a whole number; expected 2 numbers: W H"),
        (["--res", "320", "2.5"], "'2.5' is not a whole number"),
        (["--res", "320"], "such as 320 200 or 320x200"),
        (["--res=320"], "such as 320 200 or 320x200"),
        (["--res", "32y20", "--verbose"], "not 32y20"),
    ],
)
def test_a_value_that_is_no_number_is_named(capsys: pytest.CaptureFixture[str], flags: list[str], sentence: str) -> None:
    assert run(["render", "nosuch.usda", *flags]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert sentence in said
    assert flags[0].partition("=")[0] in said


def test_commands_of_other_packages_name_values_too(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("primray_service")
    assert run(["view", "nosuch.usda", "--port", "99999"]) == 2
    assert "'99999'" in capsys.readouterr().err
    assert run(["serve", "--port", "x"]) == 2
    assert "'x' is not a whole number" in capsys.readouterr().err


@pytest.mark.parametrize("size", ["320x200", "320X200", "320,200", "320\u00d7200"])
def test_a_size_may_be_one_word(size: str) -> None:
    apart = ["render", "a.usda", "--res", "320", "200", "-o", "a.exr"]
    assert translate_foreign_flags(["render", "a.usda", "--res", size, "-o", "a.exr"]) == apart
    assert translate_foreign_flags(["render", "a.usda", f"--res={size}", "-o", "a.exr"]) == apart
    assert translate_foreign_flags(["sheet", "a.usda", "-r", size]) == ["sheet", "a.usda", "-r", "320", "200"]
    plain = render_arguments(apart)
    assert plain is not None
    assert plain["resolution"] == (320, 200)
    assert translate_foreign_flags(["render", "--", "--res", size]) == ["render", "--", "--res", size]


def test_usdrecords_renderer_is_still_known() -> None:
    with pytest.raises(SettingsError, match="renderer"):
        translate_foreign_flags(["render", "a.usda", "-r", "Embree"])


@pytest.mark.parametrize("name", ["model.usdz", "a b.USDA", "car.glb"])
def test_a_file_in_place_of_a_command_names_render(capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert run([name]) == 2
    said = capsys.readouterr().err
    assert "not a command" in said
    assert f"primray render {shlex.quote(name)}" in said
    assert run(["modle"]) == 2
    assert "No such command" in capsys.readouterr().err
