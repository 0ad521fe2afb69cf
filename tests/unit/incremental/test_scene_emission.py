"""Stages that only emission lights: the test render that decides on a studio light uses the kept scene."""

from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd

import primray
from primray import core, staging
from primray.settings import RenderSettings

from ...images.test_studio_where_it_is_dark import BODY, BOUND, GLOW, LED, ball, stage_of

pytestmark = pytest.mark.filterwarnings("ignore::primray.RenderWarning")
# From the right the lamp lights what is seen, from the left next to nothing does.
LAMP = ball("lamp", 1, (6, 0, 0), BOUND) + GLOW % "(30, 30, 30)"
SETTINGS = RenderSettings(resolution=(48, 36), spp=2, threads=1)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Number of scenes that are built, and of test renders."""
    counted = {"built": 0, "tests": 0}

    def counting(name: str, function: Any) -> Any:
        def call(*args: Any, **options: Any) -> Any:
            counted[name] += 1
            return function(*args, **options)

        return call

    monkeypatch.setattr(core, "build", counting("built", core.build))
    monkeypatch.setattr(staging, "lit_share", counting("tests", staging.lit_share))
    return counted


def move(stage: Usd.Stage, x: float) -> None:
    stage.GetPrimAtPath("/c").GetAttribute("xformOp:translate").Set(Gf.Vec3d(x, 0, 8))


def says(image: primray.Image) -> list[str]:
    return [d["message"] for d in image.report["diagnostics"] if d["code"] == "default-light"]


def test_pictures_of_a_moving_camera_are_those_of_new_renders(calls: dict[str, int]) -> None:
    """Whether or not a light is added, and where the view goes from one to the other."""
    stage = stage_of(BODY + LAMP)
    scene = primray.Scene(stage)
    added = []
    for x in (0.0, 0.01, 5.0, -9.0, -9.01, 5.0):
        move(stage, x)
        image, new = scene.render(SETTINGS), primray.render(stage, SETTINGS)
        np.testing.assert_array_equal(image.pixels, new.pixels)
        assert says(image) == says(new)
        added.append(bool(says(image)))
    assert len(set(added)) == 2, added
    assert calls["tests"] == 12


def test_a_move_builds_no_scene(calls: dict[str, int]) -> None:
    stage = stage_of(BODY + LED)
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    assert calls == {"built": 2, "tests": 1}
    # Near enough for the same origin of the scene's coordinates.
    place = stage.GetPrimAtPath("/c").GetAttribute("clippingRange")
    place.Set(Gf.Vec2f(1, 100))
    scene.render(SETTINGS)
    built = calls["built"]
    move(stage, 0.001)
    scene.render(SETTINGS)
    assert calls == {"built": built, "tests": 3}


def test_other_samples_make_no_test_render(calls: dict[str, int]) -> None:
    stage = stage_of(BODY + LED)
    scene = primray.Scene(stage)
    first = scene.render(SETTINGS)
    again = scene.render(SETTINGS, spp=4)
    assert calls == {"built": 2, "tests": 1}
    assert says(again) == says(first) != []
    np.testing.assert_array_equal(again.pixels, primray.render(stage, SETTINGS, spp=4).pixels)
