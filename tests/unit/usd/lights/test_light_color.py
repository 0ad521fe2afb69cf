"""A light's colour by its illuminant."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.color.test_spectrum_illuminants import D65, STEPS

from primray.color.color_space import ACESCG, REC709, luminance_weights
from primray.color.spectrum import black_body, rgb_of

from .physical_text import physical

API = "PhysicalLightIlluminantAPI"
PLAIN = (1, 1, 1)


def said(name: str, more: str = "") -> str:
    return f'token physical:illuminant = "{name}"\n{more}'


def custom(nm: object, radiance: object) -> str:
    pairs = ", ".join(f"({a:g}, {b:g})" for a, b in zip(np.array(nm), np.array(radiance), strict=True))
    return said("custom", f"float2[] physical:customIlluminant = [{pairs}]")


@pytest.mark.conforms("PhysicalLightIlluminantAPI.physical:illuminant")
def test_white_is_the_rendering_spaces() -> None:
    for body, apis in ((said("white"), ""), ("", API)):
        for space in ("lin_rec709_scene", "lin_ap1_scene"):
            light, noted = physical(body, apis=apis, space=space)
            assert (light.emission, noted) == (PLAIN, set())


@pytest.mark.conforms("PhysicalLightIlluminantAPI.physical:illuminant")
@pytest.mark.parametrize(("name", "space"), [("lin_rec709_scene", REC709), ("lin_ap1_scene", ACESCG)])
def test_a_black_body(name: str, space: object) -> None:
    light, noted = physical(said("blackbody", "float inputs:colorTemperature = 3000"), space=name)
    assert noted == set()
    expected = rgb_of(black_body(3000), space)  # type: ignore[arg-type]
    assert light.emission == pytest.approx(expected)
    assert np.dot(light.emission, luminance_weights(space)) == pytest.approx(1, rel=1e-3)  # type: ignore[arg-type]


@pytest.mark.conforms("PhysicalLightIlluminantAPI.physical:illuminant")
def test_daylight() -> None:
    for token in ("illuminant D", "illuminantD"):
        light, noted = physical(said(token, "float inputs:colorTemperature = 6504"))
        assert noted == set()
        assert light.emission == pytest.approx(PLAIN, abs=1e-3)
    omniverse, _ = physical(said("illuminantD", "float physical:colorTemperature = 5003\nfloat inputs:colorTemperature = 6504"))
    assert omniverse.emission[0] > 1.1


@pytest.mark.conforms("PhysicalLightIlluminantAPI.physical:customIlluminant")
def test_a_spectrum() -> None:
    """D65 is white, also at a thousandth of its power; nothing counts outside of the pairs."""
    for scale in (1.0, 1e-3):
        light, noted = physical(custom(STEPS, np.array(D65) * scale))
        assert noted == set()
        assert light.emission == pytest.approx(PLAIN, abs=1e-3)
    light, noted = physical(custom([300, 1000], [1, 1]))
    assert light.emission == pytest.approx((1.2051, 0.9483, 0.9088), abs=3e-3)  # of equal energy: x = y = 1/3


def test_colors_outside_of_the_space_keep_their_luminance() -> None:
    light, noted = physical(custom([519, 520, 521], [0, 1, 0]))
    assert noted == {("out-of-range", "physical:illuminant")}
    assert min(light.emission) == 0
    assert np.dot(light.emission, luminance_weights(REC709)) == pytest.approx(1)


def test_an_illuminant_takes_the_place_of_the_temperature() -> None:
    warm = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000\n"
    light, noted = physical(warm, apis=API)
    assert (light.emission, noted) == (PLAIN, {("light-input", "inputs:enableColorTemperature")})
    assert physical(warm + said("blackbody"))[1] == set()
    assert physical(warm)[0].emission[0] > 1.5  # without an illuminant


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (said("fluorescent"), ("light-input", "physical:illuminant")),
        (said("custom"), ("light-input", "physical:customIlluminant")),
        (custom([500], [1]), ("light-input", "physical:customIlluminant")),
        (custom([500, 500], [1, 1]), ("light-input", "physical:customIlluminant")),
        (custom([600, 500], [1, 1]), ("light-input", "physical:customIlluminant")),
        (custom([500, 600], [1, np.nan]), ("light-input", "physical:customIlluminant")),
        (custom([900, 1000], [1, 1]), ("light-input", "physical:illuminant")),
        (custom([500, 600], [0, 0]), ("light-input", "physical:illuminant")),
        (said("custom", "float[] physical:customIlluminant = [1, 2]"), ("light-input", "physical:customIlluminant")),
        ("float2[] physical:customIlluminant = [(400, 1), (700, 1)]", ("light-input", "physical:customIlluminant")),
    ],
)
def test_what_is_no_spectrum_is_white_and_told(body: str, expected: tuple[str, str]) -> None:
    light, noted = physical(body)
    assert (light.emission, noted) == (PLAIN, {expected})


def test_values_out_of_range() -> None:
    assert physical(said("blackbody", "float inputs:colorTemperature = -5"))[1] >= {("out-of-range", "inputs:colorTemperature")}
    assert physical(said("illuminant D", "float inputs:colorTemperature = 2000"))[1] == {
        ("out-of-range", "inputs:colorTemperature")
    }
    assert physical(custom([400, 500, 700], [1, -1, 1]))[1] >= {("out-of-range", "physical:customIlluminant")}
