"""Opening: files that are not there, not text, or do not compose; messages that are not UTF-8."""

from __future__ import annotations

import os
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
from pxr import Usd

import primray
from primray import usd
from primray.diagnostics import STRICT, Diagnostics
from primray.errors import SettingsError, StageOpenError, UnsupportedError
from primray.settings import RenderSettings
from primray.usd import open_stage, translate


@pytest.mark.parametrize(
    "content", [None, b"", b'#usda 1.0\ndef Xform "\xff\xfe" {\n', b"PXR-USDC\0\1\2\3", b"not usd", b"PK\3\4broken"]
)
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz", ".usd", ".txt"])
def test_files_that_cannot_be_opened(tmp_path: Path, content: bytes | None, suffix: str) -> None:
    path = tmp_path / f"file{suffix}"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(StageOpenError) as error:
        open_stage(path, Diagnostics())
    str(error.value).encode()
    assert error.value.exit_code == 3


@pytest.mark.parametrize(
    "reads", [primray.render, primray.inspect, primray.doctor, primray.estimate, usd.files_to_watch, usd.check_preview]
)
def test_paths_that_are_no_text(tmp_path: Path, reads: Callable[[str], object]) -> None:
    path = tmp_path / os.fsdecode(b"s\xff.usda")
    path.write_text("#usda 1.0\n")
    with pytest.raises(StageOpenError, match="not valid UTF-8"):
        reads(str(path))


def test_a_path_that_is_no_text_is_unreadable_among_others(tmp_path: Path) -> None:
    path = str(tmp_path / os.fsdecode(b"s\xff.usda"))
    Path(path).write_text("#usda 1.0\n")
    assert usd.files_named(path) == ({path}, {path})
    assert usd.used_files([path]) == set()


def test_missing_references_are_diagnostics_and_keep_stderr_clean(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.usda"
    path.write_bytes(b'#usda 1.0\ndef "a" (\n    references = @gone.usda@\n)\n{\n}\ndef Sphere "s"\n{\n}\n')
    diagnostics = Diagnostics()
    stage = open_stage(path, diagnostics)
    found = [(d.code, d.prim_path) for d in diagnostics]
    assert found == [("composition-error", "/a")]
    description, _ = translate(stage, RenderSettings())
    assert [s.path for s in description.shapes] == ["/s"]
    assert capfd.readouterr().err == ""
    with pytest.raises(UnsupportedError):
        diagnostics.raise_if_refused(STRICT)


def test_stages_in_memory_are_taken_as_they_are() -> None:
    stage = Usd.Stage.CreateInMemory()
    assert open_stage(stage, Diagnostics()) is stage


def test_translation_leaves_the_stage_unchanged() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/m", "Mesh")
    before = stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()
    translate(stage, RenderSettings())
    assert (stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()) == before


@pytest.mark.parametrize("what", [3, None, b"shot.usda", ["shot.usda"], Usd.Stage.CreateInMemory().GetPseudoRoot()])
@pytest.mark.parametrize("door", ["render", "Scene", "inspect", "estimate", "notebook.View"])
def test_what_is_no_stage_is_refused_by_each_door(door: str, what: Any) -> None:
    if "." in door:
        pytest.importorskip("anywidget", reason="skipped: no anywidget")
    with pytest.raises(SettingsError, match=r"a stage must be a path or a Usd\.Stage, not \w+ \[stage\]"):
        attrgetter(door)(primray)(what)


def test_a_folder_is_no_stage(tmp_path: Path) -> None:
    with pytest.raises(StageOpenError, match="It is a folder: name a stage in it; `primray sheet FOLDER`"):
        primray.inspect(tmp_path)


def test_syntax_errors_name_no_type_of_the_parser(tmp_path: Path) -> None:
    (tmp_path / "broken.usda").write_text("#usda 1.0\ndef {\n")
    (tmp_path / "shot.usda").write_text('#usda 1.0\ndef Xform "a" (\n    references = @broken.usda@\n)\n{\n}\n')
    with pytest.raises(StageOpenError, match=r"broken\.usda:2:1: unexpected text at 'def \{'"):
        primray.inspect(tmp_path / "broken.usda")
    diagnostics = Diagnostics()
    open_stage(tmp_path / "shot.usda", diagnostics)
    (found,) = [d.message for d in diagnostics if d.code == "composition-error"]
    assert "unexpected text at 'def {'" in found
    assert "pegtl" not in found
