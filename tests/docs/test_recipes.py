"""Recipes of docs/recipes.md run, and give what closed forms say."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/recipes.md").read_text(encoding="utf-8")
MUJOCO = ROOT / "build/mujoco"  # made by .ci/run
MOVING = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Camera "cam"
{
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 15
    float2 clippingRange = (0.1, 100)
}
def Mesh "card"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    double3 xformOp:translate.timeSamples = { 1: (0, 0, -8), 2: (0.4, -0.2, -8) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
FALLING = """<mujoco>
  <option timestep="0.001" gravity="0 0 -10"/>
  <worldbody>
    <body name="ball" pos="0 0 2"><freejoint/><geom type="sphere" size="0.2"/></body>
    <body name="arm" pos="1 0 2">
      <joint type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05"/>
    </body>
  </worldbody>
</mujoco>
"""
LABELLED = 'prepend apiSchemas = ["SemanticsLabelsAPI:class"]'
BODIES = f"""#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World"
{{
    def Sphere "ball" ({LABELLED})
    {{
        token[] semantics:labels:class = ["ball"]
        double radius = 0.2
    }}
    def Xform "arm" ({LABELLED})
    {{
        token[] semantics:labels:class = ["arm"]
        def Capsule "capsule"
        {{
            uniform token axis = "X"
            double radius = 0.05
            double height = 0.5
            double3 xformOp:translate = (0.25, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
    }}
}}
def DomeLight "sky"
{{
}}
"""


def block(title: str) -> str:
    section = PAGE[PAGE.index(f"## {title}") :]
    found = re.search(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    assert found
    return found[1]


def run(title: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(block(title), title, "exec"), names)
    return names


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "tests/unit/dataset/room.usda", tmp_path)
    return tmp_path


def test_flow_is_that_of_the_closed_form(folder: Path) -> None:
    (folder / "moving.usda").write_text(MOVING)
    names = run("Optical flow")
    flow, depth = names["flow"], names["seen"].aovs["depth"].values[..., 0]
    card = np.isfinite(depth)
    pixels_a_unit = 160 / 8  # a window as wide as it is far
    assert 1000 < card.sum() < card.size
    assert np.allclose(flow[card], [0.4 * pixels_a_unit, 0.2 * pixels_a_unit], atol=1e-3)
    assert not flow[~card].any()
    assert np.frombuffer((folder / "0001.flo").read_bytes()[:12], "<i4")[1:].tolist() == [160, 120]
    stored = np.frombuffer((folder / "0001.flo").read_bytes()[12:], "<f4")
    assert np.array_equal(stored, flow.ravel())


def test_processes_render_what_one_renders(folder: Path) -> None:
    (folder / "hashes.py").write_text(block("Several processes"))
    found = subprocess.run([sys.executable, "hashes.py"], check=True, capture_output=True, text=True).stdout.split()
    expected = []
    for k in range(4):
        stage = Usd.Stage.Open("room.usda")
        stage.GetPrimAtPath("/World/lamp").GetAttribute("inputs:intensity").Set(10.0 + k)
        image = primray.render(stage, resolution=(32, 24), spp=1, seed=k, progress=False)
        expected.append(image.report["pixels_sha256"])
    assert found == expected


def test_a_notebook_shows_things_in_colours(folder: Path) -> None:
    names = run("Labels in a notebook")
    image, pixels = names["image"], names["pixels"]
    labelled = np.any([image.mask_of(thing) for thing in image.things], axis=0)
    assert labelled.any()
    assert np.array_equal(pixels[~labelled], image.pixels[~labelled])
    assert (pixels[labelled] != image.pixels[labelled]).any(axis=1).all()
    assert primray.Image(pixels)._repr_png_().startswith(b"\x89PNG")


def test_poses_of_mujoco_are_those_of_the_pictures(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if MUJOCO.is_dir():
        monkeypatch.syspath_prepend(MUJOCO)
    mujoco = pytest.importorskip("mujoco", reason="skipped: no mujoco")
    (folder / "falling.xml").write_text(FALLING)
    (folder / "falling.usda").write_text(BODIES)
    names = run("Poses of a physics engine")
    assert mujoco.__version__
    boxes = [{thing.path: thing.box_3d for thing in image.things} for image in names["images"]]
    for picture, found in enumerate(boxes, start=1):
        seconds = 0.05 * picture  # semi-implicit Euler falls by g dt / 2 a second more
        ball, arm = found["/World/ball"], found["/World/arm"]
        assert ball is not None
        assert np.allclose(ball.center, [0, 0, 2 - 5 * seconds**2 - 0.005 * seconds], atol=1e-4)
        assert arm is not None
        data = names["data"]
        assert np.isclose(np.linalg.norm(np.array(arm.center) - [1, 0, 2]), 0.25, atol=1e-3)
    last = np.array(boxes[-1]["/World/arm"].world_from_prim)
    assert np.allclose(last[:3, :3], data.xmat[2].reshape(3, 3), atol=1e-9)
    assert np.allclose(last[:3, 3], data.xpos[2], atol=1e-9)
    assert last[2, 0] < -0.1  # the arm has turned down
