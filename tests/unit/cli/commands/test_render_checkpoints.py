"""The flags of checkpoints and ranges: what they lead to, and what is said of their misuse before anything is rendered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from primray.cli import run
from primray.settings import SAMPLE_BLOCK

STAGE = str(Path(__file__).parents[4] / "scenes/features/implicit-shapes/scene.usda")
SMALL = ["render", STAGE, "--res", "16", "8", "--spp", "4", "-o", "o.exr"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def names() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["--checkpoint-every", "5"], "needs --checkpoint FILE"),
        (["--checkpoint", "a.prc", "--checkpoint-every", "0"], "seconds above 0, not 0"),
        (["--checkpoint", "a.prc", "--checkpoint-every", "nan"], "seconds above 0, not nan"),
        (["--checkpoint", "a.prc", "--checkpoint-every", "-1"], "seconds above 0, not -1"),
        (["--checkpoint", "no/a.prc"], "folder no does not exist"),
        (["--checkpoint", "."], "cannot be written"),
        (["--checkpoint", "old.prc"], "the checkpoint exists already: resume it, or remove it"),
        (["--checkpoint", "o.exr"], "named twice"),
        (["--checkpoint", "a.prc", "-f", "1:2", "-o", "o.#.exr"], "frame number in the file's name"),
        (["--resume", "missing.prc"], "there is no such checkpoint"),
        (["--resume", "old.prc"], "damaged"),
        (["--resume", "missing.prc", "--checkpoint", "a.prc"], "there is no such checkpoint"),
        (["--resume", "missing.#.prc", "-f", "1:2", "-o", "o.#.exr"], "there is no such checkpoint"),
        (["--sample-range", "0-4"], f"in multiples of {SAMPLE_BLOCK}"),
        (["--sample-range", "4"], "not a range of samples"),
        (["--sample-range", "-2:4"], "not a range of samples"),
        (["--sample-range", "0:99999999999999"], "not a range of samples"),
        (["--sample-range", "0:4"], "combined with spp"),  # SMALL has --spp
    ],
)
def test_misuse(flags: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("old.prc").write_text("some file of the user's")
    arguments = [*SMALL, *flags]
    if "-f" in flags:
        arguments = [a for a in arguments if a not in ("-o", "o.exr")]
        arguments = [a for a in arguments if a != "o.#.exr"] + ["-o", "o.#.exr"]
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert says in error
    assert "Traceback" not in error
    assert names() == ["old.prc"]
    assert Path("old.prc").read_text() == "some file of the user's"


@pytest.mark.parametrize(
    ("text", "code"), [("0:3", 2), ("1:4", 2), ("4:4", 2), ("6:4", 2), ("0:0", 2), ("0:99999998", 4), ("0:4", 0)]
)
def test_ranges_are_of_blocks(text: str, code: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", STAGE, "--res", "16", "8", "-o", "o.exr", "--sample-range", text]) == code
    if code == 2:
        assert f"sample block, which is {SAMPLE_BLOCK}" in capsys.readouterr().err


@pytest.mark.parametrize("flags", [["--spp", "4"], ["--target-error", "1"], ["--time-limit", "1"], ["--adaptive"]])
def test_a_range_goes_with_no_other_rule(flags: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", STAGE, "-o", "o.exr", "--sample-range", "0:4", *flags]) == 2
    assert (
        "a sample range cannot be combined with spp, a target error, a time limit or adaptive sampling"
        in capsys.readouterr().err
    )


def test_resuming_goes_on_with_the_same_file_unless_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*SMALL, "--checkpoint", "a.prc"]) == 0
    first = Path("a.prc").read_bytes()
    more = [*SMALL, "--spp", "8"]
    assert run([*more, "--resume", "a.prc", "--checkpoint", "b.prc"]) == 0
    assert Path("a.prc").read_bytes() == first
    assert run([*more, "--resume", "a.prc"]) == 0
    assert Path("a.prc").read_bytes() != first
    assert run([*more, "--resume", "a.prc", "--checkpoint", "a.prc"]) == 0
    assert run([*more, "--resume", "a.prc", "--checkpoint", "b.prc"]) == 2
    assert "the checkpoint exists already" in capsys.readouterr().err
    assert names() == ["a.prc", "b.prc", "o.exr"]


def test_frames_have_checkpoints_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    frames = ["render", STAGE, "--res", "16", "8", "--spp", "4", "-o", "o.#.exr"]
    assert run([*frames, "-f", "1:2", "--checkpoint", "c.#.prc"]) == 0
    assert names() == ["c.1.prc", "c.2.prc", "o.1.exr", "o.2.exr"]
    # Frames that have none yet begin.
    capsys.readouterr()
    assert run([*frames, "-f", "1:3", "--resume", "c.#.prc"]) == 0
    assert "no checkpoint found, rendering from the first sample: c.3.prc\n" in capsys.readouterr().err
    assert names() == ["c.1.prc", "c.2.prc", "c.3.prc", "o.1.exr", "o.2.exr", "o.3.exr"]


def test_a_checkpoint_that_cannot_be_written_is_an_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import os

    def full(number: int) -> Any:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert run([*SMALL, "--checkpoint", "a.prc"]) == 1
    assert "checkpoint-unwritten" in capsys.readouterr().err
    assert names() == ["o.exr"]
