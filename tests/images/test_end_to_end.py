"""From USD files to picture files with the real core: the record equals the report, and Ctrl-C leaves a picture."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd

import primray
from primray.cli import run
from primray.images.image import pixels_sha256

SCENE = Path(__file__).parents[2] / "scenes" / "features" / "light-rect" / "scene.usda"
SMALL = primray.RenderSettings(resolution=(48, 0), spp=4)


def read_exr(path: Path) -> Any:
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    return file.read_image(0, 0, 0, 4, oiio.FLOAT)


def test_the_exr_has_the_reports_hash(tmp_path: Path) -> None:
    exr, png, report = tmp_path / "a.exr", tmp_path / "a.png", tmp_path / "a.json"
    arguments = ["-o", str(exr), "-o", str(png), "--report", str(report), "--res", "48", "0", "--spp", "4"]
    assert run(["render", str(SCENE), *arguments]) == 0
    facts = json.loads(report.read_text())
    assert pixels_sha256(read_exr(exr)) == facts["pixels_sha256"]
    assert facts["samples"] == 4 * 48 * facts["settings"]["resolution"][1]
    assert facts["rays"] > facts["samples"]
    assert png.read_bytes().startswith(b"\x89PNG")


def test_threads_do_not_change_the_picture() -> None:
    hashes = {
        primray.render(SCENE, primray.RenderSettings(resolution=(48, 0), spp=4, threads=n)).report["pixels_sha256"]
        for n in (1, 3)
    }
    assert len(hashes) == 1


def test_a_stage_in_memory_gives_the_same_picture() -> None:
    from_path = primray.render(SCENE, SMALL)
    in_memory = primray.render(Usd.Stage.Open(str(SCENE)), SMALL)
    assert in_memory.report["pixels_sha256"] == from_path.report["pixels_sha256"]


def test_the_images_camera_projects_to_its_pixels() -> None:
    image = primray.render(SCENE, SMALL)
    assert image.camera is not None
    in_front = image.camera.world_from_camera @ np.array([0, 0, -1, 1])
    centre = image.camera.project(in_front[:3], image.resolution)
    assert np.allclose(centre, np.array(image.resolution) / 2)


def test_progress_stops_a_render() -> None:
    with pytest.raises(primray.PrimrayError):
        primray.render(SCENE, primray.RenderSettings(resolution=(256, 0), spp=4096), progress=lambda *_: False)


def test_ctrl_c_leaves_a_valid_picture(tmp_path: Path) -> None:
    exr, report = tmp_path / "a.exr", tmp_path / "a.json"
    # A shell's background jobs, and so their children, start with the signal ignored.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from primray.cli import main; main()"
    command = [sys.executable, "-c", code, "render", str(SCENE), "-o", str(exr)]
    arguments = ["--report", str(report), "--res", "96", "0", "--spp", "1000000", "--json"]
    process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    process.stdout.readline()  # the first progress: it renders
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 130
    facts = json.loads(report.read_text())
    assert facts["interrupted"] is True
    assert 0 < facts["samples"] < 10**6 * 96 * 64
    pixels = read_exr(exr)
    assert np.isfinite(pixels).all()
    assert pixels_sha256(pixels) == facts["pixels_sha256"]
