"""Signals before a command has begun to render, where pxr's C++ would swallow an exception."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# Sends the signal from inside the import of one module.
_CODE = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with it ignored
from primray.cli import main

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), int(number))

sys.meta_path.insert(0, Finder())
module, number = sys.argv[1:3]
sys.argv[:3] = ["primray"]
main()
"""
_STAGE = '#usda 1.0\ndef Sphere "ball" {}\n'


@pytest.mark.parametrize(
    ("module", "number", "command"),
    [
        ("pxr.Sdf._sdf", signal.SIGTERM, "render"),
        ("pxr.Gf", signal.SIGTERM, "render"),
        ("pxr.Usd", signal.SIGINT, "render"),
        ("pxr.Ar", signal.SIGTERM, "inspect"),
        ("pxr.Sdf", signal.SIGTERM, "estimate"),
        ("typer", signal.SIGTERM, "merge"),
    ],
)
def test_a_signal_during_an_import_interrupts(module: str, number: int, command: str, tmp_path: Path) -> None:
    stage = tmp_path / "ball.usda"
    stage.write_text(_STAGE)
    outputs = ["-o", str(tmp_path / "p.png")] if command in ("render", "merge") else []
    line = [sys.executable, "-c", _CODE, module, str(int(number)), command, str(stage), *outputs]
    ended = subprocess.run(line, capture_output=True, text=True, timeout=100)
    assert (ended.returncode, ended.stderr) == (130, "interrupted\n")
    assert not (tmp_path / "p.png").exists()


def test_a_sheet_that_is_terminated_stops_its_renders(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.usda").write_text(_STAGE)
    code = "from primray.cli import main; main()"
    line = [sys.executable, "-c", code, "sheet", str(tmp_path), "-o", str(tmp_path / "s.html"), "--spp", "1000000"]
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    time.sleep(4)
    process.send_signal(signal.SIGTERM)
    _, stderr = process.communicate(timeout=20)
    assert (process.returncode, stderr) == (130, "interrupted\n")
    assert not (tmp_path / "s.html").exists()
