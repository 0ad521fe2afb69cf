"""Outcomes that are kept: what is rendered again is what any of its files, the settings or the version changed."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import pytest
from tests.sanitized import limits_memory

from primray.cli import kept_outcomes
from primray.cli.kept_outcomes import KeptOutcomes
from primray.cli.sheet_renders import Ended, Limits, Outcome

LIMITS = Limits(width=8, spp=1, timeout_s=60, memory_bytes=2**35, threads=1)
PARTS = {
    "shot.usda": '#usda 1.0\ndef "a" (references = @./ball.usda@</s>)\n{\n}\ndef "b" (references = @./late.usda@</s>)\n{\n}\n',
    "ball.usda": '#usda 1.0\ndef Sphere "s"\n{\n custom asset file = @./t.png@\n}\n',
    "t.png": "no picture",
    "other.usda": '#usda 1.0\ndef Sphere "s"\n{\n}\n',
    "sky.exr": "no sky",
}


class Sheets:
    """Sheets of a folder whose renders are counted."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.kept, self.exit_code = folder / "lib", folder / "kept", 0
        self.folder.mkdir()
        self.rendered: list[str] = []
        self._count = 0
        for name, text in PARTS.items():
            (self.folder / name).write_text(text)

    def _render(self, folder: Path, stage: Path, limits: Limits, scratch: Path) -> Outcome:
        self.rendered.append(stage.name)
        (scratch / "p.png").write_bytes(b"picture of " + stage.read_bytes())
        return Outcome(stage.name, self.exit_code, 1.0, 5, str(scratch / "p.png"), "", ("black",), {"diagnostics": []})

    def sheet(self, tmp_path: Path, limits: Limits = LIMITS) -> list[str]:
        """Return the names of the stages that a new sheet renders."""
        self._count += 1
        self.rendered = []
        kept = KeptOutcomes(self.kept, self._render)
        for name in ("shot.usda", "other.usda"):
            outcome = kept.render(self.folder, self.folder / name, limits, tmp_path / f"scratch-{self._count}-{name}")
            assert (outcome.stage, outcome.marks, outcome.report) == (name, ("black",), {"diagnostics": []})
            assert Path(str(outcome.picture)).read_bytes() == b"picture of " + (self.folder / name).read_bytes()
        assert kept.found == 2 - len(self.rendered)
        return self.rendered


@pytest.fixture
def sheets(tmp_path: Path) -> Sheets:
    return Sheets(tmp_path)


@limits_memory
def test_what_cannot_be_kept_is_rendered_again(sheets: Sheets, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: str, target: str) -> None:
        Path(target).write_bytes(b"part")
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("shutil.copyfile", full)
        kept = KeptOutcomes(sheets.kept, sheets._render)
        outcome = kept.render(sheets.folder, sheets.folder / "other.usda", LIMITS, tmp_path / "scratch")
    assert outcome.picture is not None
    assert kept.problem is not None
    assert kept.problem.code == "write-failed"
    assert list(sheets.kept.iterdir()) == []
    assert sheets.sheet(tmp_path) == ["shot.usda", "other.usda"]


@limits_memory
def test_only_what_has_changed_is_rendered_again(sheets: Sheets, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    both = ["shot.usda", "other.usda"]
    assert sheets.sheet(tmp_path) == both
    assert sheets.sheet(tmp_path) == []
    for name in ("shot.usda", "ball.usda", "t.png"):  # the root, a layer, a texture
        (sheets.folder / name).write_text(PARTS[name] + "# edited")
        assert sheets.sheet(tmp_path) == ["shot.usda"], name
        (sheets.folder / name).touch()  # the same content
        assert sheets.sheet(tmp_path) == [], name
    (sheets.folder / "late.usda").write_text(PARTS["other.usda"])  # was missing
    assert sheets.sheet(tmp_path) == ["shot.usda"]
    (sheets.folder / "late.usda").unlink()
    assert sheets.sheet(tmp_path) == ["shot.usda"]
    more = Limits(**{**vars(LIMITS), "spp": 2})
    assert sheets.sheet(tmp_path, more) == both
    assert sheets.sheet(tmp_path, Limits(**{**vars(more), "threads": 2})) == []
    sky = Limits(**{**vars(more), "flags": ("--dome", str(sheets.folder / "sky.exr"))})
    assert sheets.sheet(tmp_path, sky) == both
    (sheets.folder / "sky.exr").write_text("another")
    assert sheets.sheet(tmp_path, sky) == both
    monkeypatch.setattr("primray.report.report.__version__", "9.9.9")
    assert sheets.sheet(tmp_path, sky) == both


@limits_memory
def test_damaged_records_and_crashes_are_not_kept(sheets: Sheets, tmp_path: Path) -> None:
    sheets.exit_code = -9
    assert len(sheets.sheet(tmp_path)) == len(sheets.sheet(tmp_path)) == 2
    sheets.exit_code = 3
    assert len(sheets.sheet(tmp_path)) == 2
    assert sheets.sheet(tmp_path) == []
    records = sorted(sheets.kept.glob("*.json"))
    records[0].write_text(records[0].read_text()[:50])
    told: dict[str, Any] = json.loads(records[1].read_text())
    assert told["outcome"]["exit_code"] == 3
    sorted(sheets.kept.glob("*.png"))[1].write_bytes(b"half")
    assert len(sheets.sheet(tmp_path)) == 2


def test_a_stage_whose_files_cannot_be_listed_is_rendered_each_time(
    sheets: Sheets, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_outcomes, "run_limited", lambda *given: Ended(-11, 0.1, 1, ""))
    assert len(sheets.sheet(tmp_path)) == len(sheets.sheet(tmp_path)) == 2
    assert not list(sheets.kept.iterdir())
