"""Parts of a frame, and what lies beyond it: the same pixels to the bit, and files that say where they belong."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.unit.usd.usd_text import stage_of

import primray
from primray import RenderSettings
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli.commands.inspect import camera_rows
from primray.compare.comparison import compare
from primray.description.scene import Frame, PixelWindow
from primray.diagnosis.inspection import camera_facts
from primray.errors import CheckpointError, InvalidSceneError, LimitError, SettingsError
from primray.images.reading import read_measured
from primray.usd import translate

RESOLUTION = (50, 36)
SCENE = """
def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float2 clippingRange = (0.01, 100)
    float fStop = 2
    float focusDistance = 6
    float horizontalApertureOffset = 2
}
def Sphere "ball"
{
    color3f[] primvars:displayColor = [(0.8, 0.3, 0.2)]
}
def Cube "wall"
{
    double3 xformOp:translate = (0, -2, -4)
    float3 xformOp:scale = (5, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
def Mesh "cage"
{
    point3f[] points = [(-3, 0, 0), (-1, 0, 0), (-1, 2, 0), (-3, 2, 1), (1, 0, 1), (3, 0, 0), (3, 2, 0), (1, 2, 0)]
    int[] faceVertexCounts = [4, 4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 7, 2, 4, 5, 6, 7]
}
def RectLight "panel"
{
    double3 xformOp:translate = (0, 3, 3)
    double xformOp:rotateX = -60
    float inputs:width = 4
    float inputs:height = 3
    float inputs:intensity = 5
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def DomeLight "sky"
{
    float inputs:intensity = 0.2
}
def RenderSettings "settings"
{
    rel camera = </eye>
    WINDOW
}
"""


def text_of(window: str) -> str:
    return SCENE.replace("WINDOW", f"uniform float4 dataWindowNDC = {window}")


@cache
def rendered(window: str = "(0, 0, 1, 1)", **settings: Any) -> primray.Image:
    return primray.render(stage_of(text_of(window)), RenderSettings(**{"resolution": RESOLUTION, "spp": 8, **settings}))


def part_of(image: primray.Image, pixels: PixelWindow) -> tuple[slice, slice]:
    at = image.frame.pixels if image.frame is not None else PixelWindow(0, 0, *image.resolution)
    x, y = pixels.x - at.x, pixels.y - at.y
    return slice(y, y + pixels.height), slice(x, x + pixels.width)


@pytest.mark.conforms("RenderSettingsBase.dataWindowNDC")
@pytest.mark.parametrize("window", ["(0.3, 0.1, 0.7, 0.8)", "(0, 0, 0.02, 1)", "(0.61, 0.61, 0.65, 0.68)"])
def test_a_part_has_the_same_bits_as_the_whole(window: str) -> None:
    whole, part = rendered(), rendered(window)
    assert part.frame is not None
    assert part.frame.resolution == RESOLUTION
    assert part.resolution == part.frame.size != RESOLUTION
    where = part_of(whole, part.frame.pixels)
    np.testing.assert_array_equal(whole.pixels[where], part.pixels)
    assert whole.errors is not None
    np.testing.assert_array_equal(whole.errors[where], part.errors)


@pytest.mark.conforms("RenderSettingsBase.dataWindowNDC")
def test_overscan_adds_around_the_same_bits() -> None:
    """All but cages, which are diced for what is seen beyond the frame as well."""
    smooth = "point3f[] points"
    whole, wide = (
        primray.render(
            stage_of(text_of(window).replace(smooth, 'uniform token subdivisionScheme = "none"\n' + smooth)),
            RenderSettings(resolution=RESOLUTION, spp=8),
        )
        for window in ("(0, 0, 1, 1)", "(-0.2, -0.5, 1.3, 1.25)")
    )
    assert wide.frame == Frame(RESOLUTION, PixelWindow(-10, -9, 75, 63))
    np.testing.assert_array_equal(wide.pixels[part_of(wide, PixelWindow(0, 0, *RESOLUTION))], whole.pixels)
    assert wide.pixels[..., 3][:, :10].any()  # and there is something beyond


@pytest.mark.conforms("RenderSettingsBase.dataWindowNDC")
def test_overscan_is_what_a_wider_window_shows() -> None:
    """The frame's window continued: a camera with twice the aperture shows the same, to its noise."""
    wide = rendered("(-0.5, -0.5, 1.5, 1.5)", spp=64)
    twice = SCENE.replace("WINDOW", "").replace(
        "float fStop", "float horizontalAperture = 41.91\nfloat verticalAperture = 30.5816\nfloat fStop"
    )
    other = primray.render(stage_of(twice), RenderSettings(resolution=(100, 72), spp=64))
    assert wide.pixels.shape == other.pixels.shape
    assert np.abs(wide.pixels - other.pixels).mean() < 0.02
    assert abs(wide.pixels.mean() - other.pixels.mean()) < 0.002


# Files.


def spec_of(path: Path) -> Any:
    found = oiio.ImageInput.open(str(path))
    assert found is not None
    spec = found.spec()
    found.close()
    return spec


@pytest.mark.conforms("RenderSettingsBase.dataWindowNDC", "RenderSettingsBase.resolution")
@pytest.mark.parametrize("window", ["(0.3, 0.1, 0.7, 0.8)", "(-0.2, -0.5, 1.3, 1.25)", "(2, 2, 2.5, 2.5)"])
def test_exr_windows(window: str, tmp_path: Path) -> None:
    image = rendered(window)
    spec = spec_of(image.save(tmp_path / "a.exr"))
    assert image.frame is not None
    p = image.frame.pixels
    assert (spec.x, spec.y, spec.width, spec.height) == (p.x, p.y, p.width, p.height)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, *RESOLUTION)
    back = read_measured(tmp_path / "a.exr")
    assert back.frame == image.frame
    np.testing.assert_array_equal(back.pixels, image.pixels[..., :3])
    assert back.samples == 8
    png = spec_of(image.save(tmp_path / "a.png"))
    assert (png.width, png.height) == image.resolution  # what was rendered, no more


@pytest.mark.conforms("RenderSettingsBase.pixelAspectRatio", "RenderSettingsBase.aspectRatioConformPolicy")
def test_pixel_aspect_in_files(tmp_path: Path) -> None:
    def written(body: str) -> float:
        image = primray.render(stage_of(SCENE.replace("WINDOW", body)), RenderSettings(resolution=(20, 10), spp=2))
        return float(spec_of(image.save(tmp_path / "a.exr")).get_float_attribute("PixelAspectRatio"))

    assert written("") == 1
    assert written("uniform float pixelAspectRatio = 1.5") == 1.5
    adjust = 'uniform float pixelAspectRatio = 1.5\nuniform token aspectRatioConformPolicy = "adjustPixelAspectRatio"'
    assert written(adjust) == pytest.approx(20.955 / 15.2908 / 2, rel=1e-6)


# Everything that holds pixels by their place.


def test_report_and_samples() -> None:
    image = rendered("(0.3, 0.1, 0.7, 0.8)")
    width, height = image.resolution
    assert image.report["samples"] == width * height * 8
    assert image.report["samples_per_pixel"] == [8, 8]
    assert image.report["settings"]["resolution"] == list(RESOLUTION)
    pixels = {"x": 15, "y": 7, "width": width, "height": height}
    assert image.report["frame"] == {"resolution": RESOLUTION, "pixels": pixels, "pixel_aspect_ratio": 1.0}


def test_inspecting() -> None:
    text = text_of("(0.3, 0.1, 0.7, 0.8)\nuniform float pixelAspectRatio = 2")
    facts = {"camera": camera_facts(translate(stage_of(text), RenderSettings(resolution=RESOLUTION))[0]), "cameras": ["/eye"]}
    rows = dict(camera_rows(facts, None))
    assert rows["data window"] == "20 x 25 pixels from (15, 7)"
    assert rows["pixel aspect"] == "2"


def test_adaptive_sampling() -> None:
    image = rendered("(-0.1, 0.1, 0.7, 0.8)", spp=256, target_error=0.02)
    assert image.report["stop"]["target_met"] is not None
    assert np.isfinite(image.pixels).all()


def test_checkpoints(tmp_path: Path) -> None:
    window, path = "(-0.2, 0.2, 0.5, 0.9)", tmp_path / "a.prc"

    def run(window: str, spp: int, **saved: Any) -> primray.Image:
        settings = RenderSettings(resolution=RESOLUTION, spp=spp)
        return primray.render(stage_of(text_of(window)), settings, checkpointing=Checkpointing(path, 60, **saved))

    run(window, 4)
    with pytest.raises(CheckpointError, match="the scene's frame has changed"):
        run("(0, 0, 1, 1)", 8, resume=path)
    with pytest.raises(CheckpointError, match="the scene's frame has changed"):
        run("(-0.2, 0.3, 0.5, 1)", 8, resume=path)
    np.testing.assert_array_equal(run(window, 8, resume=path).pixels, rendered(window).pixels)


def test_merging(tmp_path: Path) -> None:
    window = "(-0.2, 0.2, 0.5, 0.9)"
    parts = []
    for a, b in ((0, 4), (4, 8)):
        parts.append(tmp_path / f"{a}.prc")
        settings = RenderSettings(resolution=RESOLUTION, sample_range=(a, b))
        primray.render(stage_of(text_of(window)), settings, checkpointing=Checkpointing(parts[-1], 60))
    merged = merge(parts).image
    np.testing.assert_array_equal(merged.pixels, rendered(window).pixels)
    assert merged.frame == rendered(window).frame


def test_comparing(tmp_path: Path) -> None:
    def saved(window: str, name: str, **settings: Any) -> Any:
        return read_measured(rendered(window, **settings).save(tmp_path / name))

    a, b = saved("(0, 0.1, 0.5, 0.9)", "a.exr", spp=16), saved("(0, 0.1, 0.5, 0.9)", "b.exr", spp=16, seed=1)
    assert compare(a, b).verdict.value != "different"
    moved = saved("(0.5, 0.1, 1, 0.9)", "c.exr", spp=16)
    assert moved.resolution == a.resolution
    with pytest.raises(SettingsError, match="different parts"):
        compare(a, moved)


def test_windows_that_hold_nothing_or_too_much() -> None:
    with pytest.raises(InvalidSceneError, match="centre") as error:
        translate(stage_of(text_of("(0.501, 0, 0.502, 1)")), RenderSettings(resolution=RESOLUTION))
    assert (error.value.code, error.value.where) == ("empty-data-window", "/settings")
    for window in ("(-1e9, 0, 1, 1)", "(0, 0, 3e38, 1)", "(0, -5000, 1, 1)"):
        with pytest.raises(LimitError, match="pixels"):
            translate(stage_of(text_of(window)), RenderSettings(resolution=RESOLUTION))
    with pytest.raises(LimitError, match="pixels"):
        translate(stage_of(text_of("(-3, -3, 4, 4)")), RenderSettings(resolution=(10_000, 10_000)))
