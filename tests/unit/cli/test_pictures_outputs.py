"""Where pictures go: through links, into folders that are made, not over what is no file; and what of a sequence is left when
one cannot be written."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest

from primray.cli import run
from primray.images.output_path import check_folder

from ..conftest import FakePipeline


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("exists", [True, False])
@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_a_picture_is_written_through_a_link(pipeline: FakePipeline, name: str, exists: bool) -> None:
    Path("kept").mkdir()
    target = Path("kept", name)
    if exists:
        target.write_text("old")
    Path(name).symlink_to(target)
    assert run(["render", "shot.usda", "-o", name]) == 0
    assert Path(name).is_symlink()
    assert target.stat().st_size > 100
    assert os.listdir("kept") == [name]


def test_a_report_is_written_through_a_link(pipeline: FakePipeline) -> None:
    Path("r.json").symlink_to("real.json")
    assert run(["render", "shot.usda", "--report", "r.json"]) == 0
    assert Path("r.json").is_symlink()
    assert json.loads(Path("real.json").read_text())["outputs"] == ["shot.exr"]


def test_a_link_that_leads_nowhere_is_told_before(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.exr").symlink_to("no/such/a.exr")
    Path("b.exr").symlink_to("b.exr")
    Path("c.exr").symlink_to("/dev/null")
    for name in ("a.exr", "b.exr", "c.exr"):
        assert run(["render", "shot.usda", "-o", name]) == 2
        assert "output-folder" in capsys.readouterr().err
    assert Path("/dev/null").is_char_device()
    assert "render" not in pipeline.calls


def test_devices_are_not_replaced() -> None:
    with pytest.raises(Exception, match="cannot be written"):
        check_folder(Path("/dev/null"))


@pytest.mark.parametrize("make", [True, False])
def test_make_output_path(pipeline: FakePipeline, make: bool) -> None:
    flags = ["-f", "1:2", "-o", "take#1/b/a.#.exr", "--report", "reports/r.#.json"]
    assert run(["render", "shot.usda", *flags, *(["--make-output-path"] if make else [])]) == (0 if make else 2)
    assert Path("take#1/b/a.2.exr").exists() == make
    assert Path("reports/r.1.json").exists() == make


def test_a_folder_that_cannot_be_made(pipeline: FakePipeline, capsys: pytest.CaptureFixture[str]) -> None:
    Path("file").touch()
    assert run(["render", "shot.usda", "-o", "file/b/a.exr", "--make-output-path"]) == 2
    assert "cannot be made" in capsys.readouterr().err


def test_a_stages_own_name_is_literal(pipeline: FakePipeline) -> None:
    assert run(["render", "shot#1.usda"]) == 0
    assert run(["render", "shot#2.usda", "-f", "7"]) == 0
    assert run(["render", "shot#3.usda", "-f", "7:8"]) == 0
    assert run(["render", "shot.usda", "-o", "a.####.exr"]) == 0
    assert sorted(os.listdir()) == ["a.####.exr", "shot#1.exr", "shot#2.exr", "shot#3.0007.exr", "shot#3.0008.exr"]


def _full_for(monkeypatch: pytest.MonkeyPatch, *full: str) -> None:
    replace = os.replace

    def replaced(source: Any, target: Any) -> None:
        if Path(target).name in full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr("os.replace", replaced)


def test_a_full_disk_ends_no_sequence(
    pipeline: FakePipeline, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _full_for(monkeypatch, "a.2.exr")
    flags = ["-f", "1:3", "-o", "a.#.exr", "-o", "a.#.png", "--report", "r.#.json", "--json"]
    assert run(["render", "shot.usda", *flags]) == 1
    told = capsys.readouterr()
    assert told.err.count("error: write-failed: the file cannot be written: No space left on device [a.2.exr]") == 1
    assert sorted(os.listdir()) == sorted(
        ["a.1.exr", "a.1.png", "a.2.png", "a.3.exr", "a.3.png", "r.1.json", "r.2.json", "r.3.json"]
    )
    assert json.loads(Path("r.2.json").read_text())["outputs"] == ["a.2.png"]
    errors = [line for line in map(json.loads, told.out.splitlines()) if line["type"] == "error"]
    assert [(line["code"], line["where"], line["exit_code"]) for line in errors] == [("write-failed", "a.2.exr", 1)]


def test_a_report_that_cannot_be_written(pipeline: FakePipeline, monkeypatch: pytest.MonkeyPatch) -> None:
    _full_for(monkeypatch, "r.1.json")
    assert run(["render", "shot.usda", "-f", "1:2", "-o", "a.#.exr", "--report", "r.#.json"]) == 1
    assert sorted(os.listdir()) == ["a.1.exr", "a.2.exr", "r.2.json"]
