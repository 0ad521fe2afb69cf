"""Sequences and folders: pairs by number or name, what one side lacks, the worst, and the exit codes of all that."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.measured import gaussian, save, synthetic

import primray
from primray import Verdict
from primray.cli import run
from primray.compare.sequences import pairing
from primray.errors import SettingsError
from primray.images.reading import MeasuredImage

TRUTH = np.ones((32, 32, 3)) * [0.5, 0.4, 0.3]
DARKER, MUCH_DARKER = TRUTH * 0.9, TRUTH * 0.5


def picture(truth: np.ndarray, seed: int, samples: int = 65536) -> MeasuredImage:
    return synthetic(truth, gaussian, samples, np.random.default_rng(seed), seed=seed)


@pytest.fixture(autouse=True)
def _sequences(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames 1 to 5 before and 2 to 6 after; of the common ones 3 has changed, and 4 more so."""
    monkeypatch.chdir(tmp_path)
    Path("a").mkdir()
    Path("b").mkdir()
    for frame in range(1, 6):
        save(picture(TRUTH, frame), Path(f"a/shot.{frame:04d}.exr"))
    for frame in range(2, 7):
        truth = {3: DARKER, 4: MUCH_DARKER}.get(frame, TRUTH)
        save(picture(truth, 10 + frame), Path(f"b/new_{frame:02d}.exr"))


def test_frames_are_paired_by_their_numbers_whatever_the_padding() -> None:
    found = primray.compare("a/shot.####.exr", "b/new_%02d.exr", tolerance=0.02)
    assert isinstance(found, primray.SequenceComparison)
    assert [pair.name for pair in found.pairs] == ["2", "3", "4", "5"]
    assert [pair.verdict.value for pair in found.pairs] == ["unchanged", "changed", "changed", "unchanged"]
    assert (found.only_a, found.only_b, found.verdict) == (("1",), ("6",), Verdict.CHANGED)
    assert not found.identical
    same = primray.compare("a/shot.####.exr", "a/shot.####.exr")
    assert (same.identical, same.notes, same.verdict) == (True, (), Verdict.UNCHANGED)
    assert {pair.facts["alpha"] for pair in found.pairs} == {0.001 / 4}  # the pairs share the false alarms
    assert found.worst is not None
    assert found.worst.name == "4"
    with pytest.raises(TypeError, match="no truth value"):
        bool(found)


def test_a_frame_that_is_missing_is_a_change() -> None:
    for frame in (3, 4):
        save(picture(TRUTH, 20 + frame), Path(f"b/new_{frame:02d}.exr"))
    found = primray.compare("a/shot.$F4.exr", "b/new_<F2>.exr", tolerance=0.02)
    assert {pair.verdict for pair in found.pairs} == {Verdict.UNCHANGED}  # type: ignore[union-attr]
    assert found.verdict is Verdict.CHANGED


@pytest.mark.parametrize("kept", ["shot.0007.exr", "shot.00007.exr", "shot.7.exr", "shot.0007.exr.tmp", "shot.x.exr"])
def test_only_files_that_the_name_would_be_given_count(kept: str) -> None:
    Path("c").mkdir()
    (Path("c") / kept).touch()
    if kept == "shot.0007.exr":
        assert pairing("c/shot.####.exr", "c/shot.%04d.exr").pairs[0].name == "7"  # type: ignore[union-attr]
    else:
        with pytest.raises(SettingsError, match="no frames"):
            pairing("c/shot.####.exr", "a/shot.####.exr")


def test_fractions_signs_and_two_places() -> None:
    Path("c").mkdir()
    for name in ("s.-001.exr", "s.012.exr", "h.0001.50.exr", "v2.2.exr", "v2.3.exr"):
        (Path("c") / name).touch()

    def names(text: str) -> list[str]:
        return [pair.name for pair in pairing(text, text).pairs]  # type: ignore[union-attr]

    assert names("c/s.%03d.exr") == ["12"]
    assert names("c/s.%04d.exr") == ["-1"]
    assert names("c/h.####.##.exr") == ["1.5"]
    assert names("c/v%d.%d.exr") == ["2"]


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "a/shot.####.exr", "b/new_##.exr", "--tolerance", "0.02", "--report", "r.json"]) == 1
    text = capsys.readouterr().out
    assert "frame 2: unchanged: " in text
    assert "frame 4: changed: x 0 to 31, y 0 to 31: " in text
    assert "changed: a/shot.####.exr (A) and b/new_##.exr (B), 4 pairs: 2 unchanged, 2 changed" in text
    assert "  1 frame only in A: 1\n  1 frame only in B: 6\n" in text
    assert "  worst: frame 4: x 0 to 31" in text
    facts = json.loads(Path("r.json").read_text())
    assert [pair["verdict"] for pair in facts["pairs"]] == ["unchanged", "changed", "changed", "unchanged"]
    assert run(["compare", "a/shot.####.exr", "b/new_##.exr", "--tolerance", "0.02", "--json"]) == 1
    *pairs, whole = map(json.loads, capsys.readouterr().out.splitlines())
    assert [pair["frame"] for pair in pairs] == ["2", "3", "4", "5"]
    assert (whole["type"], whole["only_a"], whole["only_b"], whole["worst"]["frame"]) == ("comparisons", ["1"], ["6"], "4")


def test_noise_and_failures_have_their_codes(capsys: pytest.CaptureFixture[str]) -> None:
    for frame in range(2, 6):
        save(picture(TRUTH, 30 + frame, 16), Path(f"b/new_{frame:02d}.exr"))
    for path in ("a/shot.0001.exr", "b/new_06.exr"):
        Path(path).unlink()
    assert run(["compare", "a/shot.####.exr", "b/new_##.exr"]) == 6
    assert "undecided" in capsys.readouterr().out
    save(picture(TRUTH[:20], 1), Path("b/new_03.exr"))
    assert run(["compare", "a/shot.####.exr", "b/new_##.exr"]) == 2
    text = capsys.readouterr().out
    assert "frame 3: cannot be compared: image-size: the pictures differ in size" in text
    assert "4 pairs: 3 undecided, 1 cannot be compared" in text


def test_folders_are_paired_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for side, truth in (("x", TRUTH), ("y", DARKER)):
        (Path(side) / "deep").mkdir(parents=True)
        save(picture(truth, len(side + str(truth[0, 0])), 65536), Path(f"{side}/deep/one.exr"))
        np.save(f"{side}/two.npy", TRUTH)
        np.save(f"{side}/only_{side}.npy", TRUTH)
        Path(f"{side}/._two.npy").write_text("no picture")
        Path(f"{side}/notes.txt").write_text("no picture")
    assert run(["compare", "x", "y", "--difference", "d"]) == 1
    text = capsys.readouterr().out
    assert "file deep/one.exr: changed" in text
    assert "file two.npy: unchanged: identical" in text
    assert "1 file only in A: only_x.npy" in text
    assert sorted(path.relative_to("d").as_posix() for path in Path("d").rglob("*.png")) == ["deep/one.exr.png", "two.npy.png"]


def test_differences_of_a_sequence() -> None:
    assert run(["compare", "a/shot.####.exr", "b/new_##.exr", "--difference", "d.####.png"]) == 1
    assert sorted(path.name for path in Path().glob("d.*.png")) == [f"d.{frame:04d}.png" for frame in (2, 3, 4, 5)]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["a", "a/shot.####.exr"], "compare-pairs"),
        (["a", "a/shot.0001.exr"], "compare-pairs"),
        (["a", "b"], "compare-pairs"),
        (["a", "nothere"], "image-missing"),
        (["nothere.exr", "a"], "image-missing"),
        (["a/none.####.exr", "b/new_##.exr"], "image-missing"),
        (["a/shot.####.exr", "b/new_##.exr", "--difference", "d.png"], "frames"),
        (["a", "a", "--difference", "d.png"], "output-folder"),
        (["a", "a", "--alpha", "2"], "alpha"),
    ],
)
def test_usage(arguments: list[str], code: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", *arguments]) == 2
    assert capsys.readouterr().err.startswith(f"error: {code}: ")
