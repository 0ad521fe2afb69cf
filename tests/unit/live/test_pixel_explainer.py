"""Pixels explained beside a view: the picture's own light, of the last click only, and no reading of a stage that is closed."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.errors import SettingsError
from primray.explanation.explained import Explainer
from primray.live import pixel_explainer
from primray.live.pixel_explainer import as_json
from primray.live.viewed_scene import Size, ViewedScene

STAGE = """#usda 1.0
def Sphere "s" {
    color3f[] primvars:displayColor = [(0.8, 0.3, 0.1)]
}
def Plane "floor" {
    uniform token axis = "Y"
    double width = 20
    double length = 20
    double3 xformOp:translate = (0, -1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def SphereLight "key" {
    float inputs:intensity = 30
    double3 xformOp:translate = (3, 3, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky" {
}
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


class Viewed:
    """A scene with a picture, whose explanations are waited for."""

    def __init__(self, path: Path, **settings: Any) -> None:
        path.write_text(STAGE)
        self.path = str(path)
        self.scene = ViewedScene(self.path, primray.RenderSettings(resolution=(48, 32), spp=8, **settings))
        self.ended = threading.Event()
        self.scene.on_explained = self.ended.set
        self.render()

    def render(self) -> None:
        self.scene.render(Size(1.0, 2), lambda view: None, lambda: False, lambda: True)

    def explained(self, x: float, y: float) -> dict[str, Any]:
        self.ended.clear()
        self.scene.explain(x, y)
        assert self.ended.wait(60)
        assert self.scene.explanation is not None
        return as_json(self.scene.explanation, is_outdated=self.scene.is_explanation_outdated)


@pytest.fixture
def viewed(tmp_path: Path) -> Viewed:
    return Viewed(tmp_path / "s.usda")


def test_it_is_what_primray_explain_says(viewed: Viewed) -> None:
    found = viewed.explained(0.5, 0.95)
    expected = primray.explain(viewed.path, 24, 30, resolution=(48, 32), spp=8)
    assert (found["phase"], found["outdated"], found["pixel"]) == ("explained", False, [24, 30])
    assert found["value"] == list(expected.value)
    assert found["error"] == list(expected.error or ())
    for split, parts in zip(found["splits"], expected.splits.values(), strict=True):
        shares = sum(part["share"] for part in split["parts"]) + split["more_share"]
        assert shares == pytest.approx(1)
        assert [part["name"] for part in split["parts"]] == [part.name for part in parts][: len(split["parts"])]
    assert viewed.scene.selected is not None
    assert viewed.scene.selected.prim == "/floor"


def test_a_region_is_part_of_the_frame(tmp_path: Path) -> None:
    viewed = Viewed(tmp_path / "s.usda", region=(0.5, 0.0, 1.0, 0.5))
    assert viewed.explained(0.0, 0.5)["pixel"] == [24, 24]


def test_a_moved_camera_is_looked_through_and_later_moves_are_said(viewed: Viewed) -> None:
    before = viewed.explained(0.5, 0.5)
    viewed.scene.move(lambda orbit, camera: orbit.dollied(-2.0, camera))
    assert viewed.scene.is_explanation_outdated
    viewed.scene.drop_outdated_explanation()
    assert viewed.scene.explanation is not None
    viewed.scene.explain(0.5, 0.5)  # the picture is of the camera before: of which point is not known
    assert viewed.scene.explanation is None
    viewed.render()
    after = viewed.explained(0.5, 0.1)
    assert not after["outdated"]
    assert after["value"] != before["value"]


def test_the_last_click_counts(viewed: Viewed, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, goes_on = threading.Event(), threading.Event()
    made: list[tuple[float, float]] = []
    prepare_at = Explainer.prepare_at

    def waiting(self: Explainer, x: float, y: float, settings: primray.RenderSettings) -> Any:
        made.append((x, y))
        begun.set()
        assert goes_on.wait(60)
        return prepare_at(self, x, y, settings)

    monkeypatch.setattr(Explainer, "prepare_at", waiting)
    viewed.scene.explain(0.2, 0.2)
    assert begun.wait(60)
    viewed.scene.explain(0.4, 0.4)  # is over before it begins
    viewed.scene.explain(0.6, 0.6)
    goes_on.set()
    assert viewed.ended.wait(60)
    assert [x for x, _ in made] == pytest.approx([0.2, 0.6])
    explanation = viewed.scene.explanation
    assert explanation is not None
    assert explanation.pixel is not None
    assert explanation.pixel.pixel == (28, 19)


def test_a_plain_click_cancels_and_closing_waits(viewed: Viewed) -> None:
    viewed.scene.explain(0.5, 0.5)
    viewed.scene.select(0.5, 0.5)
    assert viewed.scene.explanation is None
    viewed.scene.explain(0.5, 0.5)
    viewed.scene.free()
    assert viewed.scene.explanation is None
    assert "explaining" not in {thread.name for thread in threading.enumerate()}
    assert not viewed.ended.is_set()


def test_what_prevents_it_is_said(viewed: Viewed, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise SettingsError("no", where="/x", code="explain-pixel")

    monkeypatch.setattr(pixel_explainer, "explained", refuse)
    found = viewed.explained(0.5, 0.5)
    assert (found["phase"], found["problem"]["code"], found["problem"]["where"]) == ("failed", "explain-pixel", "/x")
