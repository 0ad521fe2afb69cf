"""Names that are too long for the file system, and the longest that they do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import primray
from primray.cli import run
from primray.images.image import Image
from primray.images.output_path import name_beside

LONG = "n" * 300
LONGEST = "ö" * 125  # 250 bytes, and an extension of four


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.usda").write_text('#usda 1.0\ndef Sphere "s" {}\n')


@pytest.mark.parametrize(
    "asked",
    [
        ["-o", f"{LONG}.exr"],
        ["-o", f"{LONG}/a.exr"],
        ["-o", f"{LONG}/a.exr", "--make-output-path"],
        ["-o", "a.exr", "--report", f"{LONG}.json"],
        ["-o", "a.exr", "--checkpoint", f"{LONG}.prc"],
        ["--all-products", "--output-dir", LONG],
    ],
)
def test_a_name_that_is_too_long_is_refused_before_rendering(asked: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "s.usda", "--res", "8", "6", "--spp", "2", *asked]) == 2
    said = capsys.readouterr().err
    assert "name-too-long" in said
    assert "too long for the file system" in said
    assert [path.name for path in Path().iterdir()] == ["s.usda"]


@pytest.mark.parametrize("command", [["render", f"{LONG}.usda"], ["compare", f"{LONG}.exr", "a.exr"]])
def test_an_input_of_such_a_name_is_no_defect(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command) in (2, 3)
    assert "defect" not in capsys.readouterr().err


def test_the_longest_names_are_written() -> None:
    asked = ["-o", f"{LONGEST}.exr", "-o", f"{LONGEST}.png", "--checkpoint", f"{LONGEST}.prc", "--report", f"{LONGEST}.txt"]
    assert run(["render", "s.usda", "--res", "8", "6", "--spp", "2", *asked]) == 0
    ends = sorted(path.suffix for path in Path().iterdir() if path.stem == LONGEST)
    assert ends == [".exr", ".png", ".prc", ".txt"]
    with pytest.raises(primray.PrimrayError, match="too long for the file system") as error:
        Image(np.zeros((2, 2, 4), np.float32)).save(f"{LONG}.exr")
    assert error.value.code == "name-too-long"


def test_names_beside_tell_long_names_apart() -> None:
    first, second = (name_beside("x" * 240 + end) for end in ("1.prc", "2.prc"))
    assert first != second
    assert max(len(first), len(second)) <= 200
    assert name_beside("a.prc") == "a.prc"
