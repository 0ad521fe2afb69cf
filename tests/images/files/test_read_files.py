"""No output of a command replaces a file that its stage reads, whatever kind of file that is."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests import vdb_writer
from tests.images.files.test_lost_nothing import stage, use
from tests.images.pull_requests import kinds_of_files as kinds
from tests.images.pull_requests.commits import paint
from tests.unit.usd.volumes.volume_text import grid

import primray
from primray.cli import run

__all__ = ["stage"]  # a fixture

IES = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 2 3 1 1 2 0 0 0\n1 1 50\n0 45 90\n0\n100 50 0\n"
LAMP = (
    'def SphereLight "lamp" (prepend apiSchemas = ["ShapingAPI"])\n{\n'
    "    float inputs:shaping:cone:angle = 180\n    asset inputs:shaping:ies:file = @./lamp.ies@\n}\n"
)
CARD = (
    'def Xform "tree" (\n    kind = "component"\n    prepend apiSchemas = ["GeomModelAPI"]\n)\n{\n'
    '    uniform token model:drawMode = "cards"\n    uniform bool model:applyDrawMode = 1\n'
    "    asset model:cardTextureZPos = @./card.png@\n    asset model:cardTextureZNeg = @./card.png@\n"
    "    float3[] extentsHint = [(-1, -1, -1), (1, 1, 1)]\n"
    '    def Sphere "ball"\n    {\n    }\n}\n'
)
LENS = (
    '    token omni:lensdistortion:model = "lut"\n'
    "    asset omni:lensdistortion:lut:rayEnterDirectionTexture = @./lens.exr@\n"
    "    float omni:lensdistortion:lut:nominalWidth = 8\n    float omni:lensdistortion:lut:nominalHeight = 4\n"
    "    float2 omni:lensdistortion:lut:opticalCenter = (4, 2)\n"
)


def _sublayers(folder: Path) -> None:
    (folder / "look.usda").write_text('#usda 1.0\nover "ball"\n{\n}\n')
    (folder / "layered.usda").write_text(
        kinds.HEAD.replace("(\n", "(\n    subLayers = [@./look.usda@]\n", 1) + 'def Sphere "ball"\n{\n}\n'
    )


def _payloads(folder: Path) -> None:
    (folder / "ball.usda").write_text('#usda 1.0\n(\n    defaultPrim = "ball"\n)\ndef Sphere "ball"\n{\n}\n')
    (folder / "loaded.usda").write_text(kinds.HEAD + 'def "ball" (\n    payload = @./ball.usda@\n)\n{\n}\n')


def _domes(folder: Path) -> None:
    paint(folder / "sky.png", 180)
    sky = 'def DomeLight "sky2"\n{\n    asset inputs:texture:file = @./sky.png@\n}\ndef Sphere "ball"\n{\n}\n'
    (folder / "domed.usda").write_text(kinds.HEAD + sky)


def _profiles(folder: Path) -> None:
    (folder / "lamp.ies").write_text(IES)
    (folder / "shaped.usda").write_text(kinds.HEAD + LAMP + 'def Sphere "ball"\n{\n}\n')


def _cards(folder: Path) -> None:
    paint(folder / "card.png", 180)
    (folder / "cards.usda").write_text(kinds.HEAD + CARD)


def _plates(folder: Path) -> None:
    paint(folder / "plate.png", 180)
    text = kinds.HEAD.replace('def Camera "cam"\n{', 'def Camera "cam" (\n    prepend apiSchemas = ["BackPlateAPI:sky"]\n)\n{')
    text = text.replace("    float2 clippingRange", "    asset backPlate:sky:image = @./plate.png@\n    float2 clippingRange")
    (folder / "plated.usda").write_text(text + 'def Sphere "ball"\n{\n}\n')


def _lenses(folder: Path) -> None:
    across, down = np.meshgrid((np.arange(8) - 3.5) / 8, (np.arange(4) - 1.5) / 8)
    rays = np.dstack([across, -down, -np.ones_like(down)])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    spec = oiio.ImageSpec(8, 4, 3, "float")
    out: Any = oiio.ImageOutput.create(str(folder / "lens.exr"))
    assert out.open(str(folder / "lens.exr"), spec)
    assert out.write_image(rays.astype(np.float32))
    out.close()
    text = kinds.HEAD.replace("    float2 clippingRange", LENS + "    float2 clippingRange")
    (folder / "lensed.usda").write_text(text + 'def Sphere "ball"\n{\n}\n')


def _volumes(folder: Path) -> None:
    kinds._volumes(folder)
    (folder / "smoke.vdb").write_bytes(vdb_writer.vdb_bytes([grid(0.2)]))


CASES: dict[str, tuple[Callable[[Path], None], str]] = {
    "look.usda": (_sublayers, "layered.usda"),
    "ball.usda": (_payloads, "loaded.usda"),
    "clip.usda": (kinds._clips, "clipped.usda"),
    "tile.1002.png": (kinds._tiles, "tiled.usda"),
    "smoke.vdb": (_volumes, "smoky.usda"),
    "look.mtlx": (kinds._documents, "worn.usda"),
    "ball.usdz": (kinds._packages, "packed.usda"),
    "sky.png": (_domes, "domed.usda"),
    "lamp.ies": (_profiles, "shaped.usda"),
    "card.png": (_cards, "cards.usda"),
    "plate.png": (_plates, "plated.usda"),
    "lens.exr": (_lenses, "lensed.usda"),
}
SMALL = ["--res", "4", "4", "--spp", "1"]
REFUSED = "output-folder: the output would overwrite a file that the command reads"


@pytest.mark.parametrize("file", CASES)
def test_reports_spare_what_the_stage_reads(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "shot"
    folder.mkdir()
    make, stage = CASES[file]
    make(folder)
    before = (folder / file).read_bytes()
    frame = ["--frame", "0"] if file == "clip.usda" else []
    line = ["render", f"shot/{stage}", "-o", "out.png", *SMALL, *frame]
    assert run([*line, "--report", f"shot/./{file}"]) == 2
    assert REFUSED in capsys.readouterr().err
    assert (folder / file).read_bytes() == before
    assert not Path("out.png").exists()
    assert run([*line, "--report", "report.json"]) == 0
    assert run([*line, "--report", "report.json"]) == 0  # which replaces what it wrote


LINES = {
    "render": ["render", "tiled.usda", *SMALL, "-o", "tile.1001.png"],
    "render of a frame": ["render", "tiled.usda", *SMALL, "--frame", "1001", "-o", "tile.####.png"],
    "render without textures": ["render", "tiled.usda", *SMALL, "--surface-textures", "off", "-o", "tile.1001.png"],
    "render through a link": ["render", "tiled.usda", *SMALL, "-o", "link.png"],
    "explain": ["explain", "tiled.usda", "--pixel", "1", "1", *SMALL, "--overlay", "tile.1001.png"],
    "pin": ["pin", "tiled.usda", *SMALL, "--lock", "tile.1001.png"],
    "sheet": ["sheet", "tiled.usda", "-o", "tile.1001.png"],
    "thumbnail": ["thumbnail", "tiled.usda", "tile.1001.png"],
    "measure": ["measure", "smoky.usda", "--at", "0,0,4", "-o", "link.csv"],
}


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
def test_all_commands_spare_them(
    line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    kinds._tiles(tmp_path)
    _volumes(tmp_path)
    Path("link.png").symlink_to("tile.1001.png")
    Path("link.csv").symlink_to("smoke.vdb")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert run(line) == 2
    assert REFUSED in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("file", ["good.spi1d-lin_rec709.ocio", "luts/good.spi1d"])
def test_a_configuration_of_colours_is_kept_with_its_tables(
    file: str, stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    use(monkeypatch, tmp_path, "good.spi1d")
    before = Path(file).read_bytes()
    assert run(["render", stage.name, "-o", "a.png", *SMALL, "--report", file]) == 2
    assert REFUSED in capsys.readouterr().err
    assert Path(file).read_bytes() == before


def test_other_files_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kinds._tiles(tmp_path)
    os.link("tile.1001.png", "copy.png")  # replacing one name of a file keeps the other
    assert run(["render", "tiled.usda", *SMALL, "-o", "copy.png"]) == 0
    assert Path("copy.png").read_bytes() != Path("tile.1001.png").read_bytes()


def test_programs_may_write_a_texture_and_render_with_it(tmp_path: Path) -> None:
    kinds._tiles(tmp_path)
    stage = tmp_path / "tiled.usda"
    primray.render(stage, resolution=(4, 4), spp=1).save(tmp_path / "tile.1001.png")
    primray.render(stage, resolution=(4, 4), spp=1)
