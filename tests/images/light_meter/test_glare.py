"""Ratings of glare against closed forms: a uniform field with one bright disc, as evalglare's users check it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pxr import Gf, UsdLux

from primray import rate_glare
from primray.errors import SettingsError
from primray.light_meter.glare import GlareRating, pixel_directions, position_index

from .test_closed_forms import light, new_stage


def view(field: float, source: float, diameter: float, above: float, **more: Any) -> GlareRating:
    """A disc of `diameter` degrees, `above` degrees over the line of sight along -Z, in a field of uniform luminance."""
    stage = new_stage()
    light(stage, UsdLux.DomeLight, (0, 0, 0), intensity=field)
    disc = UsdLux.DiskLight.Define(stage, "/disc")
    angle = math.radians(above)
    disc.AddTranslateOp().Set(Gf.Vec3d(0, 10 * math.sin(angle), -10 * math.cos(angle)))
    disc.AddRotateXOp().Set(180 + above)
    disc.CreateRadiusAttr(10 * math.tan(math.radians(diameter / 2)))
    disc.CreateIntensityAttr(source)
    return rate_glare(stage, (0, 0, 0), (0, 0, -1), spp=4, target=0.005, **{"pixels": 400, **more})


@pytest.mark.parametrize(
    ("field", "source", "diameter", "above", "dgp", "ugr"),
    [
        (500, 20_000, 10, 0, 0.3583, 29.437),
        (500, 20_000, 10, 30, 0.2943, 21.040),
        (1000, 50_000, 5, 20, 0.3840, 23.275),
    ],
)
def test_a_disc_in_a_uniform_field(field: float, source: float, diameter: float, above: float, dgp: float, ugr: float) -> None:
    found = view(field, source, diameter, above)
    assert len(found.sources) == 1
    assert found.sources[0].luminance == pytest.approx(source, rel=0.07)  # its rim shares pixels with the field
    assert found.sources[0].solid_angle == pytest.approx(2 * math.pi * (1 - math.cos(math.radians(diameter / 2))), rel=0.07)
    assert found.background == pytest.approx(field, rel=0.03)
    assert found.dgp[0] == pytest.approx(dgp, abs=0.003)
    assert found.ugr is not None
    assert found.ugr[0] == pytest.approx(ugr, abs=0.3)
    assert found.dgp[1] < found.dgp[0] < found.dgp[2] < found.dgp[0] + 0.01


@pytest.mark.parametrize("pixels", [100, 200])
def test_intervals_hold_what_pixels_on_the_rim_hide(pixels: int) -> None:
    """The noise alone explains a tenth of the difference from the closed form."""
    found = view(1000, 50_000, 5, 20, pixels=pixels)
    assert found.ugr is not None
    assert found.ugr[1] < 23.275 < found.ugr[2] < 24
    assert found.dgp[1] < 0.3840 < found.dgp[2] < 0.39
    assert 23.275 - found.ugr[0] > found.ugr[0] - found.ugr[1] + 0.1


def test_classes_and_what_does_not_dazzle() -> None:
    found = view(100, 100, 10, 0)
    assert found.ugr is None
    assert not found.sources
    assert found.comfort == "imperceptible"
    assert not found.is_valid
    assert view(500, 20_000, 10, 0, threshold=50_000).ugr is None
    dazzling = view(4000, 200_000, 20, 0)
    assert dazzling.comfort == "intolerable"


def test_the_position_index() -> None:
    ahead = position_index(np.array([0.0, 0.0, -1.0]))
    angle = math.radians(30)
    above = position_index(np.array([0.0, math.sin(angle), -math.cos(angle)]))
    beside = position_index(np.array([math.sin(angle), 0.0, -math.cos(angle)]))
    assert ahead == 1
    assert above == pytest.approx(3.348, abs=0.002)
    assert above > beside > 1
    assert position_index(np.array([0.0, -math.sin(angle), -math.cos(angle)])) == pytest.approx(beside)


def test_pixels_of_a_fisheye_cover_half_of_all_directions() -> None:
    directions, solid = pixel_directions(200)
    assert solid.sum() == pytest.approx(2 * math.pi, rel=1e-3)
    assert np.allclose(np.linalg.norm(directions[solid > 0], axis=-1), 1)
    assert (solid * -directions[..., 2]).sum() == pytest.approx(math.pi, rel=1e-3)


def test_what_is_refused() -> None:
    stage = new_stage()
    with pytest.raises(SettingsError, match="pixels across"):
        rate_glare(stage, (0, 0, 0), (0, 0, -1), pixels=4)
    with pytest.raises(SettingsError, match="up not along the view"):
        rate_glare(stage, (0, 0, 0), (0, 1, 0), spp=2)
    with pytest.raises(SettingsError, match="a threshold"):
        rate_glare(stage, (0, 0, 0), (0, 0, -1), threshold=-1.0)
