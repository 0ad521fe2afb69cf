"""Shutters that roll, and who says when a shutter is open."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.usd.camera.lens_text import Said, translated

from primray.description import Camera, Exposure


def exposure_of(body: str, stage: str = "", **settings: Any) -> tuple[Exposure | None, Camera, Said]:
    header = f'#usda 1.0\n(\n    upAxis = "Y"\n    timeCodesPerSecond = 20\n{stage})\n'
    moving = 'def Sphere "ball" {\ndouble3 xformOp:translate.timeSamples = {0: (0, 0, 0), 10: (1, 0, 0)}\n'
    moving += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    text = f'{header}def Camera "eye"\n{{\n{body}\n}}\n{moving}'
    description, said = translated(text, time_code=2.0, resolution=(11, 5), **settings)
    return description.exposure, description.camera, said


ROLLING = """token omni:rtx:rollingShutter:scanOrder = "{0}"
double2 omni:rtx:rollingShutter:lineOffset = (1, 100)
double2 omni:rtx:rollingShutter:lineExposure = (1, 50)
double shutter:open = 0.5
double shutter:close = 0.75
"""


@pytest.mark.parametrize(
    ("order", "first", "per_line", "span"),
    [
        ("topToBottom", 0.5, (0, 0.2), (0.5, 1.7)),
        ("bottomToTop", 1.3, (0, -0.2), (0.5, 1.7)),
        ("leftToRight", 0.5, (0.2, 0), (0.5, 2.9)),
        ("rightToLeft", 2.5, (-0.2, 0), (0.5, 2.9)),
    ],
)
def test_a_rolling_shutter(order: str, first: float, per_line: tuple[float, float], span: tuple[float, float]) -> None:
    """At 20 time codes a second a hundredth of a second is 0.2 of them, a fiftieth 0.4."""
    found, camera, said = exposure_of(ROLLING.format(order))
    assert said == []
    assert found is not None
    assert (found.opens, found.closes) == pytest.approx((first, first + 0.4))
    assert (found.per_column, found.per_row) == pytest.approx(per_line)
    assert found.span == pytest.approx(span)
    assert camera.shutter == pytest.approx(span)


@pytest.mark.parametrize(("readout", "first", "per_row"), [(1.2, 0.5, 0.3), (-1.2, 1.7, -0.3)])
def test_a_readout_is_from_the_first_row_to_the_last(readout: float, first: float, per_row: float) -> None:
    body = f"float primray:lens:rollingShutter:readout = {readout}\ndouble shutter:open = 0.5\ndouble shutter:close = 0.75"
    found, _, said = exposure_of(body)
    assert said == []
    assert found is not None
    assert (found.opens, found.closes, found.per_row) == pytest.approx((first, first + 0.25, per_row))
    assert found.span == pytest.approx((0.5, 1.95))
    still, _, _ = exposure_of(body.replace("close = 0.75", "close = 0.5"))  # each row is a still of its own
    assert still is not None
    assert (still.opens, still.closes, still.per_row) == pytest.approx((first, first, per_row))


def test_lines_without_an_exposure_have_the_shutters() -> None:
    body = "\n".join(line for line in ROLLING.format("topToBottom").splitlines() if "lineExposure" not in line)
    found, _, _ = exposure_of(body)
    assert found is not None
    assert (found.opens, found.closes) == pytest.approx((0.5, 0.75))


def test_who_says_when_the_shutter_is_open() -> None:
    for settings in ({"motion_blur": False}, {"shutter": (0, 0)}):
        assert exposure_of(ROLLING.format("topToBottom"), **settings)[0] is None
    found, _, said = exposure_of(ROLLING.format("sideways"))
    assert said == [("camera-input", "omni:rtx:rollingShutter:scanOrder")]
    assert found is not None
    assert (found.closes, found.per_row) == (0.75, 0)
    found, _, said = exposure_of(ROLLING.format("topToBottom").replace("(1, 100)", "(1, 0)"))
    assert said == [("out-of-range", "omni:rtx:rollingShutter:lineOffset")]
