"""A survey that passes rays through things only where their boxes are counts what one of all pixels does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.labels.layers import PartNames
from primray.labels.survey import Survey

STAGE = """#usda 1.0
def Xform "car" (prepend apiSchemas = ["SemanticsLabelsAPI:class"])
{
    token[] semantics:labels:class = ["car"]
    def Cube "body"
    {
        double size = 1
    }
    def Sphere "wheel" (prepend apiSchemas = ["SemanticsLabelsAPI:class"])
    {
        token[] semantics:labels:class = ["wheel"]
        double radius = 0.3
        double3 xformOp:translate = (0.3, -0.5, 0.5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def BasisCurves "rope" (prepend apiSchemas = ["SemanticsLabelsAPI:class"])
{
    token[] semantics:labels:class = ["rope"]
    uniform token type = "linear"
    int[] curveVertexCounts = [3]
    point3f[] points = [(-2, -1, -0.5), (0, 1.5, -1), (3, 0, 0.7)]
    float[] widths = [0.2] (interpolation = "constant")
}
def Cube "wall"
{
    double size = 1
    float3 xformOp:scale = (1, 4, 0.1)
    double3 xformOp:translate = (-0.4, 0, 0.9)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""
PLACES = {"before": (0.2, 0.1, 3.0), "cut off": (1.4, 0.3, 1.2), "between": (0.35, -0.3, 0.95), "inside": (0.0, 0.0, 0.0)}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("aovs", [[], ["depth", "prim"]])
def test_rays_within_boxes_find_what_all_rays_find(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, aovs: list[str]
) -> None:
    stage = tmp_path / "yard.usda"
    stage.write_text(STAGE)
    pose = np.eye(4)
    pose[:3, 3] = PLACES[place]
    asked: dict[str, Any] = {
        "camera": primray.Camera.from_field_of_view(60, (60, 44), pose),
        "resolution": (60, 44),
        "aovs": [*aovs, "object_instance:class"],
    }
    scene = primray.Scene(str(stage))
    few = scene.first_hits(**asked)
    monkeypatch.setattr(Survey, "boxes_hold_things", False)
    every = scene.first_hits(**asked)
    assert few.things == every.things
    assert any(thing.pixels_in_frame > thing.pixels_visible for thing in few.things) or place != "before"
    assert np.array_equal(few.aovs["object_instance:class"].values, every.aovs["object_instance:class"].values)


class _Named:
    def name_of_part(self, shape: int, instance: int, outer: int) -> tuple[str, str]:
        return f"/{shape}/{instance}/{outer}", ""


@pytest.mark.parametrize("spread", [3, 5000])
def test_parts_have_the_numbers_of_their_names(spread: int) -> None:
    chance = np.random.default_rng(1)
    what = chance.integers(-1, spread, (400, 3)).astype(np.int32)
    names = PartNames(_Named())  # type: ignore[arg-type]
    numbers = names.number(what)
    assert [names.names[n][0] for n in numbers.tolist()] == ["/" + "/".join(map(str, part)) for part in what.tolist()]
    assert names.number(what[:0]).shape == (0,)
