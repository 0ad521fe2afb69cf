"""Lights of a view, weighed after the render: the mix of primray relight, its error, and no new render."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.errors import SettingsError
from primray.live.lights import weights_of
from primray.live.viewed_scene import ViewedScene
from primray.live.viewer import Looks, Viewer

STAGE = """#usda 1.0
def Sphere "s" {
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


class Watched:
    """A viewer that is at its finished picture."""

    def __init__(self, path: Path) -> None:
        path.write_text(STAGE)
        self.news = threading.Condition()
        self.viewer = Viewer(ViewedScene(str(path), primray.RenderSettings(resolution=(48, 32))), 8, Looks(), self.changed)
        self.viewer.start()
        self.until(finished)

    def changed(self) -> None:
        with self.news:
            self.news.notify_all()

    def until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        with self.news:
            assert self.news.wait_for(lambda: holds(self.viewer.state()), 60), self.viewer.state()
            return self.viewer.state()


def finished(state: dict[str, Any]) -> bool:
    return bool(state["phase"] == "finished")


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    made = Watched(tmp_path / "s.usda")
    yield made
    made.viewer.close()


def test_lights_are_mixed_as_relight_does_it_without_a_render(watched: Watched, tmp_path: Path) -> None:
    viewer = watched.viewer
    plain = viewer.view
    assert plain is not None
    assert not plain.image.aovs
    assert viewer.state()["lights"] is None
    viewer.tell({"do": "lights", "on": True})
    state = watched.until(lambda s: finished(s) and s["lights"] is not None)
    assert state["lights"]["names"] == ["key", "sky", "rest"]
    view = viewer.view
    assert view is not None
    assert np.array_equal(view.image.pixels, plain.image.pixels)

    weights = {"key": [0.25, 0.5, 1.0], "sky": 0}
    viewer.tell({"do": "mix", "weights": weights})
    state = watched.until(lambda s: s["lights"]["relmse"] is not None)
    assert viewer.view is view
    expected = primray.relight(view.image, {"key": (0.25, 0.5, 1.0), "sky": 0.0})
    assert viewer.shown is not None
    assert np.array_equal(viewer.shown.rgba, expected.to_uint8())
    expected.save(tmp_path / "expected.png", exposure=0.0)
    assert viewer.saved(".png") == (tmp_path / "expected.png").read_bytes()
    error = expected.report["error"]["relmse"]
    assert state["lights"]["relmse"] == [error["estimate"], *error["ci95"]]

    viewer.tell({"do": "lights", "on": False})
    watched.until(lambda s: finished(s) and s["lights"] is None)
    assert np.array_equal(viewer.shown.rgba, plain.image.to_uint8())


@pytest.mark.parametrize("given", [None, [], {"key": "bright"}, {"key": [1, 2]}, {"key": -1}, {"key": {}}, {"key": None}])
def test_weights_are_checked(given: object) -> None:
    with pytest.raises(SettingsError):
        weights_of(given)
