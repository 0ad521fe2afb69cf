"""contrib/blender as a user meets it: the zip, the first render, passes, errors; all in Blenders without windows."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from . import host


def test_blender_s_own_command_validates_it(blender: str, tmp_path: Path) -> None:
    built = host.build(tmp_path)
    for what in (host.ADDON, built):
        words = [str(host.python()), str(host.extension_command()), "validate", str(what)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stdout + done.stderr


def test_nothing_of_blender_is_imported_by_primray() -> None:
    for folder in ("renderer", "service"):
        for file in (host.ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                assert not {name.split(".")[0] for name in names} & {"bpy", "mathutils"}, file


def test_every_file_names_its_licence() -> None:
    for file in host.ADDON.rglob("*.py"):
        assert file.read_text(encoding="utf-8").startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n"), file


def test_a_first_hour(blender: str, tmp_path: Path) -> None:
    """An image of a sky, hair, smoke and an instancer; the stage that was exported has the same bits from here."""
    rows = {row["name"]: row for row in host.run("first_hour", tmp_path)}
    assert "error" not in rows["first hour"], rows
    ours, theirs = (host.read(rows["first hour"][key])[..., :3] for key in ("ours", "theirs"))
    assert abs(ours.mean() / theirs.mean() - 1) < 0.03
    assert np.abs(ours - theirs).mean() < 0.1 * theirs.mean()
    parts = host.parts(rows["passes"]["file"])
    assert set(parts) == {"Combined", "Depth", "Normal", "Error"}
    assert (parts["Combined"][..., :3] == ours).all()
    assert 0 < parts["Depth"].min() < 5
    assert np.abs(np.linalg.norm(parts["Normal"], axis=2)[-1] - 1).max() < 1e-3
    program = Path(sys.executable).with_name("primray")
    command = [str(program), "render", "saved/stage.usda", "--seed", "3", "--output", "again.exr"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=host.TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    assert (host.read(str(tmp_path / "again.exr"))[..., :3] == ours).all()


def test_what_goes_wrong_is_said_and_blender_goes_on(blender: str, tmp_path: Path) -> None:
    rows = {row["name"]: row["error"] for row in host.run("failures", tmp_path)}
    assert "camera" in rows["no camera"]
    assert "/nowhere/python" in rows["no Python"]
    assert rows["cancelled"] == rows["the exporter has ended"] == rows["after all"] == ""


@pytest.mark.parametrize("name", ["lights.py", "world.py", "camera.py", "geometry.py", "materials.py"])
def test_what_exports_is_in_the_zip(name: str, tmp_path: Path) -> None:
    import zipfile

    assert f"usd_export/{name}" in zipfile.ZipFile(host.build(tmp_path)).namelist()
