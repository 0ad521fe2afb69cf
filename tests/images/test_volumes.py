"""Volumes from the stage to the picture: transmittance by Beer and Lambert's law, furnaces, instances, checkpoints' digests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from tests import vdb_writer as vdb
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray.volumes.vdb_file import GridInfo, read_grid
from primray.volumes.volume_grid import VolumeGrid

SKY = 'def DomeLight "Sky" {}\n'
CAMERA = """
def Camera "Cam" {
    token projection = "orthographic"
    float horizontalAperture = 20
    float verticalAperture = 20
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (3.5, 3.5, 30)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def look(inputs: str) -> str:
    return f"""
def Material "Look" {{
    token outputs:arnold:volume.connect = </Look/Shader.outputs:out>
    def Shader "Shader" {{
        uniform token info:id = "arnold:standard_volume"
        {inputs}
        token outputs:out
    }}
}}
"""


def mean(folder: Path, text: str, **values: object) -> np.ndarray:
    """Mean colour and alpha of a picture through the middle of the voxels."""
    path = folder / f"stage{len(list(folder.iterdir()))}.usda"  # USD keeps layers that it has read
    path.write_text(f'#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = 1\n)\n{SKY}{CAMERA}{text}')
    image = primray.render(str(path), resolution=(32, 32), spp=1024, seed=3, **values)  # type: ignore[arg-type]
    return np.asarray(image.pixels, np.float64).reshape(-1, 4).mean(axis=0)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("split", [False, True])
def test_beer_and_lambert(tmp_path: Path, half: bool, split: bool) -> None:
    # Along the ray the values rise from 0 to 0.25 within one voxel, and fall likewise: 8 voxels in all.
    two = 0.125 if split else 0.25
    write(tmp_path, grid(two, half=half), grid(two, name="more", half=half))
    text = volume_text({"density": "", "more": ""} if split else None, bound="/Look")
    shader = 'float inputs:scatter = 0\ncolor3f inputs:transparent = (0.5, 0.25, 0.125)\nstring inputs:emission_mode = "none"'
    if split:
        text += text.replace('"Smoke"', '"Other"')
    found = mean(tmp_path, text + look(shader))
    expected = [0.5**2, 0.25**2, 0.125**2]
    np.testing.assert_allclose(found[:3], expected, rtol=0.015)
    assert found[3] == pytest.approx(1 - found[:3].mean(), abs=0.003)


@pytest.mark.filterwarnings("ignore")
def test_a_white_volume_in_a_white_sky_is_not_seen(tmp_path: Path) -> None:
    write(tmp_path, grid(0.5), grid((0.9, 0.6, 0.3), name="color", kind="vec3s"))
    text = volume_text(bound="/Look") + look("color3f inputs:scatter_color = (1, 1, 1)")
    np.testing.assert_allclose(mean(tmp_path, text, max_depth=200)[:3], 1, atol=2e-3)


@pytest.mark.filterwarnings("ignore")
def test_instances_far_from_the_origin(tmp_path: Path) -> None:
    write(tmp_path, grid(0.25))
    moved = 'double3 xformOp:translate = (100000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    text = f'def Xform "Far" {{\n{moved}\n{volume_text(bound="/Look")}\n}}' + look("float inputs:scatter = 0")
    found = mean(tmp_path, text, camera="/Cam")
    assert found[0] == pytest.approx(1)  # nothing is before this camera
    camera = CAMERA.replace("(3.5,", "(100000003.5,").replace('"Cam"', '"FarCam"')
    found = mean(tmp_path, text + camera, camera="/FarCam")
    assert found[0] == pytest.approx(math.exp(-2), rel=0.01)


@pytest.mark.filterwarnings("ignore")
def test_digests_know_volumes(tmp_path: Path) -> None:
    from primray.checkpoints.fingerprint import fingerprint
    from primray.diagnostics import Diagnostics
    from primray.settings import RenderSettings
    from primray.usd import open_stage, translate

    digests = []
    for value in (0.25, 0.5):
        write(tmp_path, grid(value))
        path = tmp_path / f"stage_{value}.usda"
        path.write_text(f"#usda 1.0\n{CAMERA}{volume_text()}")
        description, _ = translate(open_stage(str(path), Diagnostics()), RenderSettings())
        digests.append(fingerprint(description, {})["geometry"])
    assert digests[0] != digests[1]


@pytest.mark.filterwarnings("ignore")
def test_emission_adds_along_the_ray(tmp_path: Path) -> None:
    write(tmp_path, grid(0.25), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    text = volume_text({"emission": ""})
    found = mean(tmp_path, text)  # without a density there is no extinction: the sky is seen through it
    np.testing.assert_allclose(found[:3], 1 + 8 * np.array([0.1, 0.2, 0.3]), rtol=3e-3)


@pytest.mark.filterwarnings("ignore")
def test_kept_scenes_follow_edits_of_volumes(tmp_path: Path) -> None:
    write(tmp_path, grid(0.25))
    path = tmp_path / "stage.usda"
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text(bound='/Look')}{look('float inputs:density = 1')}")
    asked = {"resolution": (8, 8), "spp": 8, "seed": 1}
    scene = primray.Scene(str(path))
    try:
        density = scene.stage.GetPrimAtPath("/Look/Shader").GetAttribute("inputs:density")
        pixels = []
        for value in (1.0, 3.0, 3.0):
            density.Set(value)
            pixels.append(np.asarray(scene.render(**asked).pixels))  # type: ignore[arg-type]
            again = primray.render(scene.stage, **asked)  # type: ignore[arg-type]
            np.testing.assert_array_equal(pixels[-1], again.pixels)
        assert not np.array_equal(pixels[0], pixels[1])
        write(tmp_path, grid(1.0, tiles=[vdb.Tile((8, 0, 0), 8, 2.0)]))
        pixels.append(np.asarray(scene.render(**asked).pixels))  # type: ignore[arg-type]
        np.testing.assert_array_equal(pixels[-1], primray.render(scene.stage, **asked).pixels)  # type: ignore[arg-type]
        assert not np.array_equal(pixels[-1], pixels[-2])
    finally:
        scene.close()


@pytest.mark.filterwarnings("ignore")
def test_an_edit_of_a_density_factor_reads_no_voxels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from primray.diagnostics import Diagnostics
    from primray.incremental.scene import KeptStage
    from primray.report.report import Costs
    from primray.settings import RenderSettings
    from primray.usd import open_stage
    from primray.usd.volumes import files

    rng = np.random.default_rng(1)
    every = np.ones(512, bool)
    leaves = {(8 * x, 0, 0): vdb.Leaf(rng.random(512), every) for x in range(16)}
    write(tmp_path, vdb.Grid(name="density", leaves=leaves))
    path = tmp_path / "stage.usda"
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text(bound='/Look')}{look('float inputs:density = 1')}")
    stage, settings = open_stage(str(path), Diagnostics()), RenderSettings(resolution=(32, 32), spp=1)
    kept = KeptStage(stage, settings)
    read: list[str] = []

    def reading(data: bytes, grids: Sequence[GridInfo], info: GridInfo) -> VolumeGrid:
        read.append(info.name)
        return read_grid(data, grids, info)

    monkeypatch.setattr(files, "read_grid", reading)
    kept.prepare(settings, Costs(), Diagnostics())
    assert read == ["density"]
    density = stage.GetPrimAtPath("/Look/Shader").GetAttribute("inputs:density")
    for value in (2.0, 3.0, 4.0):
        density.Set(value)
        kept.prepare(settings, Costs(), Diagnostics())
    assert read == ["density"]


@pytest.mark.filterwarnings("ignore")
def test_inspect_lists_volumes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from primray.cli import run

    write(tmp_path, grid(0.25), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    path = tmp_path / "stage.usda"
    placed = "float3 xformOp:scale = (0.5, 2, 0.5)\ndouble3 xformOp:translate = (10, 0, 0)\n"
    placed += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text({'density': '', 'emission': ''}, placed)}")
    (found,) = primray.inspect(str(path))["volumes"]
    assert (found["path"], found["instances"]) == ("/Smoke", 1)
    assert [(g["name"], g["voxels"], g["size"]) for g in found["grids"]] == [
        ("density", 512, [8, 8, 8]),
        ("emission", 512, [8, 8, 8]),
    ]
    assert found["grids"][1]["bytes"] > 3 * 512 * 4
    assert [g["voxel_size"] for g in found["grids"]] == [[0.5, 2, 0.5]] * 2
    assert found["box"] == [[9.75, -1, -0.25], [13.75, 15, 3.75]]  # voxels' faces
    assert run(["inspect", str(path)]) == 0
    out = capsys.readouterr().out
    grids = "density 512 voxels in 8 x 8 x 8 of 0.5 x 2 x 0.5, 0.0 MiB; emission 512 voxels in 8 x 8 x 8 of 0.5 x 2 x 0.5"
    assert f"/Smoke, from (9.75, -1, -0.25) to (13.75, 15, 3.75): {grids}" in out


@pytest.mark.filterwarnings("ignore")
def test_estimate_counts_grids(tmp_path: Path) -> None:
    """The bytes of the grids, twice, are part of the estimate that the limit of memory is compared with."""
    write(tmp_path, grid(0.25))
    path = tmp_path / "stage.usda"
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text()}")
    facts = primray.inspect(str(path))
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}")
    plain = primray.inspect(str(path))
    more = facts["counts"]["memory_bytes"] - plain["counts"]["memory_bytes"]
    assert more >= 2 * facts["volumes"][0]["grids"][0]["bytes"]
    write(tmp_path, grid(0.25))
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{volume_text()}")
    cost = primray.estimate(str(path), [0.05], resolution=(16, 16), pilot_seconds=0.1)
    assert cost.predictions[0].seconds is not None
