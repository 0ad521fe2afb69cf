"""Views that show almost nothing but white or black, and the exposure that makes them show something."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest

import primray
from primray.arrays import Floats
from primray.cli import run
from primray.errors import SettingsError
from primray.images.exposure import View, exposure_that_serves, view_fault, where_lit
from primray.images.image import Image, encode

VIEWS = [View(), View("Un-tone-mapped")]


def ramp(scale: float, alpha: float = 1.0) -> Floats:
    """(20, 30, 4) of a picture from black to white albedo, whose white is `scale`."""
    grey = np.geomspace(0.02, 1, 600).reshape(20, 30) * scale
    return np.stack([grey * alpha, grey * 0.9 * alpha, grey * 0.8 * alpha, np.full_like(grey, alpha)], axis=2).astype(
        np.float32
    )


def stored_in(path: Path) -> npt.NDArray[np.uint8]:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8))


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize(("scale", "what"), [(3e4, "white"), (3e-4, "black"), (1.0, None)])
def test_what_shows_as_one_colour_is_told_with_the_exposure_that_serves(view: View, scale: float, what: str | None) -> None:
    fault = view_fault(ramp(scale), view)
    assert (fault is None) == (what is None)
    if fault is None:
        return
    stops = exposure_that_serves(ramp(scale), view)
    assert f"almost {what}" in fault.message
    assert f"try --exposure {stops:.1f}," in fault.message
    assert view_fault(ramp(scale), view, stops) is None
    shown = encode(ramp(scale), view=view.view, exposure=stops)[..., :3]
    assert 190 < np.quantile(shown.max(axis=2), 0.95) < 225
    assert np.median(shown) > 20


def test_a_bright_window_does_not_drown_the_room() -> None:
    room = ramp(0.5)
    room[:4] = 1e4
    shown = encode(room, exposure=exposure_that_serves(room, View()))[..., :3]
    assert np.median(shown[4:]) > 25


def test_coverage_counts_not_the_background() -> None:
    """A small bright thing before nothing; its half-covered edge is as bright."""
    pixels = np.zeros((40, 40, 4), np.float32)
    pixels[10:14, 10:14] = 1e4
    pixels[10, 10:14] *= 0.5
    pixels[10:14, 10:14, 3] = 1
    pixels[10, 10:14, 3] = 0.5
    fault = view_fault(pixels, View())
    assert fault is not None
    assert "100%" in fault.message
    assert view_fault(np.zeros((4, 4, 4), np.float32), View()) is None
    assert exposure_that_serves(np.zeros((4, 4, 4), np.float32), View()) == 0


def test_pixels_that_are_not_finite_do_not_count() -> None:
    pixels = ramp(1.0)
    pixels[0] = np.nan
    pixels[1] = np.inf
    assert np.isfinite(exposure_that_serves(pixels, View()))


def test_saving_a_view_warns_and_the_record_does_not(tmp_path: Path) -> None:
    image = Image(ramp(3e4))
    with pytest.warns(primray.RenderWarning, match="view-exposure"):
        image.save(tmp_path / "a.png")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image.save(tmp_path / "a.exr")
        image.save(tmp_path / "b.png", exposure="auto")
    assert np.ptp(image.to_uint8(exposure="auto")[..., :3]) > 150


def test_jpeg_shows_what_is_half_covered_over_black(tmp_path: Path) -> None:
    half = np.zeros((16, 16, 4), np.float32)
    half[:] = (0.25, 0.25, 0.25, 0.5)
    stored = stored_in(Image(half).save(tmp_path / "a.jpg", view="Raw"))
    assert np.abs(stored.astype(int) - 64).max() <= 2


LIT = """#usda 1.0
def Sphere "ball"
{
}
def DistantLight "sun"
{
    float inputs:intensity = %s
    float inputs:angle = 1
}
"""


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run(["render", *arguments, "--res", "16", "16", "--spp", "4", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return next(line for line in lines if line["type"] == "report")


@pytest.mark.parametrize("intensity", ["3e9", "10"])
def test_the_command_tells_and_takes_what_serves(intensity: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "lit.usda"
    scene.write_text(LIT % intensity)
    report = told(capsys, str(scene), "-o", str(tmp_path / "plain.png"))
    codes = [d["code"] for d in report["diagnostics"]]
    assert "view-exposure" in codes
    report = told(capsys, str(scene), "-o", str(tmp_path / "auto.png"), "--exposure", "auto")
    assert "view-exposure" not in [d["code"] for d in report["diagnostics"]]
    assert abs(report["view_exposure"]) > 3
    shown = stored_in(tmp_path / "auto.png")
    assert 150 < shown[..., 0].max() < 250


def test_where_no_exposure_serves_none_is_advised() -> None:
    """A tenth is very bright and the rest black: what was chosen for it shows no more than that."""
    pixels = np.zeros((20, 20, 4), np.float32)
    pixels[..., 3] = 1
    pixels[:2] = ramp(5.0)[0, :20]
    stops = exposure_that_serves(pixels, View())
    chosen, other = (view_fault(pixels, View(), exposure, is_auto=True) for exposure in (stops, stops + 4))
    assert chosen is not None
    assert "no other exposure" in chosen.message
    assert other is not None
    assert "try --exposure" in other.message
    assert "auto" not in chosen.message + other.message


def test_a_denoiser_leaves_no_light_where_its_record_has_none() -> None:
    record = np.zeros((20, 30, 4), np.float32)
    record[..., 3] = 1
    record[3, 3, :3] = 1
    denoised = record + np.float32(1e-6)
    shown = where_lit(denoised, record)
    np.testing.assert_array_equal(shown[:8, :8], denoised[:8, :8])
    assert shown[8:, :, :3].max() == shown[:, 8:, :3].max() == 0
    np.testing.assert_array_equal(shown[..., 3], denoised[..., 3])


@pytest.mark.parametrize("stops", ["1e9", "1e4", "-101", "nan", "inf", "bright"])
def test_an_exposure_that_no_float_holds_is_refused(stops: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At once: before the stage is opened, which there is none here, and by the library before a file is written."""
    assert run(["render", str(tmp_path / "no.usda"), "-o", str(tmp_path / "a.png"), f"--exposure={stops}"]) == 2
    said = capsys.readouterr().err
    assert "exposure" in said
    assert "-100 to 100" in said
    given: Any = stops if stops == "bright" else float(stops)
    for made in (
        lambda: Image(ramp(1)).save(tmp_path / "a.png", exposure=given),
        lambda: Image(ramp(1)).to_uint8(exposure=given),
    ):
        with pytest.raises(SettingsError, match="-100 to 100") as refused:
            made()
        assert (refused.value.code, refused.value.where) == ("settings-error", "exposure")
    assert not list(tmp_path.glob("*.png"))


def test_the_most_exposure_is_white_and_the_least_black() -> None:
    pixels = ramp(1e12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Image(pixels).to_uint8(exposure=100)[..., :3].min() == 255
        assert Image(ramp(1)).to_uint8(exposure=-100)[..., :3].max() == 0


@pytest.mark.parametrize(("scale", "asks_for_textures"), [(3e-4, True), (3e4, False)])
def test_missing_textures_come_before_an_exposure(scale: float, asks_for_textures: bool) -> None:
    report = {"diagnostics": [{"code": "asset-missing", "severity": "error", "prim": "/m", "message": "no a.png"}]}
    whole, lacking = (Image(ramp(scale), said).view_fault(View(), 0.0) for said in ({}, report))
    assert whole is not None
    assert lacking is not None
    assert ("missing textures" in lacking.message) == asks_for_textures
    assert "textures" not in whole.message
