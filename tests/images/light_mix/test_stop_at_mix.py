"""Renders that stop at an error of a mix of their lights: the same bits however they are made, and targets that are met."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of
from tests.images.light_mix.test_light_mix import FILL, KEY, ROOM, SIZE, SKY

from primray import Image, LocalProcesses, Scene, relight, render
from primray.checkpoints.checkpointing import Checkpointing
from primray.cli import run
from primray.errors import CheckpointError, SettingsError
from primray.settings import RenderSettings
from primray.settings.light_mixes import text_of_weights, weights_of_text

BRIGHT = "key=4 fill=0 sky=1,0.5,0.25"
DIM = "key=0.05 fill=0.05 sky=0.1"


def settings(**more: Any) -> RenderSettings:
    asked: dict[str, Any] = {"target_error": 2e-3, "stop_at": "mix", "mixes": (BRIGHT,), **more}
    return replace(RenderSettings(resolution=SIZE, seed=3, threads=1, aovs=("lights",)), **asked)


def picture(**more: Any) -> Image:
    return render(stage_of(ROOM + KEY + FILL, light=SKY), settings(**more), progress=False)


@pytest.fixture(scope="module")
def stopped() -> Image:
    return picture()


def mix_error(image: Image) -> dict[str, Any]:
    found: dict[str, Any] = image.report["error"]["mix"]
    return found


def test_a_mix_of_weights_1_stops_where_the_picture_does() -> None:
    own, same = picture(stop_at="picture", mixes=()), picture(mixes=("key=1 sky=1,1,1",))
    assert np.array_equal(own.pixels, same.pixels)
    assert mix_error(same)["relmse"] == same.report["error"]["relmse"] == own.report["error"]["relmse"]


def test_the_target_applies_to_the_mix(stopped: Image) -> None:
    assert stopped.report["stop"] == {"reason": "target-error", "target_met": True}
    assert mix_error(stopped)["relmse"]["estimate"] <= 2e-3
    counts = stopped.report["samples_per_pixel"]
    assert counts[0] < counts[1], "tiles have samples by the mix's error"
    # The estimate of primray relight, which knows this picture alone, is of the same error.
    assert relight(stopped, weights_of_text(BRIGHT)).report["error"]["relmse"]["estimate"] == pytest.approx(
        mix_error(stopped)["relmse"]["estimate"], rel=0.3
    )


def test_the_worst_of_several_mixes_counts(stopped: Image) -> None:
    both = picture(mixes=(DIM, BRIGHT))
    assert mix_error(both)["worst"] == 1
    assert np.array_equal(both.pixels, stopped.pixels)
    assert picture(mixes=(DIM,)).report["samples"] < stopped.report["samples"]


def test_bits_do_not_depend_on_threads_and_interruptions(tmp_path: Path, stopped: Image) -> None:
    assert np.array_equal(picture(threads=2).pixels, stopped.pixels)
    file = tmp_path / "half.prc"
    seen: list[int] = []

    def once(fraction: float, samples: int, rays: int) -> bool:
        seen.append(samples)
        return samples < stopped.report["samples"] / 2

    stage = stage_of(ROOM + KEY + FILL, light=SKY)
    first = render(stage, settings(), progress=once, on_interrupt="partial", checkpointing=Checkpointing(file))
    assert 0 < first.report["samples"] < stopped.report["samples"]
    resumed = render(stage, settings(), progress=False, checkpointing=Checkpointing(file, resume=file))
    assert np.array_equal(resumed.pixels, stopped.pixels)
    assert mix_error(resumed) == mix_error(stopped)
    with pytest.raises(CheckpointError) as caught:
        render(stage, settings(mixes=(DIM,)), progress=False, checkpointing=Checkpointing(file, resume=file))
    assert "mixes" in str(caught.value)


def test_a_frame_in_parts_stops_where_one_render_does(tmp_path: Path) -> None:
    stage = tmp_path / "room.usda"
    held = stage_of(ROOM + KEY + FILL, light=SKY)
    held.GetRootLayer().Export(str(stage))
    whole = render(stage, settings(adaptive=False), progress=False)
    parts = render(stage, settings(), progress=False, executor=LocalProcesses(2))
    assert np.array_equal(whole.pixels, parts.pixels)
    assert mix_error(whole)["relmse"] == mix_error(parts)["relmse"]


def test_errors_of_mixes_are_those_of_new_seeds() -> None:
    """Of renders that stop at a mix's error, that error is near the target, and its intervals hold it."""
    truth = relight(picture(stop_at="picture", mixes=(), target_error=None, spp=4096, seed=99), weights_of_text(BRIGHT)).pixels
    reference = truth[..., :3].astype(np.float64)
    true, held = [], 0
    for seed in range(24):
        image = picture(seed=seed)
        mixed = relight(image, weights_of_text(BRIGHT)).pixels[..., :3]
        true.append(float(((mixed - reference) ** 2 / (reference**2 + 0.01)).mean()))
        low, high = mix_error(image)["relmse"]["ci95"]
        held += low <= true[-1] <= high
    assert np.mean(true) / 2e-3 == pytest.approx(0.95, abs=0.2)
    assert held >= 20


@pytest.mark.parametrize(
    ("changes", "said", "code"),
    [
        ({"mixes": ("keys=2",)}, "did you mean key", "lights-unknown"),
        ({"aovs": ()}, "--aov lights", "lights-missing"),
        ({"target_error": None, "spp": 4}, "target_error", "settings-error"),
        ({"error_metric": "display"}, "display", "settings-error"),
        ({"mixes": ()}, "go together", "settings-error"),
        ({"mixes": ("key",)}, "NAME=0.5", "lights-weight"),
        ({"mixes": ("key=1 key=2",)}, "NAME=0.5", "lights-weight"),
        ({"mixes": ("key=-1",)}, "from 0", "lights-weight"),
    ],
)
def test_what_cannot_be_judged_is_an_error(changes: dict[str, Any], said: str, code: str) -> None:
    with pytest.raises(SettingsError) as caught:
        picture(**changes)
    assert said in str(caught.value)
    assert caught.value.code == code


def test_the_command_takes_a_mix_as_text_and_as_a_report(tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    held = stage_of(ROOM + KEY + FILL, light=SKY)
    held.GetRootLayer().Export("room.usda")
    common = ["render", "room.usda", "--res", "24", "18", "--aov", "lights", "--target-error", "0.01", "--stop-at", "mix"]
    assert run([*common, "--mix", BRIGHT, "-o", "a.exr"]) == 0
    assert "the mix: " in capsys.readouterr().out
    assert run(["relight", "a.exr", "--mix", BRIGHT, "--stops", "key=+1", "--report", "mix.json"]) == 0
    assert {row["name"]: row["weight"] for row in json.loads(Path("mix.json").read_text())["lights"]}["key"] == [8, 8, 8]
    assert run([*common, "--mix", "mix.json", "--mix", DIM, "-o", "b.exr", "--report", "b.json"]) == 0
    report = json.loads(Path("b.json").read_text())
    assert weights_of_text(report["settings"]["mixes"][0])["sky"] == (1, 0.5, 0.25)
    assert f"the worst of 2 mixes ({report['settings']['mixes'][0]})" in capsys.readouterr().out
    Path("bad.json").write_text("[1]")
    assert run([*common, "--mix", "bad.json", "-o", "c.exr"]) == 2
    assert "bad.json" in capsys.readouterr().err


def test_text_and_weights_are_the_same_mix() -> None:
    weights = {"key": (0.1, 0.1, 0.1), "fill": (1.0, 0.3, 2.0)}
    assert weights_of_text(text_of_weights(weights)) == weights


def test_a_kept_scene_stops_at_a_mix_as_a_render_does(stopped: Image) -> None:
    scene = Scene(stage_of(ROOM + KEY + FILL, light=SKY))
    assert np.array_equal(scene.render(settings(mixes=(DIM,)), progress=False).pixels, picture(mixes=(DIM,)).pixels)
    assert np.array_equal(scene.render(settings(), progress=False).pixels, stopped.pixels)
