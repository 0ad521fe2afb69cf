"""Views and texture spaces through OpenColorIO, against the sRGB curve and published primaries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PyOpenColorIO as ocio
import pytest

from primray import color
from primray.color_space import REC709
from primray.errors import SettingsError

GREY = np.full((2, 3, 3), 0.18, np.float32)


def srgb(v: float) -> float:
    return float(1.055 * v ** (1 / 2.4) - 0.055)


def test_untonemapped_view_is_the_srgb_curve() -> None:
    assert np.allclose(color.to_display(GREY, "Un-tone-mapped"), srgb(0.18), atol=2e-4)
    assert np.allclose(color.to_display(GREY, "Un-tone-mapped", exposure=1.0), srgb(0.36), atol=2e-4)


def test_primaries_are_rec709() -> None:
    red = np.array([[[0.5, 0, 0]]], np.float32)
    assert np.allclose(color.to_display(red, "Un-tone-mapped"), [srgb(0.5), 0, 0], atol=2e-3)


def test_the_default_view_is_named_and_listed_first() -> None:
    display, view = color.check_view(None)
    assert display in color.displays()
    assert color.views()[0] == view


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(SettingsError, match="Un-tone-mapped"):
        color.check_view("Filmic")
    with pytest.raises(SettingsError, match="sRGB - Display"):
        color.check_view(None, "Plasma")
    with pytest.raises(SettingsError, match="no colour space"):
        color.convert(GREY, "nonsense", REC709)


def test_acescg_to_rendering_space() -> None:
    # ACES AP1 to linear Rec.709 (D65, Bradford), Academy TB-2014-004 and its CAT; white stays white.
    red = np.array([[[1, 0, 0], [1, 1, 1]]], np.float32)
    out = color.convert(red, "ACEScg", REC709)
    assert np.allclose(out[0, 0], [1.70505, -0.13026, -0.02400], atol=2e-4)
    assert np.allclose(out[0, 1], 1, atol=2e-4)


def test_many_rows_give_what_one_gives() -> None:
    rows = np.random.default_rng(0).random((300, 4, 3), dtype=np.float32)
    assert np.array_equal(color.to_display(rows)[123:124], color.to_display(rows[123:124]))


@pytest.mark.parametrize("name", [entry[0] for entry in ocio.BuiltinConfigRegistry().getBuiltinConfigs()])
def test_the_rendering_space_is_found_in_every_builtin_config(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCIO", f"ocio://{name}")
    white = np.ones((1, 1, 3), np.float32)
    assert np.allclose(color.to_display(white, "Un-tone-mapped"), 1, atol=1e-3)


def test_the_environments_config_is_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    config = ocio.Config.CreateRaw()
    config.setName("house")
    config.addColorSpace(ocio.ColorSpace(name="lin_rec709"))
    config.addDisplayView("Wall", "Plain", "lin_rec709")
    (tmp_path / "house.ocio").write_text(config.serialize())
    monkeypatch.setenv("OCIO", str(tmp_path / "house.ocio"))
    assert color.config_name() == "house"
    assert np.array_equal(color.to_display(GREY, "Plain", "Wall"), GREY)


def test_a_config_that_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCIO", "/nowhere/config.ocio")
    with pytest.raises(SettingsError, match="cannot be read"):
        color.check_view(None)
