"""The add-on's viewport, without windows: pictures after changes of a scene, of a view, and after what goes wrong."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import primray

from . import host

# What is exported again, of objects and materials, and how often the scene has been exported by then.
EXPORTS = {
    "moved": (0, 0, 0), "turned": (0, 0, 0), "lamp moved": (0, 0, 0), "looked from elsewhere": (0, 0, 0), "material": (0, 1, 1),
    "mesh": (1, 0, 2), "lamp": (0, 0, 3), "world": (0, 0, 4), "gone": (0, 0, 5), "come": (1, 1, 6),
}  # fmt: skip
SEED, SAMPLES = 3, 8


@pytest.fixture
def live_renderer() -> ModuleType:
    """The add-on's script that runs in primray's Python."""
    sys.path.insert(0, str(host.ADDON))
    try:
        spec = importlib.util.spec_from_file_location("live_renderer", host.ADDON / "live_renderer.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(host.ADDON))
        sys.modules.pop("renderer", None)
    return module


def picture(row: dict[str, Any]) -> npt.NDArray[np.float32]:
    return np.load(row["file"])


def test_a_change_gives_the_bits_of_a_viewport_that_is_opened_then(
    blender: str, tmp_path: Path, live_renderer: ModuleType
) -> None:
    from pxr import Usd

    rows = {row["name"]: row for row in host.run("viewport", tmp_path)}
    opened, before = rows["opened"]["exports"], picture(rows["opened"])
    for name, (objects, materials, exports) in EXPORTS.items():
        assert rows[name]["exports"] - opened == exports, name
        if exports:
            assert rows[name]["exported"] == {"objects": objects, "materials": materials}, name
        now = picture(rows[name])
        assert (now != before).any(), name
        before = now
    for name in ("moved", "mesh", "moved again"):
        assert (picture(rows[name]) == picture(rows[f"{name}, opened then"])).all(), name
        # A render of the exported stage, by itself.
        stage = Usd.Stage.Open(str(tmp_path / f"stage, {name}/stage.usda"))
        live_renderer.write_camera(stage, "/view", rows[name]["camera"])
        image = primray.render(stage, camera="/view", resolution=(64, 48), spp=SAMPLES, seed=SEED, aovs=[])
        assert (image.pixels[::-1, :, :3] == picture(rows[name])[..., :3]).all(), name


def test_a_camera_s_matrices_show_what_the_camera_does(blender: str, tmp_path: Path) -> None:
    rows = host.run("viewport_cameras", tmp_path)
    assert len(rows) == 4
    for row in rows:
        ours, theirs = picture(row)[::-1, :, :3], host.read(row["render"])[..., :3]
        assert np.abs(ours - theirs).mean() < 0.003 * theirs.mean(), row["name"]
        assert np.abs(ours[:, ::-1] - theirs).mean() > 0.02 * theirs.mean(), row["name"]


def test_a_viewport_goes_on_after_what_goes_wrong(blender: str, tmp_path: Path) -> None:
    rows = {row["name"]: row for row in host.run("viewport_trouble", tmp_path)}
    assert rows["no camera"]["error"] == ""
    assert rows["cancelled"]["is_still"]
    assert not rows["cancelled"]["is_finished"]
    assert (picture(rows["after it"]) != picture(rows["no camera"])).any()
    assert "primray: the process ended with code -9" in rows["the renderer has ended"]["told"]
    assert "exporter: the process ended with code -9" in rows["the exporter has ended"]["told"]
    assert rows["end"]["error"] == ""
    assert (picture(rows["moved"]) != picture(rows["the exporter has ended"])).any()
