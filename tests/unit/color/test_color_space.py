"""Colour spaces by their primaries: against published chromaticities, and against GfColorSpace for every name it has."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf
from tests.colorimetry import AP0, AP1, D65, P3_D65, REC2020, between, from_srgb
from tests.colorimetry import REC709 as PUBLISHED

from primray.color import color_space
from primray.color.color_space import ACESCG, REC709, ColorSpace, converted, linear, matrix, named, transformed

NAMES = sorted({str(getattr(Gf.ColorSpaceNames, key)) for key in dir(Gf.ColorSpaceNames) if not key.startswith("_")})
COLORS = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (0.2, 0.5, 0.7), (0.02, 0.01, 0.001), (3.0, 0.4, 0.1)]


def space(name: str) -> ColorSpace:
    found = named(name)
    assert found is not None
    return found


@pytest.mark.parametrize("name", NAMES)
def test_every_name_of_gf_is_known_and_converts_as_gf_does(name: str) -> None:
    ours, gf = space(name), Gf.ColorSpace(name)
    assert ours.is_data == gf.IsData()
    for target in ("lin_rec709_scene", "lin_ap1_scene", "lin_rec2020_scene"):
        for color in COLORS:
            expected = Gf.ColorSpace(target).Convert(gf, Gf.Vec3f(*color)).GetRGB()
            found = converted(np.array(color), ours, space(target))
            assert np.allclose(found, expected, rtol=2e-6, atol=4e-6), (name, target, color)


@pytest.mark.parametrize(
    ("name", "gamut"),
    [("lin_ap1_scene", AP1), ("lin_ap0_scene", AP0), ("lin_p3d65_scene", P3_D65), ("lin_rec2020_scene", REC2020)],
)
def test_matrices_are_those_of_published_primaries(name: str, gamut: tuple[tuple[float, float], ...]) -> None:
    """ACES's with its white adapted to D65 by Bradford, though GfColorSpace has them adapted as primaries."""
    found = matrix(REC709, space(name))
    assert found is not None
    assert np.allclose(found, between(PUBLISHED, gamut), atol=2e-6)
    back = matrix(space(name), REC709)
    assert back is not None
    assert np.allclose(found @ back, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("name", [n for n in NAMES if n.startswith("lin_") and "xyz" not in n])
def test_greys_stay_to_the_bit(name: str) -> None:
    grey = np.repeat(np.random.default_rng(1).random((1000, 1), np.float32), 3, axis=1)
    for source, target in ((REC709, space(name)), (space(name), REC709)):
        assert np.array_equal(transformed(grey, matrix(source, target)), grey)


def test_equal_primaries_need_no_matrix() -> None:
    assert matrix(REC709, space("srgb_rec709_scene")) is None
    assert matrix(space("raw"), ACESCG) is None


def test_custom_whites_are_not_adapted() -> None:
    """GfColorSpace goes through XYZ alone: a space about another white has other greys."""
    warm = ColorSpace("warm", *PUBLISHED[:3], (0.3457, 0.3585))
    expected = between((*PUBLISHED[:3], (0.3457, 0.3585)), PUBLISHED, adapt=False)
    found = matrix(warm, REC709)
    assert found is not None
    assert np.allclose(found, expected, atol=1e-12)
    gf = Gf.ColorSpace("warm", *(Gf.Vec2f(*c) for c in warm.gamut), 1, 0)
    assert np.allclose(Gf.ColorSpace("lin_rec709_scene").Convert(gf, Gf.Vec3f(1)).GetRGB(), expected.sum(axis=1), atol=1e-6)


def test_curves() -> None:
    v = np.array([-0.1, 0.0, 0.02, 0.04045, 0.5, 1.0, 1.5])
    assert np.allclose(linear(v, space("srgb_rec709_scene")), from_srgb(v), atol=1e-15)
    assert np.allclose(linear(v[1:], space("g22_rec709_scene")), v[1:] ** 2.2)
    assert linear(v[:1], space("g22_rec709_scene"))[0] == -0.1
    # A curve of its own: straight up to bias / (gamma - 1), with one tangent there (GfColorSpace).
    custom = ColorSpace("c", *REC709.gamut, 3.0, 0.16)
    gf = Gf.ColorSpace("c", *(Gf.Vec2f(*c) for c in custom.gamut), 3.0, 0.16)
    for x in (0.01, 0.05, 0.0799, 0.0801, 0.5, 1.2):
        assert linear(np.array([x]), custom)[0] == pytest.approx(
            Gf.ColorSpace("lin_rec709_scene").Convert(gf, Gf.Vec3f(x)).GetRGB()[0], rel=2e-6
        )


def test_what_is_no_gamut() -> None:
    good = REC709.gamut
    assert color_space.is_gamut(ColorSpace("g", *good))
    for red, white in (((0.225, 0.33), D65), (good[0], (0.3, 0.0)), ((float("nan"), 0.3), D65)):
        line = (0.225, 0.33)  # on the line between green and blue
        assert not color_space.is_gamut(ColorSpace("g", line if red == line else red, good[1], good[2], white))


def test_earlier_names() -> None:
    assert named("lin_ap1") == ACESCG
    assert named("sRGB") == named("srgb_texture") == named("srgb_rec709_scene")
    assert named("nobody") is None
