"""`primray compare` from its arguments to its words, files and exit codes, on pictures with known noise."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.measured import gaussian, save, synthetic

from primray.cli import run

TRUTH = np.ones((48, 64, 3)) * [0.5, 0.4, 0.3]


@pytest.fixture(autouse=True)
def _pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    darker = TRUTH.copy()
    darker[4:20, 40:56] *= 0.8
    for name, truth, samples in (("a", TRUTH, 8192), ("b", TRUTH, 8192), ("darker", darker, 8192), ("noisy", TRUTH, 16)):
        save(synthetic(truth, gaussian, samples, rng, seed=sum(name.encode())), Path(f"{name}.exr"))
    save(synthetic(TRUTH[:40], gaussian, 16, rng), Path("small.exr"))


@pytest.mark.parametrize(
    ("b", "flags", "exit_code", "words"),
    [
        ("b.exr", ["--tolerance", "0.02"], 0, "unchanged: a.exr (A) and b.exr (B), 64 x 48"),
        ("darker.exr", [], 1, "x 32 to 63, y 0 to 31: "),
        ("noisy.exr", [], 6, "x 0 to 31, y 0 to 31: undecided, noise could hide a difference up to "),
        ("noisy.exr", ["--tolerance", "0.01"], 6, "to detect differences of 1 %, A needs "),
        ("noisy.exr", ["--tolerance", "0.9"], 0, "tiles: 4 unchanged"),
        ("noisy.exr", ["--tolerance", "0"], 0, "tiles: 4 unchanged"),
        ("a.exr", [], 0, "the pictures are identical"),
    ],
)
def test_verdicts(b: str, flags: list[str], exit_code: int, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "a.exr", b, *flags]) == exit_code
    assert words in capsys.readouterr().out


def test_the_change_is_told_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    run(["compare", "a.exr", "darker.exr"])
    text = capsys.readouterr().out
    assert "darker by" in text
    assert "tiles: 1 changed" in text


def test_json_and_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "a.exr", "darker.exr", "--json", "--report", "r.json"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    facts = json.loads(line)
    assert facts.pop("type") == "comparison"
    assert facts == json.loads(Path("r.json").read_text())
    assert facts["verdict"] == "changed"
    assert facts["samples_per_pixel"] == {"a": 8192.0, "b": 8192.0}
    assert sum(facts["count"].values()) == len(facts["tiles"]) == 4
    (changed,) = [tile for tile in facts["tiles"] if tile["verdict"] == "changed"]
    assert changed["box"] == [32, 0, 64, 32]
    assert changed["finding"]["relative"] > 0.05


def test_what_is_needed_is_in_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "a.exr", "noisy.exr", "--json"]) == 6
    needs = json.loads(capsys.readouterr().out)["needs"]
    assert needs["factor"] > 1
    assert needs["a_alone"] is None
    assert needs["b_alone"] > 16


def read(path: str) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(path).get_pixels(oiio.FLOAT))


def test_the_difference_picture() -> None:
    """The patch is blue, its tile framed; the rest is neither."""
    run(["compare", "a.exr", "darker.exr", "--difference", "d.png"])
    picture = np.rint(read("d.png") * 255)
    assert picture.shape == (48, 64, 3)
    assert (picture[0, 32:64] == [255, 220, 0]).all()
    patch = picture[6:18, 42:54].reshape(-1, 3).mean(axis=0)
    assert patch[2] > 2 * patch[0]
    rest = picture[34:46, 2:30].reshape(-1, 3).mean(axis=0)
    assert abs(rest[2] - rest[0]) < 30
    assert not (picture[32:, :32] == [255, 220, 0]).all(axis=2).any()


def test_the_difference_as_numbers() -> None:
    run(["compare", "a.exr", "darker.exr", "--difference", "d.exr"])
    values = read("d.exr")
    assert oiio.ImageBuf("d.exr").spec().channelnames == ("R", "G", "B", "z.R", "z.G", "z.B")
    np.testing.assert_allclose(values[..., :3], read("darker.exr")[..., :3] - read("a.exr")[..., :3], atol=1e-7)
    assert values[6:18, 42:54, 3].mean() < -5
    assert abs(values[26:46, 2:30, 3].std() - 1) < 0.3


def test_undecided_tiles_have_corners() -> None:
    run(["compare", "a.exr", "noisy.exr", "--difference", "d.png"])
    picture = np.rint(read("d.png") * 255)
    assert (picture[[0, 0, 31, 32], [0, 31, 0, 32]] == 130).all()


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["a.exr", "none.exr"], "image-missing"),
        (["a.exr", "small.exr"], "image-size"),
        (["a.exr", "b.exr", "--alpha", "2"], "alpha"),
        (["a.exr", "b.exr", "--tolerance", "-1"], "tolerance"),
        (["a.exr", "b.exr", "--tile", "2"], "tile"),
        (["a.exr", "b.exr", "--difference", "d.jpg"], "unknown-extension"),
        (["a.exr", "b.exr", "--difference", "no/d.png"], "output-folder"),
        (["a.exr", "b.exr", "--report", "no/r.json"], "output-folder"),
        (["a.exr", "b.exr", "--difference", "./a.exr"], "output-folder"),
    ],
)
def test_usage(arguments: list[str], code: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {code}: ")
    assert error.count("\n") == 1


def test_a_file_that_cannot_be_written_is_not_told_as_a_change(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert run(["compare", "a.exr", "b.exr", "--difference", "d.png"]) == 2
    assert capsys.readouterr().err.startswith("error: write-failed: ")


def test_a_reader_that_stops_early_leaves_the_verdict() -> None:
    command = [sys.executable, "-c", "from primray.cli import main; main()", "compare", "a.exr", "b.exr", "--tolerance", "0.02"]
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
