"""What documents name: for sending a scene, and for watching it."""

from __future__ import annotations

import os
from pathlib import Path

from tests.unit.usd.materials.materialx.documents import RED, STAGE

from primray.usd import dependencies, files_to_watch

INCLUDES = '<materialx version="1.39"><xi:include href="more/looks.mtlx"/></materialx>'


def scene(tmp_path: Path) -> str:
    os.makedirs(tmp_path / "more" / "maps")
    (tmp_path / "looks.mtlx").write_text(INCLUDES)
    (tmp_path / "more" / "looks.mtlx").write_text(RED.replace("wood.png", "wood.<UDIM>.png").replace('value="2"', 'value="3"'))
    for tile in (1001, 1002):
        (tmp_path / "more" / "maps" / f"wood.{tile}.png").write_bytes(b"a picture")
    (tmp_path / "scene.usda").write_text(STAGE)
    return str(tmp_path / "scene.usda")


def test_documents_their_includes_and_their_textures_are_sent_and_watched(tmp_path: Path) -> None:
    path = scene(tmp_path)
    wanted = ["looks.mtlx", "more/looks.mtlx", "more/maps/wood.1001.png", "more/maps/wood.1002.png", "scene.usda"]
    found = dependencies(path)
    assert sorted(os.path.relpath(file, tmp_path) for file in found.files) == wanted
    assert (found.fixed, found.missing) == ((), ())
    assert sorted(os.path.relpath(file, tmp_path) for file in files_to_watch(path)) == wanted


def test_what_is_not_there_is_missing(tmp_path: Path) -> None:
    (tmp_path / "looks.mtlx").write_text(RED)
    (tmp_path / "scene.usda").write_text(STAGE)
    assert dependencies(str(tmp_path / "scene.usda")).missing == ("maps/wood.png",)
