"""contrib/opencue: the job as OpenCue would get it, and its commands as a farm would run them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import primray
from primray import RenderSettings

from .shot import write_shot

ROOT = Path(__file__).parents[2]
PARTS = ROOT / "contrib/opencue/render_parts.py"
FRAMES = ROOT / "contrib/opencue/render_frames.py"
SCENE = ROOT / "scenes/analytic/furnace_half.usda"
PICTURE = "it's/beauty.####.exr"
# What OpenCue's cjsl-1.15.dtd lets follow each other, and its JobSpec.java lets names be made of.
ORDER = {
    "spec": "facility dept show shot user email uid job depends",
    "job": "paused priority maxretries maxcores maxgpus autoeat localbook os env layers",
    "layer": "cmd range chunk cores threadable memory gpus gpu gpu_memory timeout timeout_llu tags limits env services outputs",
    "depend": "depjob deplayer depframe onjob onlayer onframe",
}
NAME = re.compile(r"[\w.-]{3,}", re.ASCII)
DEFINITIONS = "PRIMRAY_CUE_DTD"  # names a folder with OpenCue's cjsl-*.dtd


def submitted(
    script: Path, folder: Path, *asked: str, scene: Path = SCENE, output: str = PICTURE
) -> subprocess.CompletedProcess[str]:
    if find_spec("outline") is None:
        pytest.skip("skipped: no opencue-pyoutline")
    own, extra = (asked[: asked.index("--")], asked[asked.index("--") :]) if "--" in asked else (asked, ())
    command = [sys.executable, str(script), str(scene), str(folder / output), *own, "--print", *extra]
    return subprocess.run(command, env={**os.environ, "HOME": str(folder)}, capture_output=True, text=True, timeout=60)


def printed(script: Path, folder: Path, *asked: str, **files: Any) -> str:
    done = submitted(script, folder, *asked, **files)
    assert done.returncode == 0, done.stderr
    return done.stdout[done.stdout.index("<?xml") :]


def job(script: Path, folder: Path, *asked: str, **files: Any) -> ElementTree.Element:
    return ElementTree.fromstring(printed(script, folder, *asked, **files))


def run_frame(command: str, frame: int, folder: Path) -> None:
    """Run a layer's command as a farm's machine does."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    words = ["sh", "-c", command.replace("#IFRAME#", str(frame))]
    done = subprocess.run(words, env=environment, cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


ASKED = ("--frames", "1-3", "--threads", "2", "--memory", "8g", "--aov", "depth", "--variant", "/World/car:color=red")


@pytest.mark.parametrize("script", [PARTS, FRAMES], ids=lambda path: path.stem)
def test_jobs_are_as_opencue_defines_them(script: Path, tmp_path: Path) -> None:
    spec = job(script, tmp_path, *ASKED)
    for kind, order in ORDER.items():
        for element in spec.iter(kind):
            places = [order.split().index(child.tag) for child in element]
            assert places == sorted(places)
    assert all(NAME.fullmatch(element.attrib["name"]) for kind in ("job", "layer") for element in spec.iter(kind))
    assert {layer.attrib["type"] for layer in spec.iter("layer")} == {"Render"}


@pytest.mark.parametrize("script", [PARTS, FRAMES], ids=lambda path: path.stem)
def test_opencue_s_definition_accepts_them(script: Path, tmp_path: Path) -> None:
    text, folder, program = printed(script, tmp_path, *ASKED), os.environ.get(DEFINITIONS), shutil.which("xmllint")
    if folder is None or program is None:
        pytest.skip(f"skipped: no {DEFINITIONS}" if folder is None else "skipped: no xmllint")
    definition = re.search(r"cjsl-[\d.]+\.dtd", text)
    assert definition is not None

    def accepts(job_text: str) -> bool:
        (tmp_path / "job.xml").write_text(re.sub(r"<!DOCTYPE[^>]*>", "", job_text))
        command = [program, "--noout", "--dtdvalid", str(Path(folder) / definition[0]), str(tmp_path / "job.xml")]
        return subprocess.run(command, capture_output=True, timeout=60).returncode == 0

    assert accepts(text)
    assert not accepts(text.replace("<chunk>", "<cores>1</cores><chunk>"))


def test_a_frame_is_a_task(tmp_path: Path) -> None:
    scene = write_shot(tmp_path)
    outputs = ("--light-group", "key", "--cryptomatte", "object")
    further = ("--", "--spp", "4", "--res", "32", "18", "--metadata", "note=two words")
    spec = job(FRAMES, tmp_path, *ASKED, *outputs, *further, scene=scene)
    (layer,) = spec.iter("layer")
    facts = {name: layer.findtext(name) for name in ("range", "chunk", "cores", "memory")}
    assert facts == {"range": "1-3", "chunk": "1", "cores": "2.0", "memory": "8g"}
    run_frame(layer.findtext("cmd") or "", 2, tmp_path)
    picture = primray.read_image(tmp_path / "it's/beauty.0002.exr")
    assert set(picture.aovs) == {"depth", "crypto_object", "C.*<L.'key'>"}
    red, _, blue = picture.pixels[9, 16, :3]
    assert red > 2 * blue
    assert b"two words" in (tmp_path / "it's/beauty.0002.exr").read_bytes()


@pytest.mark.parametrize(("named", "flags"), [((), "--all-products"), (("product",), "--product product")])
def test_products_of_a_frame(named: tuple[str, ...], flags: str, tmp_path: Path) -> None:
    spec = job(
        FRAMES, tmp_path, "--products", *named, "--denoise", "--", "--spp", "2", scene=write_shot(tmp_path), output="out"
    )
    command = next(spec.iter("layer")).findtext("cmd") or ""
    assert flags in command
    assert "--denoise" in command
    run_frame(command.replace(" --denoise", ""), 7, tmp_path)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["car.0007.exr"]


def test_a_frame_is_merged_when_its_parts_are_there(tmp_path: Path) -> None:
    spec = job(PARTS, tmp_path, "--frames", "1-3", "--samples", "14", "--parts", "3", "--threads", "2")
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
    spec = job(PARTS, tmp_path, "--frames", "2", "--samples", "8", "--parts", "2", "--threads", "1", "--aov", "depth")
    commands = [layer.findtext("cmd") or "" for layer in spec.iter("layer")]
    for command in (commands[0], *commands):
        run_frame(command, 2, tmp_path)
    assert not list((tmp_path / "it's/parts").iterdir())
    merged = primray.read_image(tmp_path / "it's/beauty.0002.exr")
    assert set(merged.aovs) == {"depth"}
    direct = primray.render(SCENE, RenderSettings(spp=8, time_code=2.0))
    assert (merged.pixels == direct.pixels).all()


@pytest.mark.parametrize("asked", [("--samples", "15"), ("--samples", "4", "--parts", "3"), ("--parts", "0")])
def test_samples_that_cannot_be_divided_are_told(asked: tuple[str, ...], tmp_path: Path) -> None:
    done = submitted(PARTS, tmp_path, *asked)
    assert done.returncode != 0
    assert "--samples has to be even and at least twice --parts" in done.stderr


@pytest.mark.parametrize("script", [PARTS, FRAMES], ids=lambda path: path.stem)
def test_a_name_for_several_frames_has_a_place_for_the_number(script: Path, tmp_path: Path) -> None:
    done = submitted(script, tmp_path, "--frames", "1-3", output="one.exr")
    assert done.returncode == 2
    assert "one.exr has no placeholder for the frame's number" in done.stderr
    assert submitted(script, tmp_path, "--frames", "3", output="one.exr").returncode == 0
