"""Sequences: frames have the bits of renders by themselves, and what they share is made once, as far as memory allows."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest
from pxr import Usd

import primray
from primray.incremental import scene, steps
from primray.render import Steps
from primray.usd.incremental import translation

from ...properties.random_edits import FRAMES, stage_of

pytestmark = pytest.mark.filterwarnings("ignore::primray.RenderWarning")
SETTINGS = [
    primray.RenderSettings(resolution=(16, 9), spp=2, threads=1, camera="/eyes/cam", time_code=code, seed=k)
    for k, code in enumerate([*FRAMES, *FRAMES])
]


@pytest.fixture
def stage() -> Usd.Stage:
    return stage_of(random.Random(4))


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """How often all is translated, and all is built."""
    found: list[str] = []

    def counted(owner: Any, name: str) -> None:
        real = getattr(owner, name)

        def counting(*given: Any) -> Any:
            found.append(name)
            return real(*given)

        monkeypatch.setattr(owner, name, counting)

    counted(translation, "_translated_recorded")
    counted(Steps, "build")
    return found


def bits(images: Iterator[primray.Image]) -> list[str]:
    return [str(image.report["pixels_sha256"]) for image in images]


def alone(stage: Usd.Stage) -> list[str]:
    return bits(primray.render(stage, settings) for settings in SETTINGS)


def test_frames_are_those_of_renders_by_themselves(stage: Usd.Stage, built: list[str]) -> None:
    expected = alone(stage)
    built.clear()
    assert bits(primray.render_frames(stage, SETTINGS)) == expected
    assert built.count("_translated_recorded") == 1
    assert built.count("build") < len(SETTINGS)


def test_where_memory_is_short_nothing_is_kept(stage: Usd.Stage, built: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    expected = alone(stage)
    built.clear()
    monkeypatch.setattr(steps, "resident_bytes", lambda: float("inf"))
    assert bits(primray.render_frames(stage, SETTINGS)) == expected
    assert built == ["_translated_recorded", "build"] * len(SETTINGS)


def test_a_frame_alone_keeps_nothing(stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene, "_open_kept", None)
    assert bits(primray.render_frames(stage, SETTINGS[:1])) == alone(stage)[:1]


def test_edits_between_frames_show(stage: Usd.Stage) -> None:
    def edited() -> Iterator[primray.RenderSettings]:
        for intensity in (1.0, 50.0):
            stage.GetPrimAtPath("/world/g1/SphereLight").GetAttribute("inputs:intensity").Set(intensity)
            yield SETTINGS[0]

    first, second = bits(primray.render_frames(stage, edited()))
    assert first != second
    assert second == alone(stage)[0]
