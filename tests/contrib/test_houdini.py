"""contrib/houdini: the wrapper with husk's flags, and the shelf's script with a stand-in for the module hou."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import OpenImageIO as oiio
import pytest
from pxr import Usd

from .shot import write_shot

FOLDER = Path(__file__).parents[2] / "contrib/houdini"
PRIMRAY = str(Path(sys.executable).with_name("primray"))


@pytest.fixture(autouse=True)
def program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PRIMRAY_EXECUTABLE", PRIMRAY)


def husk(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    # Houdini's Python would break primray's: it must not see the variable.
    environment = os.environ | {"PYTHONHOME": "/nowhere"}
    line = [sys.executable, "-E", str(FOLDER / "husk"), *words]
    return subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_husks_command_line_renders(tmp_path: Path) -> None:
    scene = write_shot(tmp_path)
    words = ["-R", "BRAY_HdKarma", "--engine=xpu", "-f", "1", "-n", "2", "-r", "16", "9", "--pixel-samples", "2"]
    done = husk(*words, "--make-output-path", "-o", "out/shot.$F4.exr", str(scene), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "note: -R BRAY_HdKarma is left out" in done.stderr
    assert "note: --engine xpu is left out" in done.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["shot.0001.exr", "shot.0002.exr"]
    done = husk("--fast-exit", "2", "--optimize-offline", str(scene), folder=tmp_path)
    assert done.returncode == 2
    assert "it has no effect in husk either" in done.stderr


def test_the_shelf_renders_the_stage_of_a_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    hou: Any = ModuleType("hou")
    said: list[tuple[str, str]] = []
    hou.severityType = SimpleNamespace(Message="message", Error="error")
    hou.ui = SimpleNamespace(displayMessage=lambda text, title, severity, details="": said.append((severity, text)))
    hou.text = SimpleNamespace(expandString=lambda text: text.replace("$HIP", str(tmp_path)))
    hou.frame, hou.intFrame = lambda: 2.0, lambda: 2
    hou.InterruptableOperation = lambda *given, **more: nullcontext()
    hou.selectedNodes = lambda: [SimpleNamespace(stage=lambda: stage, name=lambda: "rop"), SimpleNamespace()]
    monkeypatch.setitem(sys.modules, "hou", hou)
    runpy.run_path(str(FOLDER / "render_with_primray.py"))
    picture = tmp_path / "render/rop.0002.exr"
    assert said[0][0] == "message", said
    assert str(picture) in said[0][1]
    assert oiio.ImageBuf(str(picture)).spec().width > 0
    hou.selectedNodes = list
    runpy.run_path(str(FOLDER / "render_with_primray.py"))
    assert said[1] == ("error", "Select one LOP node.")
