"""Pictures on standard output, and the bits of files: what the command line makes of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import primray
from primray.cli import run

from ..conftest import FakePipeline

SCENE = '#usda 1.0\ndef Sphere "s" {}\n'


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_standard_output_has_the_file_and_nothing_else() -> None:
    Path("s.usda").write_text(SCENE)
    program = "import sys; from primray.cli import main; main()"
    line = [sys.executable, "-c", program, "render", "s.usda", "--spp", "2", "--res", "8", "8", "-o", "-", "-o", "b.exr"]
    done = subprocess.run(line, capture_output=True, check=True)
    Path("a.exr").write_bytes(done.stdout)
    np.testing.assert_array_equal(primray.read_image("a.exr").pixels, primray.read_image("b.exr").pixels)
    assert b"2 samples a pixel" in done.stderr
    metadata = primray.read_image("b.exr").metadata
    assert metadata["stage"] == "s.usda"
    assert metadata["camera.projection"] == "perspective"


@pytest.mark.parametrize(
    ("flags", "code"),
    [
        (["-o", "-", "-o", "png:-"], "standard-output"),
        (["-o", "-", "--json"], "standard-output"),
        (["-o", "gif:-"], "unknown-extension"),
        (["-o", "-", "--stereo"], "stereo-flags"),
        (["-o", "-", "-f", "1:2"], "frames"),
        (["-o", "a.exr", "--bit-depth", "16"], "bit-depth"),
        (["-o", "a.png", "--bit-depth", "32"], "bit-depth"),
        (["-o", "a.png", "--bit-depth", "9"], "bit-depth"),
        (["-o", "a.png", "--half", "R"], "half-output"),
    ],
)
def test_what_cannot_be_is_told_before(
    pipeline: FakePipeline, capsys: pytest.CaptureFixture[str], flags: list[str], code: str
) -> None:
    assert run(["render", "shot.usda", *flags]) == 2
    assert code in capsys.readouterr().err
    assert "render" not in pipeline.calls


def test_bits_and_halves_of_the_command_line(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    flags = ["-o", "a.png", "-o", "a.tif", "-o", "a.hdr", "-o", "a.exr", "--bit-depth", "16", "--half", "R, nothing"]
    assert run(["render", "shot.usda", *flags]) == 0
    assert b"IHDR" in Path("a.png").read_bytes()[:20]
    assert Path("a.png").read_bytes()[24] == 16
    assert "half-channels" in capsys.readouterr().err
    assert all(Path(f"a.{kind}").stat().st_size > 100 for kind in ("tif", "hdr", "exr"))
