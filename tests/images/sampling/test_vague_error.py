"""An error whose interval is of no use says which prim rules it; numbers of the core's rows give the paths that AOVs give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import primray
from primray import core
from primray.diagnostics import Diagnostics
from primray.render.prepare import open_once, prepare
from primray.report import vague_error
from primray.report.report import Costs
from primray.settings import RenderSettings

SCENES = Path(__file__).parents[3] / "scenes"


def test_a_vague_error_names_the_prim_that_rules_it() -> None:
    asked = RenderSettings(resolution=(80, 45), seed=1)
    vague = primray.render(SCENES / "gallery/motion/scene.usda", asked, spp=2, progress=False)
    found = vague.report["error_ruled_by"]
    low, high = vague.report["error"]["relmse"]["ci95"]
    assert f"a factor of {high / low:.3g}" in found["message"]
    assert "2 samples a pixel are few" in found["message"]
    assert vague.errors is not None
    part = (vague.errors.astype(np.float64) ** 2 / (vague.pixels[..., :3].astype(np.float64) ** 2 + 0.01)).mean(axis=2)
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
    monkeypatch.setattr(vague_error, "FACTOR", 1.0)
    monkeypatch.setattr(vague_error, "FEW_SAMPLES", 1)
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
    numbers = core.first_hits(prepared.scene, ["prim"], [], asked)["prim"]
    record, rows = prepared.scene.record, prepared.scene.uploaded.shape_rows
    assert record is not None
    assert (numbers >= 0).any() or (numbers <= -2).any()
    for number in np.unique(numbers).tolist():
        of_record = record.meshes[number] if number >= 0 else record.curved[-2 - number] if number <= -2 else None
        assert rows.path_of(number) == ("" if of_record is None else record.shape_paths[of_record[0]])
