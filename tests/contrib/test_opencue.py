"""contrib/opencue: the job as OpenCue would get it, and its commands as a farm would run them."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest

import primray
from primray import RenderSettings

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "contrib/opencue/render_parts.py"
SCENE = ROOT / "scenes/analytic/furnace_half.usda"


def submitted(folder: Path, *asked: str) -> subprocess.CompletedProcess[str]:
    if find_spec("outline") is None:
        pytest.skip("skipped: no opencue-pyoutline")
    command = [sys.executable, str(SCRIPT), str(SCENE), str(folder / "it's/beauty.####.exr"), *asked, "--print"]
    return subprocess.run(command, env={**os.environ, "HOME": str(folder)}, capture_output=True, text=True, timeout=60)


def job(folder: Path, *asked: str) -> ElementTree.Element:
    done = submitted(folder, *asked)
    assert done.returncode == 0, done.stderr
    return ElementTree.fromstring(done.stdout[done.stdout.index("<?xml") :])


def test_a_frame_is_merged_when_its_parts_are_there(tmp_path: Path) -> None:
    spec = job(tmp_path, "--frames", "1-3", "--samples", "14", "--parts", "3", "--threads", "2")
    layers = {layer.attrib["name"]: layer for layer in spec.iter("layer")}
    assert list(layers) == ["part_1", "part_2", "part_3", "merge"]
    assert {layer.findtext("range") for layer in layers.values()} == {"1-3"}
    assert layers["part_1"].findtext("cores") == "2.0"
    ranges = [word for layer in layers.values() for word in (layer.findtext("cmd") or "").split() if word.count(":") == 1]
    assert sorted(set(ranges)) == ["0:4", "4:8", "8:14"]
    waits = {(each.attrib["type"], each.findtext("deplayer"), each.findtext("onlayer")) for each in spec.iter("depend")}
    assert waits == {("FRAME_BY_FRAME", "merge", f"part_{number}") for number in (1, 2, 3)}


def test_its_commands_make_the_bits_of_one_render(tmp_path: Path) -> None:
    """As a farm's machines run them, one of them twice."""
    spec = job(tmp_path, "--frames", "2", "--samples", "8", "--parts", "2", "--threads", "1")
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    commands = [(layer.findtext("cmd") or "").replace("#IFRAME#", "2") for layer in spec.iter("layer")]
    for command in (commands[0], *commands):
        done = subprocess.run(["sh", "-c", command], env=environment, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
    assert not list((tmp_path / "it's/parts").iterdir())
    merged = primray.read_image(tmp_path / "it's/beauty.0002.exr")
    direct = primray.render(SCENE, RenderSettings(spp=8, time_code=2.0))
    assert (merged.pixels == direct.pixels).all()


@pytest.mark.parametrize("asked", [("--samples", "15"), ("--samples", "4", "--parts", "3"), ("--parts", "0")])
def test_samples_that_cannot_be_divided_are_told(asked: tuple[str, ...], tmp_path: Path) -> None:
    done = submitted(tmp_path, *asked)
    assert done.returncode != 0
    assert "--samples has to be even and at least twice --parts" in done.stderr
