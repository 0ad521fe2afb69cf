"""A stage's files as nodes get them: alone, or with all that it refers to."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from tests.service.executor.scenes import MISSING_TEXTURE, ROOM

from primray.errors import PrimrayError
from primray_service.farm.ray_parts import packed

SUBLAYERS = "#usda 1.0\n(\n    subLayers = [@layers/room.usda@]\n)\n"


def test_one_file(tmp_path: Path) -> None:
    stage, scratch = tmp_path / "shot.usda", tmp_path / "scratch"
    scratch.mkdir()
    stage.write_text(ROOM)
    found = packed(stage, scratch)
    assert found.root == "shot.usda"
    assert not found.folders
    (name, copy), *more = found.inputs.items()
    stage.write_text("changed meanwhile")
    assert (name, copy.read_text(), more) == ("shot.usda", ROOM, [])


def test_a_stage_with_its_layers(tmp_path: Path) -> None:
    (tmp_path / "show/layers").mkdir(parents=True)
    (tmp_path / "scratch").mkdir()
    stage = tmp_path / "show/shot.usda"
    stage.write_text(SUBLAYERS)
    (tmp_path / "show/layers/room.usda").write_text(ROOM)
    (tmp_path / "show/secret.txt").write_text("not asked for")
    found = packed(stage, tmp_path / "scratch")
    assert found.root == "package/shot.usda"
    folder = found.folders["package"]
    there = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    assert there == ["layers/room.usda", "shot.usda"]


def test_what_is_missing_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stage = tmp_path / "shot.usda"
    stage.write_text(MISSING_TEXTURE)
    with caplog.at_level(logging.WARNING, "primray"):
        packed(stage, tmp_path)
    assert "not_there.png" in caplog.text


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(PrimrayError) as raised:
        packed(tmp_path / "shot.usda", tmp_path)
    assert raised.value.code == "no-scene"
