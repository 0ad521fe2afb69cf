"""An explained pixel is the picture's: parts of each split add up to it to the bit, and agree with what outputs say of them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.cli import run
from primray.errors import SettingsError
from primray.explanation.explained import SPLITS, Explainer
from primray.explanation.parts import UNKNOWN
from primray.explanation.pixel import BOUNCES, EXPRESSIONS, PixelRender, pixel_of, sums_of
from primray.incremental.scene import KeptStage
from primray.settings import RenderSettings

SCENES = Path(__file__).parents[3] / "scenes"
SIZE, SPP = (24, 16), 8
PIXELS = ((12, 8), (5, 11), (20, 4))
# Glass, emission, media, domes, many lights, hair, instances, thin surfaces, lenses that absorb, mesh lights, volumes.
STAGES = (
    *("glass", "emission", "interiors", "dome-texture", "light-sphere", "hair", "nested-instancers", "opacity-texture"),
    *("lens-flaws", "native-instances", "motion-lights", "display-opacity", "light-distant"),
)


def stage_of(name: str) -> Path:
    return min((SCENES / "features" / name).glob("*.usda"))


def settings(**values: Any) -> RenderSettings:
    asked: dict[str, Any] = {"resolution": SIZE, "spp": SPP} | values
    return RenderSettings(**asked)


def adds_up(pixel: primray.ExplainedPixel) -> bool:
    """Return whether the parts of each split round to the pixel."""
    return all(
        np.float32(math.fsum(part.value[c] for part in pixel.splits[name])) == np.float32(pixel.value[c])
        for name in SPLITS
        for c in range(3)
    )


@pytest.mark.parametrize("name", STAGES)
def test_parts_add_up_to_the_picture_to_the_bit(name: str) -> None:
    stage, asked = stage_of(name), settings()
    explainer = Explainer(KeptStage(stage, asked))
    image = primray.render(stage, asked, progress=False)
    for x, y in PIXELS:
        pixel = explainer.explain(x, y, asked, renders=0)
        assert list(pixel.value) == image.pixels[y, x, :3].astype(float).tolist()
        assert adds_up(pixel)
        check_film(explainer.prepare(x, y, asked))


def check_film(render: PixelRender) -> None:
    """Check that the film holds the whole numbers of the log, and that bounces of both agree."""
    film = render.film(0, render.span)
    samples = list(render.samples(0, render.span))
    sums = sums_of(samples, "light")
    state = film.state()
    numbers = state["parts"].reshape(2, 3, 2).tolist()
    assert sums.totals() == [[int(high) * 2**40 + int(low) for high, low in row] for row in numbers]
    assert UNKNOWN not in sums.parts
    outputs = render.outputs(film)
    largest = max(float(pixel_of(film)[0].max()), 1e-3)
    by_bounce: dict[int, Any] = {}
    for sample in samples:
        total = np.sum([path.adds for path in sample.paths], axis=0) if sample.paths else np.zeros(3)
        scale = np.divide(sample.value, total, out=np.ones(3), where=total != 0)  # what the lens lets through
        for path in sample.paths:
            by_bounce[path.way.count] = by_bounce.get(path.way.count, 0) + np.array(path.adds) * scale
    for bounce, text in enumerate(list(BOUNCES.values())[:-1]):
        logged = by_bounce.get(bounce, np.zeros(3)) / len(samples) * render.scale
        np.testing.assert_allclose(outputs[text][0], logged, rtol=1e-3, atol=1e-5 * largest)


@pytest.mark.parametrize("values", [{"clamp_indirect": 0.05}, {"caustics": False}, {"sample_range": (4, 8), "spp": None}])
def test_what_the_picture_leaves_out_is_in_no_part(values: Mapping[str, Any]) -> None:
    """Without caustics a sample is made of the light of its kinds of path, so that its last bit depends on which are told."""
    stage, asked = stage_of("glass"), settings(**values)
    image = primray.render(stage, asked, aovs=() if asked.caustics else EXPRESSIONS, progress=False)
    pixel = primray.explain(stage, 12, 8, asked, renders=0)
    assert list(pixel.value) == image.pixels[8, 12, :3].astype(float).tolist()
    assert adds_up(pixel)
    assert "caustic" not in [part.name for part in pixel.splits["kind"]] or values.get("caustics", True)


def test_light_by_light_is_what_the_output_lights_holds() -> None:
    path = stage_of("glass")
    image = primray.render(path, settings(aovs=("lights", "C<.D>[LO]")), progress=False)
    pixel = primray.explain(path, 12, 8, settings(), renders=0)
    own = {part.name.rpartition("/")[2]: part.value for part in pixel.splits["light"]}
    for name, value in own.items():
        np.testing.assert_allclose(image.aovs[f"lights.{name}"].values[8, 12], value, rtol=1e-5, atol=1e-7)
    kind = {part.name: part for part in pixel.splits["kind"]}["direct diffuse"]
    assert kind.expression == "C<.D>[LO]"
    np.testing.assert_allclose(image.aovs["C<.D>[LO]"].values[8, 12], kind.value, rtol=2e-7)


ROOM = """#usda 1.0
(upAxis = "Y")
def Camera "cam" { float focalLength = 18
    double3 xformOp:translate = (0, 1.5, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def RectLight "lamp" { float inputs:intensity = 5
    double3 xformOp:translate = (0, 2.9, 0)
    float3 xformOp:rotateXYZ = (-90, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Mesh "floor" { int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)]
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def Mesh "red" { int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, 0, -2), (-2, 0, 2), (-2, 3, 2), (-2, 3, -2)]
    color3f[] primvars:displayColor = [(0.8, 0.05, 0.05)]
    bool doubleSided = 1
}
"""


def test_a_red_wall_sends_red_light_to_the_floor(tmp_path: Path) -> None:
    (tmp_path / "room.usda").write_text(ROOM)
    asked = RenderSettings(resolution=(32, 24), spp=256)
    pixel = primray.explain(tmp_path / "room.usda", 9, 18, asked, renders=4)
    assert pixel.shown is not None
    assert pixel.shown.prim == "/floor"
    parts = {part.name: part for part in pixel.splits["prim"]}
    assert set(parts) == {"/lamp", "/red"}
    assert parts["/red"].value[0] > 8 * parts["/red"].value[1] > 0
    assert parts["/red"].share_error is not None
    assert parts["/red"].share > 5 * parts["/red"].share_error > 0
    assert [part.name for part in pixel.splits["light"]] == ["/lamp"]
    assert pixel.splits["light"][0].share == 1
    assert {part.name for part in pixel.splits["kind"]} == {"direct diffuse", "indirect diffuse"}


def test_the_command_says_what_the_library_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "room.usda").write_text(ROOM)
    line = ["explain", str(tmp_path / "room.usda"), "--pixel", "9", "18", "--res", "32", "24", "--spp", "16", "--renders", "4"]
    assert run(line) == 0
    text = capsys.readouterr().out
    assert "by the prim that sends it here" in text
    assert "/red" in text
    assert run([*line, "--json", "--report", str(tmp_path / "pixel.json")]) == 0
    printed = json.loads(capsys.readouterr().out)
    asked = RenderSettings(resolution=(32, 24), spp=16)
    expected = primray.explain(tmp_path / "room.usda", 9, 18, asked, renders=4).as_json()
    assert printed["splits"] == expected["splits"]
    assert json.loads((tmp_path / "pixel.json").read_text())["splits"] == expected["splits"]


def test_pixels_and_renders_that_cannot_be_are_refused(tmp_path: Path) -> None:
    (tmp_path / "room.usda").write_text(ROOM)
    with pytest.raises(SettingsError, match="the frame has 32 x 24 pixels, and none at 32 0") as refused:
        primray.explain(tmp_path / "room.usda", 32, 0, resolution=(32, 24))
    assert refused.value.code == "explain-pixel"
    with pytest.raises(SettingsError, match="2 renders or more") as refused:
        primray.explain(tmp_path / "room.usda", 0, 0, resolution=(32, 24), renders=1)
    assert refused.value.code == "explain-renders"


def test_last_rays_tell_domes_apart(tmp_path: Path) -> None:
    """Where only domes can be found, last rays ask whether any is seen: each has its part of what arrives."""
    domes = "".join(
        f'def DomeLight "{name}" {{ float inputs:intensity = 1\n    color3f inputs:color = {color}\n}}\n'
        for name, color in (("warm", "(0.6, 0.2, 0)"), ("cold", "(0.2, 0.2, 0.8)"))
    )
    (tmp_path / "open.usda").write_text(ROOM.replace('RectLight "lamp"', 'Xform "lamp"') + domes)
    pixel = primray.explain(tmp_path / "open.usda", 9, 18, resolution=(32, 24), spp=16, max_depth=2, renders=0)
    assert adds_up(pixel)
    parts = {part.name: part.value for part in pixel.splits["light"]}
    assert set(parts) == {"/warm", "/cold"}
    assert parts["/warm"][0] == pytest.approx(3 * parts["/cold"][0], rel=1e-5)
    assert parts["/warm"][1] == pytest.approx(parts["/cold"][1], rel=1e-5)
    assert parts["/warm"][2] == 0 < parts["/cold"][2]
    assert {path.light for path in pixel.noise} == {"/warm", "/cold"}


CROPPED = """
def RenderSettings "settings" { uniform int2 resolution = (32, 24)
    rel camera = </cam>
    uniform float4 dataWindowNDC = (%s, %s, %s, %s)
}
"""


def windowed(tmp_path: Path, *window: float) -> Path:
    path = tmp_path / "windowed.usda"
    head = '(renderSettingsPrimPath = "/settings"\nupAxis = "Y")'
    path.write_text(ROOM.replace('(upAxis = "Y")', head) + CROPPED % window)
    return path


def test_an_overlay_shows_the_whole_frame_of_a_stage_that_orders_a_part(tmp_path: Path) -> None:
    line = ["explain", str(windowed(tmp_path, 0.25, 0.25, 0.75, 0.75)), "--pixel", "9", "18", "--spp", "4", "--renders", "0"]
    assert run([*line, "--overlay", str(tmp_path / "paths.png")]) == 0
    assert primray.render(windowed(tmp_path, 0.25, 0.25, 0.75, 0.75), spp=1, progress=False).resolution == (16, 12)


def test_pixels_of_an_overscan_are_refused_in_words(tmp_path: Path) -> None:
    stage = windowed(tmp_path, -0.25, -0.25, 1.25, 1.25)
    assert primray.explain(stage, 31, 23, spp=2, renders=0).frame == (32, 24)
    with pytest.raises(SettingsError, match="pixels of an overscan are not explained"):
        primray.explain(stage, -4, 0, spp=2, renders=0)


def test_how_a_picture_stops_does_not_matter() -> None:
    stop = {"target_error": 0.01, "adaptive": True, "aovs": ("lights",), "stop_at": "mix", "mixes": ("rest=2",)}
    pixels = [primray.explain(stage_of("glass"), 12, 8, settings(**values), renders=0) for values in ({}, stop)]
    assert pixels[0].value == pixels[1].value


def test_where_nothing_is_there_are_no_parts(tmp_path: Path) -> None:
    (tmp_path / "room.usda").write_text(ROOM)
    pixel = primray.explain(tmp_path / "room.usda", 31, 0, resolution=(32, 24), spp=4, renders=4)
    assert pixel.shown is None
    assert pixel.value == (0, 0, 0)
    assert not any(pixel.splits.values())
    assert pixel.lines()


def test_a_notebook_shows_the_text(tmp_path: Path) -> None:
    (tmp_path / "<room>.usda").write_text(ROOM)
    pixel = primray.explain(tmp_path / "<room>.usda", 9, 18, resolution=(32, 24), spp=4, renders=0)
    shown = pixel._repr_html_()
    assert "&lt;room&gt;.usda, pixel 9 18" in shown
    assert "by the prim that sends it here" in shown
    assert "<room>" not in shown
