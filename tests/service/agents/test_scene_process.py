"""The process of one scene, without its sandbox."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from primray_service.agents import scene_process
from primray_service.agents.looks import Eye
from primray_service.agents.scene_process import Scenes


def test_a_file_that_is_written_while_it_is_read_is_read_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, original = folder / "toys.usda", scene_process._opened
    text = file.read_text()

    def opened(path: str, request: Mapping[str, Any]) -> Eye:
        eye = original(path, request)
        if file.read_text() == text:
            file.write_text(text.replace('"ball"', '"moon"'))
        return eye

    monkeypatch.setattr(scene_process, "_opened", opened)
    scenes = Scenes(folder)
    request: dict[str, Any] = {"variants": []}
    before = time.time() - 60
    os.utime(file, (before, before))
    first = scenes._opened(str(file), request)
    assert first.kept.opened.stage.GetPrimAtPath("/world/ball")
    second = scenes._opened(str(file), request)
    assert second.kept.opened.stage.GetPrimAtPath("/world/moon")
    later = time.time() + 3600
    os.utime(file, (later, later))
    third = scenes._opened(str(file), request)
    assert third is not second
    assert scenes._opened(str(file), request) is third
