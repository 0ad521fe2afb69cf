"""The gallery is what its scripts make: stages, pictures and figures belong together, and the pages show them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import OpenImageIO as oiio
import pytest
from pxr import Sdf

from . import page, pictures
from .scenes import FOLDER, ROOT, SHOWN, Shown

GENERATED = [shown for shown in SHOWN if not shown.stage]
names = pytest.mark.parametrize("shown", SHOWN, ids=lambda shown: shown.name)


def test_every_scene_of_the_gallery_is_shown() -> None:
    there = {path.parent.name for path in (ROOT / "scenes/gallery").glob("*/generate.py")}
    assert there == {shown.name for shown in GENERATED}
    assert len(SHOWN) == 11


@names
def test_pictures_are_of_the_stages_as_they_are(shown: Shown) -> None:
    kept = pictures.records()[shown.name]
    assert kept["stage_sha256"] == pictures.stage_sha256(shown), f"python -m tests.docs.gallery.pictures {shown.name}"
    assert kept["command"] == shown.command
    assert 0 < kept["relmse"]["ci95"][0] <= kept["relmse"]["estimate"] <= kept["relmse"]["ci95"][1]
    assert ("denoised_relmse" in kept) == shown.denoised


@names
def test_pictures_have_their_sizes(shown: Shown) -> None:
    large, small = FOLDER / f"{shown.name}.jpg", FOLDER / f"{shown.name}-small.jpg"
    assert (oiio.ImageBuf(str(large)).spec().width, oiio.ImageBuf(str(large)).spec().height) == shown.resolution
    assert oiio.ImageBuf(str(small)).spec().width == pictures.SMALL
    assert large.stat().st_size < 600_000
    assert small.stat().st_size < 60_000


def test_the_pages_are_fresh() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.page(SHOWN, pictures.records()), "run `make docs`"
    readme = page.README.read_text(encoding="utf-8")
    assert page.BEGIN in readme
    assert page.with_thumbnails(readme, SHOWN) == readme, "run `make docs`"


def made_again(shown: Shown, to: Path) -> Path:
    """The folder of the stage that its script writes now."""
    shutil.copytree(
        ROOT / "scenes/gallery", to / "scenes/gallery", ignore=shutil.ignore_patterns("*.usd?", "*.exr", "__pycache__")
    )
    subprocess.run([sys.executable, "-m", f"scenes.gallery.{shown.name}.generate"], cwd=to, check=True)
    return to / "scenes/gallery" / shown.name


def assert_scripts_make(shown: Shown, to: Path) -> None:
    made, kept = made_again(shown, to), shown.path.parent
    files = {path.name for path in kept.iterdir() if path.suffix != ".py" and path.is_file()}
    assert {path.name for path in made.iterdir() if path.suffix != ".py" and path.is_file()} == files
    for name in files:
        if name.endswith((".usda", ".usdc")):
            new, old = (Sdf.Layer.FindOrOpen(str(folder / name)).ExportToString() for folder in (made, kept))
            assert new == old, name
        else:
            assert (made / name).read_bytes() == (kept / name).read_bytes(), name


def test_scripts_make_the_stages(tmp_path: Path) -> None:
    assert_scripts_make(next(shown for shown in SHOWN if shown.name == "cornell"), tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("shown", GENERATED, ids=lambda shown: shown.name)
def test_all_scripts_make_their_stages(shown: Shown, tmp_path: Path) -> None:
    assert_scripts_make(shown, tmp_path)
