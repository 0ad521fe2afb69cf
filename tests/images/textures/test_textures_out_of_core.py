"""Renders with a budget for textures have the pixels of those without, and say what they read."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray import RenderSettings
from primray.core import compiled
from primray.errors import AssetError

BUDGET = 4 << 20
SIZE = 1024


def write_image(path: Path, seed: int, kind: str = "uint8", channels: int = 3, size: int = SIZE, tile: int = 0) -> None:
    noise = np.random.default_rng(seed)
    coarse = noise.random((size // 8, size // 8, channels))
    texels = np.kron(coarse, np.ones((8, 8, 1))) * (1 if kind == "uint8" else 4)
    spec = oiio.ImageSpec(size, size, channels, kind)
    if tile:
        spec.tile_width = spec.tile_height = tile
    file = oiio.ImageOutput.create(str(path))
    assert file
    assert file.open(str(path), spec), oiio.geterror()
    assert file.write_image(texels.astype(np.float32)), file.geterror()
    file.close()


MATERIAL = """
    def Material "m{k}" {{
        token outputs:surface.connect = </looks/m{k}/s.outputs:surface>
        def Shader "s" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </looks/m{k}/t.outputs:rgb>
            float inputs:roughness.connect = </looks/m{k}/t.outputs:g>
            {more}
            token outputs:surface
        }}
        def Shader "t" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </looks/m{k}/r.outputs:result>
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "{wrap}"
            float3 outputs:rgb
            float outputs:g
            float outputs:a
        }}
        def Shader "r" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
"""
PLATE = """
def Mesh "p{k}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [({x}, 0, 0), ({x2}, 0, 0), ({x2}, 1, -0.6), ({x}, 1, -0.6)]
    texCoord2f[] primvars:st = [(0, 0), ({u}, 0), ({u}, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = </looks/m{k}>
}}
"""
HEAD = """#usda 1.0
(upAxis = "Y")
def Camera "cam" {
    double3 xformOp:translate = (2.5, 0.5, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "sun" {
    float inputs:intensity = 2
    double3 xformOp:rotateXYZ = (-40, 30, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five plates: PNG, JPEG, EXR in tiles, HDR, and a set of UDIM tiles that is cut out by its alpha."""
    folder = tmp_path_factory.mktemp("plates")
    write_image(folder / "a.png", 1)
    write_image(folder / "b.jpg", 2)
    write_image(folder / "c.exr", 3, "half", tile=64)
    write_image(folder / "d.hdr", 4, "float")
    for k in (1001, 1002):
        write_image(folder / f"e.{k}.tif", k, channels=4, tile=64)
    cut = "float inputs:opacity.connect = </looks/m4/t.outputs:a>\n float inputs:opacityThreshold = 0.3"
    looks = "".join(
        MATERIAL.format(k=k, file=file, wrap=wrap, more=cut if k == 4 else "")
        for k, (file, wrap) in enumerate(
            [
                ("./a.png", "mirror"),
                ("./b.jpg", "clamp"),
                ("./c.exr", "repeat"),
                ("./d.hdr", "black"),
                ("./e.<UDIM>.tif", "repeat"),
            ]
        )
    )
    plates = "".join(PLATE.format(k=k, x=k, x2=k + 0.95, u=2 if k in (0, 4) else 1) for k in range(5))
    path = folder / "plates.usda"
    path.write_text(f'{HEAD}{plates}\ndef Scope "looks" {{\n{looks}\n}}\n')
    return path


def rendered(stage: Path, **more: Any) -> dict[str, Any]:
    values: dict[str, Any] = {"resolution": (640, 128), "spp": 8, "camera": "/cam"}
    report: dict[str, Any] = dict(primray.render(str(stage), RenderSettings(**(values | more))).report)
    return report


def codes(report: dict[str, Any]) -> list[str]:
    return [d["code"] for d in report["diagnostics"]]


def test_pixels_do_not_depend_on_the_budget(stage: Path, tmp_path: Path) -> None:
    whole = rendered(stage)
    assert "texture_memory" not in whole
    assert "texture_memory_bytes" not in whole["settings"]
    cache = str(tmp_path / "cache")
    for k in range(2):  # the cache is cold, then warm
        little = rendered(stage, texture_memory_bytes=BUDGET, texture_cache=cache)
        assert little["pixels_sha256"] == whole["pixels_sha256"]
        facts = little["texture_memory"]
        assert facts["tiles_read"] > 100
        assert facts["tiles_evicted"] > 0
        assert facts["peak_bytes"] <= BUDGET + (1 << 20)
        assert (facts["cache"]["written"] > 0, facts["cache"]["found"] > 0) == (k == 0, k == 1)
        assert codes(little) == codes(whole)
    # Within the budget nothing is read by tile, and levels that are in the cache need not be made again.
    much = rendered(stage, texture_memory_bytes=1 << 30, texture_cache=cache)
    assert much["pixels_sha256"] == whole["pixels_sha256"]
    assert much["texture_memory"]["tiles_read"] == 0
    fresh = rendered(stage, texture_memory_bytes=1 << 30, texture_cache=str(tmp_path / "other"))
    assert fresh["pixels_sha256"] == whole["pixels_sha256"]
    assert fresh["texture_memory"]["cache"]["written"] == 0


def test_aovs_and_threads_see_the_same_texels(stage: Path, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"aovs": ("albedo", "normal"), "resolution": (320, 64)}
    whole = primray.render(str(stage), RenderSettings(spp=4, camera="/cam", **settings))
    for threads in (1, 3):
        out = RenderSettings(
            spp=4, camera="/cam", threads=threads, texture_memory_bytes=BUDGET, texture_cache=str(tmp_path), **settings
        )
        made = primray.render(str(stage), out)
        assert np.array_equal(made.pixels, whole.pixels)
        for name in ("albedo", "normal"):
            assert np.array_equal(made.aovs[name].values, whole.aovs[name].values)


def test_a_full_disk_gives_the_picture_and_a_diagnostic(stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise compiled.CoreError("texture-cache", os.strerror(errno.ENOSPC))

    whole = rendered(stage)
    monkeypatch.setattr(compiled, "write_tile_file", full)
    found = rendered(stage, texture_memory_bytes=BUDGET, texture_cache=str(tmp_path / "cache"))
    assert found["pixels_sha256"] == whole["pixels_sha256"]
    assert "texture-cache" in codes(found)
    assert not list((tmp_path / "cache").rglob("*.tiles"))


def test_a_damaged_entry_is_made_good_by_the_file(stage: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    whole = rendered(stage, texture_memory_bytes=BUDGET, texture_cache=str(cache))
    for path in cache.rglob("*.tiles"):
        path.write_bytes(path.read_bytes()[:5000])
    found = rendered(stage, texture_memory_bytes=BUDGET, texture_cache=str(cache))
    assert found["pixels_sha256"] == whole["pixels_sha256"]
    assert "texture-cache" in codes(found)


def test_a_disk_that_fails_while_rendering_is_an_error(stage: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    rendered(stage, texture_memory_bytes=BUDGET, texture_cache=str(cache))

    def cut(*_: float) -> bool:
        for path in cache.rglob("*.tiles"):
            os.truncate(path, 4096)  # as no process of ours does: reads fail like those of a disk that is gone
        return True

    settings = RenderSettings(
        resolution=(640, 128), spp=64, camera="/cam", texture_memory_bytes=BUDGET, texture_cache=str(cache)
    )
    with pytest.raises(AssetError) as error:
        primray.render(str(stage), settings, progress=cut)
    assert error.value.code == "texture-cache-damaged"


def test_kept_scenes_go_on_with_their_tiles(stage: Path, tmp_path: Path) -> None:
    opened = primray.Scene(str(stage))
    out: dict[str, Any] = {
        "texture_memory_bytes": BUDGET,
        "texture_cache": str(tmp_path / "cache"),
        "resolution": (320, 64),
        "spp": 4,
    }
    for region in (None, (0.2, 0.1, 0.7, 0.9), None):
        for camera in ("/cam", None):
            new = primray.render(str(stage), RenderSettings(resolution=(320, 64), spp=4, camera=camera, region=region))
            kept = opened.render(RenderSettings(camera=camera, region=region, **out))
            assert kept.report["pixels_sha256"] == new.report["pixels_sha256"]
    assert kept.report["texture_memory"]["tiles_read"] > 0
