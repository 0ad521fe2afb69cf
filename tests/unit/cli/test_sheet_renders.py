"""The sheet of one shot: frames, cameras and variants in one labelled picture, failures with their reasons."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.sanitized import limits_memory

from primray.cli import run, sheet_pictures, sheet_renders
from primray.cli.sheet_pictures import _fits, _lines, contact_sheet, reason
from primray.cli.sheet_renders import Ended, Limits, Outcome, grid_of, render_cells, variant_choices
from primray.errors import SettingsError
from primray.images.image import write_text

STAGE = """#usda 1.0
def Xform "Asset" (
    variants = {
        string look = "red"
    }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "blue" {
            over "ball"
            {
                color3f[] primvars:displayColor = [(0, 0, 1)]
            }
        }
        "red" {
            over "ball"
            {
                color3f[] primvars:displayColor = [(1, 0, 0)]
            }
        }
    }
    def Sphere "ball"
    {
        double radius.timeSamples = { 1: 0.5, 2: 2 }
    }
}
def Camera "near"
{
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "far"
{
    double3 xformOp:translate = (0, 0, 90)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def labels(grid: sheet_renders.Grid) -> list[list[str]]:
    return [[cell.label for cell in group] for group in grid.groups]


def test_frames_go_along_rows_and_cameras_and_variants_below() -> None:
    grid = grid_of([1, 2.5], ["/a/cam", "/b/side"], variant_choices(["/A:look=red,blue"]), None)
    assert grid.columns == 2
    assert labels(grid) == [
        ["frame 1, cam, look=red", "frame 2.5, cam, look=red"],
        ["frame 1, side, look=red", "frame 2.5, side, look=red"],
        ["frame 1, cam, look=blue", "frame 2.5, cam, look=blue"],
        ["frame 1, side, look=blue", "frame 2.5, side, look=blue"],
    ]
    assert labels(grid_of(None, ["/a/cam", "/b/cam"], [["/A:l=x"], ["/B:m=y", "/B:m=z"]], None)) == [
        ["/a/cam, l=x, m=y", "/b/cam, l=x, m=y"],
        ["/a/cam, l=x, m=z", "/b/cam, l=x, m=z"],
    ]


def test_one_thing_that_varies_makes_about_a_square() -> None:
    for count, columns in ((1, 1), (2, 2), (4, 2), (5, 3), (10, 4)):
        grid = grid_of(range(count), [], [], None)
        assert (len(grid.groups), grid.columns) == (1, columns)
    assert grid_of(None, [], variant_choices(["/A:l=a,b,c,d"]), None).columns == 2
    assert grid_of(range(10), [], [], 5).columns == 5
    assert labels(grid_of(None, [], [], None)) == [["default time"]]
    with pytest.raises(SettingsError, match="3000 pictures"):
        grid_of(range(3000), [], [], None)


@pytest.mark.parametrize("text", ["/A", "/A:look", "/A=red", "/A:look=", "/A:look=,"])
def test_texts_that_name_no_variants(text: str) -> None:
    with pytest.raises(SettingsError, match="is not a list of variants"):
        variant_choices([text])


def read(path: Path) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


@limits_memory
def test_a_shot_in_one_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The ball is larger in frame 2, smaller from afar, blue in the second half; a camera that is not there says so."""
    (tmp_path / "shot.usda").write_text(STAGE)
    out = tmp_path / "sheet.png"
    asked = ["--frames", "1:2", "--camera", "near", "--camera", "far", "--camera", "none", "--variants", "/Asset:look=red,blue"]
    assert run(["sheet", str(tmp_path / "shot.usda"), "-o", str(out), "-w", "100", "-p", "2", *asked]) == 1
    said = capsys.readouterr()
    assert "12 pictures, 4 failed" in said.out
    assert said.err.count("failed: ") == 4
    assert "There is no camera none" in said.err
    sheet = read(out)
    top, gap = sheet_pictures._TITLE, sheet_pictures._GAP
    height = (sheet.shape[0] - top - gap) // 6
    cells = {
        (row, column): sheet[top + row * height :, gap + column * (100 + gap) :][: height - 30 - sheet_pictures._LINE, :100]
        for row in range(6)
        for column in range(2)
    }
    red, blue = (
        {key: int((cell[..., a] > 2 * cell[..., b]).sum()) for key, cell in cells.items()} for a, b in ((0, 2), (2, 0))
    )
    assert 10 * red[0, 0] < red[0, 1]  # frames
    assert 10 * red[1, 1] < red[0, 1]  # cameras
    assert (blue[0, 1], red[3, 1]) == (0, 0)  # variants
    assert blue[3, 1] == pytest.approx(red[0, 1], rel=0.05)
    for row in (2, 5):
        np.testing.assert_allclose(cells[row, 0][-1, -1], sheet_pictures._FAILED, atol=1 / 255)
        assert cells[row, 0].max() > 0.8  # words


@limits_memory
def test_a_page_of_a_shot_and_further_flags(tmp_path: Path) -> None:
    (tmp_path / "shot.usda").write_text(STAGE)
    out = tmp_path / "sheet.html"
    flags = ["--camera", "near", "-w", "24", "-p", "2", "--", "--studio-light", "off"]
    assert run(["sheet", str(tmp_path / "shot.usda"), "-o", str(out), *flags]) == 0
    (row,) = json.loads(out.with_suffix(".json").read_text())
    assert (row["stage"], row["exit_code"], row["marks"]) == ("near", 0, ["black"])


def fake_runs(monkeypatch: pytest.MonkeyPatch, missing: str, exit_code: int) -> list[list[str]]:
    """Have processes make all pictures but one frame's, and say that they failed; return the frames that each was asked for."""
    asked: list[list[str]] = []

    def run_limited(command: list[str], timeout_s: float, stderr: Path) -> Ended:
        frames = command[command.index("--frames") + 1].split(",")
        asked.append(frames)
        for frame in frames:
            if frame != missing:
                for output in (command[k + 1] for k, word in enumerate(command) if word == "-o"):
                    buffer = oiio.ImageBuf(oiio.ImageSpec(8, 6, 4, "float"))
                    oiio.ImageBufAlgo.fill(buffer, (0.1, 0.2, 0.3, 1.0))
                    assert buffer.write(output.replace("%g", frame), "half" if output.endswith("exr") else "uint8")
        return Ended(exit_code, 1.0, 1, f"error: broken: frame {missing}\n")

    monkeypatch.setattr(sheet_renders, "run_limited", run_limited)
    return asked


@pytest.mark.parametrize(("exit_code", "at_once"), [(1, 1), (3, 1), (-9, 1), (1, 2)])
def test_frames_that_a_process_leaves_missing_are_tried_alone(
    exit_code: int, at_once: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = fake_runs(monkeypatch, "2", exit_code)
    grid = grid_of([1, 2, 3, 4], [], [], None)
    found = render_cells(Path("a.usda"), grid, Limits(8, 1, 1, 2**34, None), at_once, tmp_path, lambda outcome: None)
    assert sorted(asked) == sorted([*([["1", "2"], ["3", "4"]] if at_once == 2 else [["1", "2", "3", "4"]]), ["2"]])
    assert [outcome.exit_code for outcome in found] == [0, exit_code, 0, 0]
    assert [outcome.marks for outcome in found][::2] == [("one-colour",), ("one-colour",)]
    assert reason(found[1]) == "broken: frame 2"


def outcome(exit_code: int | str, message: str) -> Outcome:
    return Outcome("frame 1", exit_code, 1.0, 1, None, message, ())


@pytest.mark.parametrize(
    ("exit_code", "message", "says"),
    [
        ("time", "", "stopped by the time limit"),
        (3, "warning: x\nerror: stage-open: it cannot be opened\n", "stage-open: it cannot be opened"),
        (-11, "", "ended with -11"),
        (1, "Traceback\nMemoryError", "MemoryError"),
    ],
)
def test_reasons(exit_code: int | str, message: str, says: str) -> None:
    assert reason(outcome(exit_code, message)) == says


def test_long_words_stay_in_their_cells() -> None:
    one = outcome(3, "error: x: " + "word " * 200)
    sheet = contact_sheet("a" * 500, [[one], [one]], 1, 120)
    assert sheet.shape[1] == 120 + 2 * sheet_pictures._GAP
    assert (sheet[:, -sheet_pictures._GAP :] == round(sheet_pictures._SHEET * 255)).all()


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["none.usda"], "sheet"),
        ([".", "--frames", "1:2"], "sheet"),
        ([".", "--camera", "a"], "sheet"),
        (["shot.usda", "--roots-only"], "sheet"),
        (["shot.usda", "-o", "sheet.gif"], "unknown-extension"),
        (["shot.usda", "--variants", "red"], "variant"),
        (["shot.usda", "--columns", "0"], "settings-error"),
        (["shot.usda", "-o", "no/sheet.png"], "output-folder"),
    ],
)
def test_usage(
    arguments: list[str], code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("shot.usda").write_text(STAGE)
    assert run(["sheet", *arguments]) == 2
    said: Any = capsys.readouterr().err
    assert said.startswith(f"error: {code}: ")


def test_labels_keep_what_tells_pictures_apart() -> None:
    labels = [
        f"frame 1001, {camera}, {look}"
        for camera in ("camera_of_the_left_eye", "camera_of_the_right_eye")
        for look in ("a", "b")
    ]
    shown = [_lines(Outcome(label, 0, 1.0, 0, None, "", ()), 96) for label in labels]
    assert len(set(map(tuple, shown))) == 4
    assert shown[0][0] == "frame 1001"
    assert shown[0][1].startswith("...")
    assert shown[0][1].endswith("left_eye")
    assert all(_fits(line, 96, 13) for lines in shown for line in lines)
    assert _lines(Outcome("frame 1, cam", 0, 1.0, 0, None, "", ()), 256) == ["frame 1, cam"]


def test_a_page_names_files_that_are_no_text(tmp_path: Path) -> None:
    outcome = Outcome("s\udcff.usda", 2, 0.1, 5, None, "error: not-utf8: [s\udcff.usda]", ("refused",))
    write_text(tmp_path / "sheet.html", sheet_pictures.page("1 stage", [outcome]))
    assert 'id="s\\udcff.usda"' in (tmp_path / "sheet.html").read_text(encoding="utf-8")
