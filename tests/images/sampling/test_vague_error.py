"""An error whose interval is of no use says which prim rules it; numbers of the core's rows give the paths that AOVs give."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import core
from primray.cli import run
from primray.diagnostics import Diagnostics
from primray.render.prepare import open_once, prepare
from primray.report import vague_error
from primray.report.report import Costs
from primray.sampling import prediction
from primray.sampling.prediction import run_pilot
from primray.settings import RenderSettings

SCENES = Path(__file__).parents[3] / "scenes"


def test_a_vague_error_names_the_prim_that_rules_it(monkeypatch: pytest.MonkeyPatch) -> None:
    parts, weigh = [], core.Film.error_parts

    def noting(*of: Any) -> Any:
        parts.append(weigh(*of))
        return parts[-1]

    monkeypatch.setattr(core.Film, "error_parts", noting)
    asked = RenderSettings(resolution=(80, 45), seed=1)
    vague = primray.render(SCENES / "gallery/motion/scene.usda", asked, spp=2, progress=False)
    found = vague.report["error_ruled_by"]
    low, high = vague.report["error"]["relmse"]["ci95"]
    assert f"a factor of {high / low:.3g}" in found["message"]
    assert "2 samples a pixel are too few" in found["message"]
    part = parts[0]
    y, x = np.unravel_index(part.argmax(), part.shape)
    seen = primray.render(SCENES / "gallery/motion/scene.usda", asked, spp=2, aovs=("prim",), progress=False).aovs["prim"]
    assert f"({x}, {y})" in found["message"]
    assert found["pixel"] == [x, y]
    assert found["prim"] == seen.ids.get(int(seen.values[y, x, 0]), "")


def test_an_error_that_is_known_says_nothing_more() -> None:
    image = primray.render(SCENES / "analytic/cse168_project1.usda", resolution=(40, 30), spp=8, progress=False)
    assert "error_ruled_by" not in image.report


@pytest.mark.parametrize("denoise", [False, True])
def test_denoising_is_advised_where_it_was_not_asked_for(denoise: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if denoise:
        pytest.importorskip("pyoidn")
    monkeypatch.setattr(vague_error, "VAGUE_FACTOR", 1.0)
    monkeypatch.setattr(vague_error, "FEW_SAMPLES", 1)
    monkeypatch.setattr(vague_error, "find_rare_paths", lambda *_: None)  # a light's outline, here
    asked = RenderSettings(resolution=(16, 12), spp=8, denoise=denoise)
    image = primray.render(SCENES / "analytic/cse168_project1.usda", asked, progress=False)
    assert ("--denoise" in image.report["error_ruled_by"]["message"]) != denoise
    assert "a larger light" in image.report["error_ruled_by"]["message"]


FEATURES = ["curves", "nested-instancers", "opacity-texture", "implicit-shapes", "motion-points", "native-instances"]


@pytest.mark.parametrize("name", FEATURES)
def test_rows_have_the_paths_that_aovs_have(name: str) -> None:
    (scene,) = sorted(SCENES.glob(f"features/{name}/*.usda"))[:1] or pytest.fail(f"no scene {name}")
    asked = RenderSettings(resolution=(64, 36), aovs=("prim",))
    opened = open_once(scene, asked)
    prepared = prepare(opened.stage, opened.diagnostics, asked, Costs(), Diagnostics())
    numbers = core.first_hits(prepared.scene, ["prim"], [], asked).planes["prim"]
    assert prepared.scene.uploaded is not None
    record, rows = prepared.scene.record, prepared.scene.uploaded.shape_rows
    assert record is not None
    assert (numbers >= 0).any() or (numbers <= -2).any()
    for number in np.unique(numbers).tolist():
        of_record = record.meshes[number] if number >= 0 else record.curved[-2 - number] if number <= -2 else None
        assert rows.path_of(number) == ("" if of_record is None else record.shape_paths[of_record[0]])


def balls() -> str:
    """A gold and a glass ball above a floor, which make few bright pixels of the studio light."""
    materials = {
        "gold": ("(1, 0.77, 0.34)", "metallic = 1", "roughness = 0.2"),
        "glass": ("(1, 1, 1)", "opacity = 0.1", "roughness = 0.02"),
    }
    text = "#usda 1.0\n"
    for k, (name, (color, *inputs)) in enumerate(materials.items()):
        floats = "\n".join(f"float inputs:{each}" for each in inputs)
        text += f"""
def Sphere "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    double3 xformOp:translate = ({2.4 * k}, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </m{k}>
}}
def Material "m{k}"
{{
    token outputs:surface.connect = </m{k}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {color}
        {floats}
        token outputs:surface
    }}
}}
"""
    return text


def pilot_of_16_samples(scene: Any, settings: RenderSettings, seconds: float, progress: Any = None) -> Any:
    """A pilot that does not depend on how fast the machine is."""
    with pytest.MonkeyPatch.context() as limited:
        limited.setattr(prediction, "MAX_SPP", 16)
        return run_pilot(scene, settings, 60.0, progress)


@pytest.mark.parametrize("seed", [0, 7])
def test_a_render_that_waits_for_a_vague_error_says_so_and_an_estimate_counts_the_wait(
    tmp_path: Path, seed: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "balls.usda").write_text(balls())
    size, target = (48, 27), 0.2
    monkeypatch.setattr(prediction, "run_pilot", pilot_of_16_samples)
    cost = primray.estimate(tmp_path / "balls.usda", [target], resolution=size, seed=seed)
    assert cost.error.value < target < cost.error.high  # so the pilot alone does not answer
    samples = cost.predictions[0].samples
    assert samples is not None
    flags = [
        "render",
        str(tmp_path / "balls.usda"),
        "-r",
        *map(str, size),
        "--seed",
        str(seed),
        "--report",
        str(tmp_path / "r.json"),
    ]
    assert run([*flags, "--target-error", str(target), "-o", str(tmp_path / "a.exr")]) == 0
    took = json.loads((tmp_path / "r.json").read_text())["samples"] / (size[0] * size[1])
    assert samples.low <= took <= samples.high
    assert "so the render continued" in capsys.readouterr().out
    assert run([*flags, "--spp", "8", "-o", str(tmp_path / "a.exr")]) == 0
    assert "continued" not in capsys.readouterr().out


def test_the_shadow_of_a_ground_counts_in_an_estimate(tmp_path: Path) -> None:
    (tmp_path / "balls.usda").write_text(balls())
    bare, shadow = (
        primray.estimate(tmp_path / "balls.usda", [0.1], resolution=(64, 36), ground=ground, pilot_seconds=0.3)
        for ground in (None, "shadow")
    )
    beyond_samples = []
    for cost in (bare, shadow):
        samples, seconds = cost.predictions[0].samples, cost.predictions[0].seconds
        assert samples is not None
        assert seconds is not None
        assert seconds.low < seconds.value < seconds.high
        beyond_samples.append(seconds.high / seconds.low / (samples.high / samples.low))
    assert beyond_samples[1] == pytest.approx(2 * beyond_samples[0])
