"""Looks at a stage that stays: the same size and samples, as long as the time is enough for them and not for far more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from primray import core
from primray.incremental.scene import KeptStage
from primray.settings import RenderSettings
from primray.usd.incremental import translation
from primray_service.agents.looks import KEPT_LOOKS, Eye

STAGE = """#usda 1.0
def Sphere "ball"
{
}
"""
RATE = 1e6  # samples a second
SMALL: dict[str, Any] = {
    "frame": None,
    "time_code": None,
    "size": 64,
    "variants": [],
    "taxonomy": "class",
    "seconds": 0.01,
}


@pytest.fixture
def eye(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Eye:
    """Looks by a clock that stands still, and a core of a known speed."""
    (tmp_path / "ball.usda").write_text(STAGE)
    monkeypatch.setattr("primray_service.agents.looks.time.monotonic", lambda: 0.0)
    found = Eye(KeptStage(tmp_path / "ball.usda", RenderSettings()))
    rendered = found._render

    def at_rate(settings: RenderSettings) -> Any:
        rate = found._rate or RATE
        image = rendered(settings)
        found._rate = rate
        return image

    monkeypatch.setattr(found, "_render", at_rate)
    return found


@pytest.fixture
def prepared(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The steps that were taken to prepare scenes, in their order."""
    steps: list[str] = []

    def noting(module: Any, name: str) -> None:
        step = getattr(module, name)

        def noted(*args: Any, **options: Any) -> Any:
            steps.append(name)
            return step(*args, **options)

        monkeypatch.setattr(module, name, noted)

    noting(core, "dice")
    noting(core, "build")
    noting(translation, "_translated_recorded")
    noting(translation, "_updated")
    return steps


def looked(eye: Eye, seconds: float) -> tuple[tuple[int, int], int, str]:
    asked = {"views": ["default"], "frame": None, "time_code": None, "size": 200, "variants": [], "taxonomy": "class"}
    eye.look({**asked, "seconds": seconds})
    image = next(reversed(eye.seen.values())).image
    return image.resolution, image.report["samples"], image.report["pixels_sha256"]


def test_looks_at_an_unchanged_stage_have_the_same_bits_and_build_nothing(eye: Eye, prepared: list[str]) -> None:
    first = looked(eye, 0.4)
    assert {"_translated_recorded", "dice", "build"} <= set(prepared)
    prepared.clear()
    eye._rate = RATE * 1.1  # a machine is never as fast as before
    second = looked(eye, 0.4)
    eye._rate = RATE * 0.85
    third = looked(eye, 0.4)
    assert first == second == third
    assert prepared == []


def test_looks_take_the_time_that_they_are_given(eye: Eye) -> None:
    usual = looked(eye, 0.4)
    eye._rate = RATE * 4
    assert looked(eye, 0.4)[1] > 2 * usual[1]
    eye._rate = RATE / 4
    assert looked(eye, 0.4)[1] < usual[1] / 2
    eye._rate = RATE
    assert looked(eye, 1.2)[1] > 2 * usual[1]


def test_what_is_kept_of_views_does_not_grow_with_their_number(eye: Eye, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.agents.looks.KEPT_VIEWS", 8)
    for angle in range(10):
        eye.look({**SMALL, "views": [f"{angle},0"]})
    assert len(eye._cameras) == len(eye._chosen) == 8
    assert [view for view, *_ in eye.seen] == [f"{angle},0" for angle in range(10 - KEPT_LOOKS, 10)]


def test_comparisons_keep_as_many_looks_as_looks_do(eye: Eye, tmp_path: Path) -> None:
    before = Eye(KeptStage(tmp_path / "ball.usda", RenderSettings()))
    before._rate = RATE
    for angle in range(KEPT_LOOKS + 2):
        eye.changed({**SMALL, "views": [f"{angle},0"], "follow_camera": False, "tolerance": 0.01}, before)
    assert [view for view, *_ in eye.seen] == [f"{angle},0" for angle in range(2, KEPT_LOOKS + 2)]
