"""FLIP beside the verdict: nothing between equal pictures, more between worse ones, and no say in the exit code."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from primray.cli import run
from primray.color.color_space import REC709, matrix, named
from primray.compare import flip as flip_module
from primray.compare.comparable import measured
from primray.compare.flip import flip, has_flip
from primray.errors import SettingsError
from primray.images.image import Image
from primray.images.reading import MeasuredImage

needs_package = pytest.mark.skipif(not has_flip(), reason="primray[flip] is not installed")


def _image(noise: float = 0.0) -> Image:
    random = np.random.default_rng(4)
    y, x = np.mgrid[:24, :32] / 32
    pixels = np.stack([0.2 + x, 0.3 + y, 0.5 + 0 * x, np.ones_like(x)], axis=2).astype(np.float32)
    pixels[..., :3] *= 1 + noise * random.standard_normal((24, 32, 3)).astype(np.float32)
    return Image(
        pixels, errors=np.full((24, 32, 3), 0.05, np.float32), metadata={"samples_per_pixel": "4 4", "settings.seed": 1}
    )


def _measured(noise: float = 0.0) -> MeasuredImage:
    return measured(_image(noise))


@needs_package
def test_more_is_worse() -> None:
    assert flip(_measured(), _measured()).mean == 0
    found = [flip(_measured(), _measured(noise)).mean for noise in (0.02, 0.1, 0.4)]
    assert 0 < found[0] < found[1] < found[2] <= 1


@needs_package
def test_a_pixel_is_where_it_is() -> None:
    pixels = _image().pixels.copy()
    pixels[5, 20, :3] = 5
    errors = flip(_measured(), measured(Image(pixels))).errors
    assert np.unravel_index(errors.argmax(), errors.shape) == (5, 20)


@needs_package
def test_colours_are_seen_as_rec709() -> None:
    space = named("lin_ap1_scene")
    assert space is not None
    by = matrix(REC709, space)
    assert by is not None
    pixels = _image().pixels.copy()
    pixels[..., :3] = pixels[..., :3] @ by.T
    assert flip(_measured(), measured(Image(pixels, color_space=space))).mean < 2e-3
    assert flip(_measured(), measured(Image(pixels))).mean > 2e-2


@needs_package
def test_the_command_tells_it_and_keeps_its_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    _image().save("a.exr")
    _image(0.02).save("b.exr")
    plain = run(["compare", "a.exr", "b.exr"])
    capsys.readouterr()
    assert run(["compare", "a.exr", "b.exr", "--metric", "flip", "--report", "r.json"]) == plain
    assert "FLIP: mean 0.0" in capsys.readouterr().out
    assert 0 < json.loads(Path("r.json").read_text())["flip"]["mean"] < 0.1


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flip_module, "has_flip", lambda: False)
    with pytest.raises(SettingsError, match="primray\\[flip\\]"):
        flip(_measured(), _measured())
