"""Contact sheets: each stage in a process of its own, on one page, with what is odd about it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import OpenImageIO as oiio
import pytest
from tests.sanitized import limits_memory

from primray.cli import run
from primray.cli.sheet_pictures import page
from primray.cli.sheet_renders import Outcome

BALL = '#usda 1.0\ndef Sphere "s"\n{\n color3f[] primvars:displayColor = [(1, 0.5, 0)]\n}\n'
HIDDEN = """#usda 1.0
def Sphere "s"
{
}
def Camera "away"
{
    double3 xformOp:translate = (0, 0, -50)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
DARK = """#usda 1.0
def Sphere "s"
{
    color3f[] primvars:displayColor = [(0, 0, 0)]
}
def DistantLight "sun"
{
    float inputs:intensity = 0
}
"""


def sheet(folder: Path, *options: str) -> tuple[int, dict[str, Any], str]:
    out = folder.parent / "sheet.html"
    code = run(["sheet", str(folder), "-o", str(out), "-w", "24", "-p", "2", *options])
    return code, {row["stage"]: row for row in json.loads(out.with_suffix(".json").read_text())}, out.read_text()


@limits_memory
def test_a_folder_on_one_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "assets"
    (folder / "deeper").mkdir(parents=True)
    stages = {
        "ball.usda": BALL,
        "deeper/hidden.usda": HIDDEN,
        "dark.usda": DARK,
        "broken.usda": "no stage",
        "empty.usda": "#usda 1.0\n",
        "gone.usda": '#usda 1.0\ndef "a" (references = @./nowhere.usda@)\n{\n}\n',
        "miss.usda": BALL + 'def "a" (references = @./nowhere.usda@)\n{\n}\n',
    }
    for name, text in stages.items():
        (folder / name).write_text(text)
    (folder / "notes.txt").write_text("no stage")
    code, rows, text = sheet(folder)
    assert code == 1
    assert "7 stages, 2 failed, 4 odd" in capsys.readouterr().out
    assert list(rows) == sorted(stages)
    assert {name: (row["exit_code"], row["marks"]) for name, row in rows.items()} == {
        "ball.usda": (0, []),
        "broken.usda": (3, ["refused"]),
        "dark.usda": (0, ["black"]),
        "deeper/hidden.usda": (0, ["nothing-seen"]),
        "empty.usda": (0, ["nothing-seen"]),
        "gone.usda": (3, ["refused"]),
        "miss.usda": (0, ["missing"]),
    }
    assert "stage-open" in rows["broken.usda"]["message"]
    assert rows["ball.usda"]["peak_rss_bytes"] > 50 * 2**20
    assert text.count("<img") == 5
    assert "camera-automatic" in text


@limits_memory
def test_what_takes_too_long_or_too_much_fails_the_sheet(tmp_path: Path) -> None:
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "ball.usda").write_text(BALL)
    code, rows, text = sheet(folder, "--timeout", "0.01")
    assert (code, rows["ball.usda"]["exit_code"], rows["ball.usda"]["marks"]) == (1, "time", ["time"])
    assert '<figure class="failed"' in text
    code, rows, _ = sheet(folder, "--max-memory", "200M")
    assert (code, rows["ball.usda"]["marks"]) == (1, ["crash"])


def test_roots_only(tmp_path: Path) -> None:
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "ball.usda").write_text(BALL)
    (folder / "shot.usda").write_text('#usda 1.0\ndef "a" (\n payload = @./ball.usda@</s>\n)\n{\n}\n')
    (folder / "broken.usda").write_text("no stage")
    _, rows, _ = sheet(folder, "--roots-only", "--timeout", "0.01")
    assert list(rows) == ["broken.usda", "shot.usda"]


def test_the_page_escapes_what_stages_say() -> None:
    diagnostics = [{"severity": "error", "code": "x", "prim_path": "/a", "message": "<script>x"}]
    outcome = Outcome("<b>.usda", 0, 1.0, 2**20, None, "", ("black",), {"diagnostics": diagnostics})
    text = page("a & b", [outcome])
    assert "<script>x" not in text
    assert "<b>.usda" not in text
    assert "&lt;b&gt;.usda" in text


def test_pictures_have_their_place_before_they_are_decoded(tmp_path: Path) -> None:
    """A page of hundreds of stages would move below whoever scrolls it."""
    shown = oiio.ImageBuf(oiio.ImageSpec(30, 20, 3, "uint8"))
    assert shown.write(str(tmp_path / "a.png"))
    text = page("a", [Outcome('"wide".usda', 0, 1.0, 2**20, str(tmp_path / "a.png"), "", (), {})])
    assert 'width=30 height=20 alt="&quot;wide&quot;.usda"' in text


@limits_memory
def test_further_flags_win_and_are_checked_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "ball.usda").write_text(BALL)
    code, rows, _ = sheet(folder, "--", "--res", "20", "10", "--spp", "4")
    assert (code, rows["ball.usda"]["report"]["settings"]["resolution"]) == (0, [20, 10])
    assert rows["ball.usda"]["report"]["settings"]["spp"] == 4
    monkeypatch.setattr("primray.cli.sheet_renders.run_limited", None)
    for flags in (["--ress", "20", "10"], ["--spp", "many"], ["--engine", "xpu"], ["--res", "4", "4", "-w", "4"]):
        assert run(["sheet", str(folder), "-o", str(tmp_path / "s.html"), "--", *flags]) == 2


@limits_memory
def test_a_page_replaces_no_file_but_a_sheets_beside_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "ball.usda").write_text(BALL)
    for text in ('{"version": 1}', '[{"stage": "a.usda"}]', "[1]", "not json", "\xff"):
        (tmp_path / "sheet.json").write_bytes(text.encode("latin-1"))
        assert run(["sheet", str(folder), "-o", str(tmp_path / "sheet.html")]) == 2
        assert "sheet.json beside it" in capsys.readouterr().err
        assert (tmp_path / "sheet.json").read_bytes() == text.encode("latin-1")
        assert not (tmp_path / "sheet.html").exists()
    (tmp_path / "sheet.json").unlink()
    assert sheet(folder)[0] == 0
    assert sheet(folder)[0] == 0


@pytest.mark.parametrize("arguments", [["no-such-folder"], ["."], [".", "-w", "0"]])
def test_usage(arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if "-w" in arguments:
        (tmp_path / "ball.usda").write_text(BALL)
    assert run(["sheet", *arguments]) == 2


@limits_memory
def test_what_has_not_changed_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "ball.usda").write_text(BALL)
    (folder / "broken.usda").write_text("no stage")
    keep = ["--keep", str(tmp_path / "kept")]
    first = sheet(folder, *keep)
    assert "2 stages, 1 failed, 0 odd, 0 unchanged" in capsys.readouterr().out
    assert sheet(folder, *keep) == first
    assert "2 stages, 1 failed, 0 odd, 2 unchanged" in capsys.readouterr().out
    (folder / "ball.usda").write_text(BALL.replace("0.5", "0.6"))
    text = sheet(folder, *keep)[2]
    assert "1 unchanged" in capsys.readouterr().out
    assert text != first[2]
    assert run(["sheet", str(folder / "ball.usda"), *keep]) == 2


def test_search_by_name(tmp_path: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("skipped: no chromium")
    api = pytest.importorskip("playwright.sync_api")
    names = ["props/Red Chair.usda", "props/table.usda", "sets/red.usda"]
    made = tmp_path / "sheet.html"
    made.write_text(page("3 stages", [Outcome(name, 0, 1.0, 2**20, None, "", (), {}) for name in names]))
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        shown = browser.new_page()
        faults: list[str] = []
        shown.on("pageerror", lambda error: faults.append(str(error)))
        shown.goto(made.as_uri())

        def seen() -> list[str]:
            return [str(each.get_attribute("id")) for each in shown.locator("figure").all() if each.is_visible()]

        assert seen() == names
        for words, found in (("red", [names[0], names[2]]), ("CHAIR props", names[:1]), ("none", []), ("", names)):
            shown.locator("input").fill(words)
            assert seen() == found
            assert shown.locator("output").inner_text() == f"{len(found)} of 3"
        shown.goto(made.as_uri() + "#search=red%20sets")
        shown.reload()
        assert seen() == names[2:]
        browser.close()
        assert not faults
