"""Blender as a Python module, in processes of its own: an abort fails one test.

Found by PRIMRAY_BPY, environments with bpy (as in PATH, one beside the other), and in build/bpy, where .ci/run makes one. Tests
with the fixture `blender` run in each of VERSIONS that is found. Blender is GPL: nothing here imports it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

ROOT = Path(__file__).parents[3]
ADDON = ROOT / "contrib/blender"
VARIABLE = "PRIMRAY_BPY"
SCENES = Path(__file__).with_name("scenes.py")
TIMEOUT_S = 600
VERSIONS = ("5.0", "4.5", "5.3")  # the first is the one of tests that run in one Blender

_chosen: list[str] = [VERSIONS[0]]


@cache
def hosts() -> dict[str, Path]:
    """Return the interpreters that have bpy by Blender's version."""
    named = [Path(folder) for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]
    found: dict[str, Path] = {}
    for folder in [*named, ROOT / "build/bpy"]:
        for version in VERSIONS:
            if (folder / "bin/python").exists() and list(folder.glob(f"lib/python*/site-packages/bpy/{version}")):
                found.setdefault(version, folder / "bin/python")
    return found


def choose(version: str) -> None:
    """Let `python` and all that uses it be of this version from now on."""
    _chosen[:] = [version]


def version() -> str:
    return _chosen[0]


def python() -> Path:
    """Return the interpreter that has the chosen Blender; skips the test where there is none."""
    found = hosts().get(version())
    if found is None:
        pytest.skip(f"skipped: no Blender {version()}")
    return found


def environment(folder: Path) -> dict[str, str]:
    """Return the variables of a Blender whose preferences and extensions are in `folder`."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER"))}
    return own | {"BLENDER_USER_RESOURCES": str(folder / "blender")}


def extension_command() -> Path:
    """Return Blender's own command for extensions, which runs without Blender."""
    found = list(python().parents[1].glob("lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    assert found, "bpy has no command for extensions"
    return found[0]


def build(folder: Path) -> Path:
    """Build the extension's zip."""
    folder.mkdir(parents=True, exist_ok=True)
    words = [str(python()), str(extension_command()), "build", "--source-dir", str(ADDON), "--output-dir", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    (found,) = folder.glob("primray-*.zip")
    return found


def run(job: str, folder: Path, **values: Any) -> list[dict[str, Any]]:
    """Run a job of scenes.py with the extension installed. Returns the rows that it says, those before an abort too."""
    request = {"zip": str(build(folder / "dist")), "python": sys.executable, "folder": str(folder), **values}
    words = [str(python()), str(SCENES), job, json.dumps(request)]
    done = subprocess.run(words, env=environment(folder), capture_output=True, text=True, timeout=TIMEOUT_S)
    (folder / f"{job}.log").write_text(done.stdout + done.stderr)
    rows = [json.loads(line[5:]) for line in done.stdout.splitlines() if line.startswith("row: ")]
    assert rows or done.returncode == 0, (done.stdout + done.stderr)[-2000:]
    return rows


def read(file: str, part: int = 0) -> npt.NDArray[np.float32]:
    """Return the pixels of a part of an EXR that Blender wrote."""
    import OpenImageIO as oiio

    return np.asarray(oiio.ImageBuf(file, part, 0).get_pixels(oiio.FLOAT), np.float32)


def parts(file: str) -> dict[str, npt.NDArray[np.float32]]:
    """Return the parts of a multilayer EXR by the pass that they hold."""
    import OpenImageIO as oiio

    found = {}
    for part in range(oiio.ImageBuf(file).nsubimages):
        names = oiio.ImageBuf(file, part, 0).spec().channelnames
        pixels = read(file, part)
        # Blender before 5.0 writes all passes into one part.
        channels: dict[str, list[int]] = {}
        for at, name in enumerate(names):
            channels.setdefault(name.rsplit(".", 1)[0].split(".", 1)[1], []).append(at)
        for name, places in channels.items():
            found[name] = pixels[..., sorted(places, key=lambda at: "RGBAXYZW".index(names[at][-1].upper()))]
    return found


def header(file: str) -> dict[str, Any]:
    """Return the attributes of an EXR's first part."""
    import OpenImageIO as oiio

    return {found.name: found.value for found in oiio.ImageBuf(file, 0, 0).spec().extra_attribs}
