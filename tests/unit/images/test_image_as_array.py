"""An image as Python people use it: an array, display values, a line of text, a viewer, and back from its file."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray import Aov, Image
from primray.color.color_space import ACESCG, REC709, ColorSpace, linear_spaces
from primray.description import Frame, PixelWindow
from primray.errors import PrimrayError, SettingsError

RNG = np.random.default_rng(4)
PIXELS = RNG.random((3, 5, 4), np.float32)
OPAQUE = np.concatenate([PIXELS[..., :3], np.ones((3, 5, 1), np.float32)], axis=2)
ERRORS = RNG.random((3, 5, 3), np.float32)


def test_numpy_takes_its_pixels() -> None:
    image = Image(PIXELS)
    assert np.array_equal(np.asarray(image), PIXELS)
    assert not np.asarray(image).flags.writeable
    assert np.shares_memory(np.asarray(image), image.pixels)
    copied = np.array(image)
    copied[:] = 0
    assert np.array_equal(image.pixels, PIXELS)
    assert np.asarray(image, np.float64).dtype == np.float64
    with pytest.raises(ValueError, match="copy"):
        np.array(image, np.float64, copy=False)


def test_numpy_takes_an_aovs_values() -> None:
    aov = Aov(PIXELS[..., :1], ("depth",), "depth", "how far")
    assert np.array_equal(np.asarray(aov), aov.values)
    assert repr(aov) == "<Aov depth, 5 x 3, depth, float32>"


@pytest.mark.parametrize("pixels", [PIXELS, OPAQUE])
def test_display_values_are_those_of_the_png(pixels: Any, tmp_path: Path) -> None:
    image = Image(pixels)
    shown: Any = image.to_uint8(exposure=0.5)
    assert (shown.shape, shown.dtype) == ((3, 5, 4), np.uint8)
    path = image.save(tmp_path / "a.png", exposure=0.5)
    straight = oiio.ImageSpec()
    straight.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), straight)
    assert file is not None
    stored: Any = file.read_image(oiio.UINT8)
    assert np.array_equal(shown[..., : stored.shape[2]], stored)
    assert stored.shape[2] == 4 or (shown[..., 3] == 255).all()


def test_its_repr_is_a_line() -> None:
    report = {
        "samples_per_pixel": [2, 4],
        "error": {"relmse": {"estimate": 0.01234}},
        "diagnostics": [{"severity": "warning"}, {"severity": "warning"}, {"severity": "info"}, {"severity": "error"}],
    }
    aovs = {"depth": Aov(PIXELS[..., :1], ("depth",), "depth", "how far")}
    text = "<Image 5 x 3, RGBA, 2 to 4 samples a pixel, relmse 0.012, aovs depth, 1 error, 2 warnings>"
    assert repr(Image(PIXELS, report, aovs=aovs)) == text
    assert repr(Image(PIXELS)) == "<Image 5 x 3, RGBA>"
    assert (
        repr(Image(PIXELS, {"samples_per_pixel": [1, 1], "error": {"relmse": None}}))
        == "<Image 5 x 3, RGBA, 1 samples a pixel>"
    )


def test_show_opens_the_desktops_viewer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    viewer = tmp_path / "xdg-open"
    viewer.write_text(f'#!/bin/sh\ncp "$1" {tmp_path}/seen.png.part && mv {tmp_path}/seen.png.part {tmp_path}/seen.png\n')
    viewer.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("DISPLAY", ":7")
    Image(PIXELS).show()
    end = time.monotonic() + 30
    while not (tmp_path / "seen.png").exists() and time.monotonic() < end:
        time.sleep(0.01)
    assert (tmp_path / "seen.png").read_bytes().startswith(b"\x89PNG")


def test_show_without_a_desktop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: pytest.fail("something was started"))
    with pytest.raises(PrimrayError) as error:
        Image(PIXELS).show()
    assert error.value.code == "no-display"


@pytest.mark.parametrize("space", [*linear_spaces(), ColorSpace("own", (0.6, 0.3), (0.2, 0.7), (0.1, 0.1), (0.3, 0.3))])
def test_an_exr_gives_the_image_again(space: ColorSpace, tmp_path: Path) -> None:
    frame = Frame((8, 6), PixelWindow(-1, 2, 5, 3), 2.0)
    aovs = {"prim": Aov(np.ones((3, 5, 1), np.uint32), ("prim",), "prim", "which", "uint", {1: "/a"})}
    image = Image(PIXELS, metadata={"samples": 60}, errors=ERRORS, color_space=space, frame=frame, aovs=aovs)
    again = primray.read_image(image.save(tmp_path / "a.exr"))
    assert again.errors is not None
    assert np.array_equal(again.pixels, PIXELS)
    assert np.array_equal(again.errors, ERRORS)
    assert np.allclose(again.color_space.gamut, space.gamut, atol=1e-3)
    assert again.frame == frame
    assert again.metadata == {"samples": 60}
    assert again.aovs["prim"].ids == {1: "/a"}


def test_named_spaces_come_back_by_name(tmp_path: Path) -> None:
    for space in (REC709, ACESCG):
        assert primray.read_image(Image(PIXELS, color_space=space).save(tmp_path / "a.exr")).color_space == space


def test_display_values_are_no_picture_to_read(tmp_path: Path) -> None:
    path = Image(PIXELS).save(tmp_path / "a.png")
    with pytest.raises(SettingsError, match="display values") as error:
        primray.read_image(path)
    assert error.value.code == "image-display"


def test_compare_takes_images_and_paths(tmp_path: Path) -> None:
    image = Image(OPAQUE, errors=ERRORS, metadata={"samples_per_pixel": "4 4"})
    path = image.save(tmp_path / "a.exr")
    for a, b in ((image, path), (path, image), (primray.read_image(path), image), (str(path), path)):
        found = primray.compare(a, b, tile=8)
        assert isinstance(found, primray.Comparison)
        assert found.identical
        assert found.of.samples == (4, 4)
        assert not found.notes
    assert repr(found).startswith("<Comparison unchanged; tiles: 1 unchanged; mean difference +0 %")
    with pytest.raises(TypeError, match="verdict"):
        bool(found)
    with pytest.raises(SettingsError, match="not int"):
        primray.compare(3, image)  # type: ignore[call-overload]


def test_compare_has_the_defaults_of_comparisons() -> None:
    import inspect

    from primray.compare.comparison import compare

    ours, theirs = (inspect.signature(f).parameters for f in (primray.compare, compare))
    assert {name: ours[name].default for name in theirs} == {name: p.default for name, p in theirs.items()}
