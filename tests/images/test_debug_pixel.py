"""The log of a pixel's samples says all that the pixel is made of: its contributions add up to the rendered pixel."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.cli import run
from primray.diagnosis.pixel_log import PixelLog
from primray.errors import SettingsError
from primray.settings import Filter

SCENES = Path(__file__).parents[2] / "scenes"
SIZE, SPP = (24, 16), 8
# Glass and emission, media, a dome, many lights, hair, instances, thin surfaces, a lens with flaws, light-path sums.
STAGES = (
    "glass",
    "emission",
    "interiors",
    "dome-texture",
    "light-sphere",
    "hair",
    "nested-instancers",
    "opacity-texture",
    "lens-flaws",
)


def stage_of(name: str) -> str:
    return str(next((SCENES / "features" / name).glob("*.usda")))


def log_of(stage: str, pixel: tuple[int, int], **values: Any) -> PixelLog:
    return primray.debug_pixel(stage, *pixel, resolution=SIZE, filter=Filter.BOX, **{"spp": SPP} | values)


def value_of(sample: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    """Return a sample's value by its events: the sum of their contributions, weighed by the lens, less what was removed."""
    total = sum((np.array(event.get("contribution", (0, 0, 0))) for event in sample["events"]), np.zeros(3))
    return (
        total * np.array(sample.get("lens_weight", (1, 1, 1)))
        - sample.get("clamped", (0, 0, 0))
        - sample.get("caustics", (0, 0, 0))
    )


@pytest.mark.parametrize("name", STAGES)
def test_contributions_add_up_to_the_pixel(name: str) -> None:
    stage = stage_of(name)
    image = primray.render(stage, resolution=SIZE, spp=SPP, filter=Filter.BOX, progress=False)
    x, y = (int(at) for at in np.unravel_index(int(image.pixels[..., :3].max(axis=2).argmax()), SIZE[::-1])[::-1])
    for pixel in ((x, y), (SIZE[0] // 2, SIZE[1] // 2)):
        log = log_of(stage, pixel)
        assert len(log.samples) == SPP
        for sample in log.samples:
            np.testing.assert_allclose(value_of(sample), sample["value"], rtol=1e-5, atol=1e-7)
        expected = image.pixels[pixel[1], pixel[0]]
        np.testing.assert_allclose([*log.value, log.alpha], expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("settings", [{"clamp_indirect": 0.05}, {"caustics": False}, {"sample_range": (4, 8), "spp": None}])
def test_what_the_picture_leaves_out_is_in_the_log(settings: dict[str, Any]) -> None:
    stage = stage_of("glass")
    image = primray.render(stage, resolution=SIZE, filter=Filter.BOX, progress=False, **{"spp": SPP} | settings)
    log = log_of(stage, (12, 8), **settings)
    for sample in log.samples:
        np.testing.assert_allclose(value_of(sample), sample["value"], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(log.value, image.pixels[8, 12, :3], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", ["glass", "interiors", "light-sphere"])
def test_throughputs_multiply_up(name: str) -> None:
    """What leaves a vertex is what arrived times the weight of its sample, and what roulette makes of that is what arrives."""
    for sample in log_of(stage_of(name), (12, 8), spp=2).samples:  # two samples are a quick look, which splits no path
        throughput = np.ones(3)
        for event in sample["events"]:
            if event["kind"] == "hit":
                np.testing.assert_allclose(event["throughput"], throughput, rtol=1e-5)
            if event["kind"] == "scatter" and "weight" in event:
                np.testing.assert_allclose(event["throughput"], throughput * event["weight"], rtol=1e-5)
            if event["kind"] == "roulette" and event["survives"]:
                np.testing.assert_allclose(event["throughput"], throughput / event["survival"], rtol=1e-5)
            throughput = np.array(event["throughput"]) if event["kind"] in ("scatter", "roulette", "medium") else throughput


@pytest.mark.parametrize("name", ["light-sphere", "emission", "dome-texture"])
def test_weights_of_both_techniques_are_those_of_their_densities(name: str) -> None:
    """The power heuristic of the logged densities is the logged weight (Veach 1997, section 9.2.2)."""
    events = [event for sample in log_of(stage_of(name), (12, 11), spp=64).samples for event in sample["events"]]
    found = [event for event in events if event["kind"] == "emission" and "weight" in event]
    sampled = [event for event in events if event["kind"] == "light sample" and event.get("weight", 1) < 1]
    assert found
    assert sampled
    for event in found:
        assert event["weight"] == pytest.approx(1 / (1 + (event["light_pdf"] / event["bsdf_pdf"]) ** 2), rel=1e-4)
    for event in sampled:
        assert event["weight"] == pytest.approx(1 / (1 + (event["bsdf_pdf"] / event["light_pdf"]) ** 2), rel=1e-4)


def test_prims_are_named_by_path(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["render", stage_of("light-sphere"), "--res", "24", "16", "--spp", "4", "--debug-pixel", "12", "8"]
    assert run([*line, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    kinds = {event["kind"]: event for sample in found["samples"] for event in sample["events"]}
    assert found["type"] == "pixel"
    assert kinds["hit"]["prim"].startswith("/")
    assert kinds["light sample"]["light"].startswith("/")
    assert run(line) == 0
    text = capsys.readouterr().out
    assert kinds["hit"]["prim"] in text
    assert kinds["light sample"]["light"] in text
    assert text.count("\nsample ") == 4


def test_emissive_shapes_are_lights_by_their_paths() -> None:
    events = [event for sample in log_of(stage_of("emission"), (12, 12)).samples for event in sample["events"]]
    lights = {event["light"] for event in events if event["kind"] == "light sample" and "light" in event}
    shapes = {event["prim"] for event in events if event["kind"] == "hit"}
    assert lights
    assert all(light in shapes or light.startswith("/") for light in lights)


def test_a_pixel_outside_the_frame_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SettingsError) as raised:
        log_of(stage_of("glass"), (24, 0))
    assert raised.value.code == "debug-pixel"
    assert run(["render", stage_of("glass"), "out.exr", "--debug-pixel", "1", "1"]) == 2
    assert "an output" in capsys.readouterr().err
