"""Views and texture spaces through OpenColorIO, against the sRGB curve and published primaries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import PyOpenColorIO as ocio
import pytest
from tests.colorimetry import AP1, between
from tests.colorimetry import REC709 as PUBLISHED

from primray.color import color_space
from primray.color import ocio as color
from primray.color.color_space import REC709
from primray.errors import SettingsError

CG, STUDIO = "ocio://cg-config-v1.0.0_aces-v1.3_ocio-v2.1", "ocio://studio-config-v4.0.0_aces-v2.0_ocio-v2.5"
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


@pytest.mark.parametrize("name", ["lin_ap1_scene", "lin_rec2020_scene", "lin_p3d65_scene", "lin_ap0_scene"])
@pytest.mark.parametrize("config", [CG, STUDIO, ""])
def test_a_picture_looks_alike_from_any_space(name: str, config: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCIO", config)
    space = color_space.named(name)
    assert space is not None
    rec709 = np.random.default_rng(1).random((4, 5, 3), np.float32)
    there = color_space.transformed(rec709, color_space.matrix(REC709, space))
    assert np.allclose(color.to_display(there, space=space), color.to_display(rec709), atol=2e-5)


def house(tmp_path: Path, *names: str) -> Any:
    """A configuration of linear spaces, the first of which a display shows as it is."""
    config = ocio.Config.CreateRaw()
    config.setName("house")
    for name in names:
        config.addColorSpace(ocio.ColorSpace(name=name, encoding="scene-linear"))
    config.addDisplayView("Wall", "Plain", names[0])
    return config


def test_a_config_without_the_space_is_reached_by_primaries(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "house.ocio").write_text(house(tmp_path, "lin_rec709").serialize())
    monkeypatch.setenv("OCIO", str(tmp_path / "house.ocio"))
    red = np.array([[[1, 0, 0]]], np.float32)
    shown = color.to_display(red, "Plain", "Wall", space=color_space.ACESCG)
    assert np.allclose(shown, between(AP1, PUBLISHED)[:, 0], atol=3e-6)
    # The other way: what only this configuration names, in a rendering space that it lacks.
    assert np.allclose(color.convert(red, "lin_rec709", color_space.ACESCG), between(PUBLISHED, AP1)[:, 0], atol=3e-6)


def test_a_config_without_any_known_space_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "house.ocio").write_text(house(tmp_path, "film").serialize())
    monkeypatch.setenv("OCIO", str(tmp_path / "house.ocio"))
    with pytest.raises(SettingsError, match="no known linear space"):
        color.to_display(GREY, "Plain", "Wall")


def test_an_archived_config(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    config = house(tmp_path, "lin_ap1")
    config.setWorkingDir(str(tmp_path))
    config.archive(str(tmp_path / "house.ocioz"))
    monkeypatch.setenv("OCIO", str(tmp_path / "house.ocioz"))
    assert np.allclose(color.to_display(GREY, "Plain", "Wall"), 0.18)


def test_looks_are_listed_checked_and_applied() -> None:
    (look, *_) = color.looks()
    beyond = np.array([[[1.0, -0.3, 0.2]]], np.float32)  # outside AP1, which the reference gamut compression is about
    space = color_space.ACESCG
    plain, looked = (color.to_display(beyond, "Un-tone-mapped", look=name, space=space) for name in (None, look))
    assert np.abs(plain - looked).max() > 0.01
    inside = np.full((1, 1, 3), 0.18, np.float32)
    assert np.allclose(color.to_display(inside, look=look), color.to_display(inside), atol=1e-6)
    with pytest.raises(SettingsError, match=look):
        color.to_display(GREY, look="Moonlight")


def test_names_of_spaces() -> None:
    assert color.space_named("ACEScg") == color.space_named("lin_ap1_scene") == color_space.ACESCG
    assert color.space_named("srgb_tx") == color_space.SRGB
    assert color.space_named("ACEScct") == "ACEScct"
    assert color.space_named("nobody") is None
    raw = color.space_named("Utility - Raw")
    assert isinstance(raw, color_space.ColorSpace)
    assert raw.is_data


def test_rendering_spaces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCIO", STUDIO)
    found = color.rendering_space("Linear ARRI Wide Gamut 3")
    # ARRI, "ALEXA Wide Gamut RGB"; the configuration adapts it to ACES by CAT02, here it comes back by Bradford.
    assert np.allclose(found.gamut, [(0.684, 0.313), (0.221, 0.848), (0.0861, -0.1020), (0.3127, 0.3290)], atol=4e-3)
    for name in ("ARRI LogC4", "ACEScct", "Raw", "srgb_rec709_scene", "lin_ciexyzd65_scene", "nobody"):
        with pytest.raises(SettingsError, match=r"colour space|linear RGB"):
            color.rendering_space(name)


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
