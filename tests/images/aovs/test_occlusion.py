"""Occlusion as an output: against closed forms, with its error, within a distance that is said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import primray

CAMERA = """
def Camera "c" { double3 xformOp:translate = (0, 0, 0.02)
 float2 clippingRange = (0.001, 1000)
 token projection = "orthographic"
 float horizontalAperture = 0.5
 float verticalAperture = 0.5
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def quad(name: str, half: float, z: float) -> str:
    return f"""def Mesh "{name}" {{ int[] faceVertexCounts = [4]
 int[] faceVertexIndices = [0, 1, 2, 3]
 point3f[] points = [({-half}, {-half}, {z}), ({half}, {-half}, {z}), ({half}, {half}, {z}), ({-half}, {half}, {z})]
}}
"""


def disc(name: str, radius: float, z: float) -> str:
    """A regular polygon of as good as the disc's area."""
    count = 256
    angles = 2 * np.pi * np.arange(count) / count
    points = ", ".join(f"({radius * np.cos(a):.7g}, {radius * np.sin(a):.7g}, {z})" for a in angles)
    return f"""def Mesh "{name}" {{ int[] faceVertexCounts = [{count}]
 int[] faceVertexIndices = {list(range(count))}
 point3f[] points = [{points}]
}}
"""


def seen(shapes: str, aov: str = "occlusion", meters_per_unit: float = 1.0, **values: Any) -> primray.Image:
    from pxr import Usd

    made = Usd.Stage.CreateInMemory("occlusion.usda")
    assert made.GetRootLayer().ImportFromString(f"#usda 1.0\n(metersPerUnit = {meters_per_unit})\n{CAMERA}{shapes}")
    return primray.render(made, resolution=(32, 32), spp=2, aovs=[aov], aov_errors=True, camera="/c", progress=False, **values)


def mean(image: primray.Image) -> tuple[float, float]:
    """Of the picture's pixels, and the standard error of that."""
    (aov,) = image.aovs.values()
    assert aov.errors is not None
    return float(aov.values.mean()), float(np.sqrt(np.mean(aov.errors.astype(float) ** 2) / aov.values.size))


FLOOR = quad("floor", 50.0, 0.0)


@pytest.mark.parametrize(
    ("shapes", "aov", "meters_per_unit", "expected"),
    [
        (FLOOR, "occlusion", 1.0, 1.0),
        # A disc of radius r at height h over a point closes r^2 / (r^2 + h^2) of the cosine-weighted directions.
        (FLOOR + disc("lid", 1.0, 1.0), "occlusion:100", 1.0, 0.5),
        (FLOOR + disc("lid", 2.0, 1.0), "occlusion:100", 1.0, 0.2),
        # Within d of a lid without end at height h: cosines above h / d, so h^2 / d^2 is open.
        (FLOOR + quad("lid", 50.0, 0.5), "occlusion", 1.0, 0.25),
        (FLOOR + quad("lid", 50.0, 0.5), "occlusion", 0.5, 0.0625),  # a metre is two units
        (FLOOR + quad("lid", 50.0, 0.5), "occlusion:0.625", 0.01, 0.64),
        (FLOOR + quad("lid", 50.0, 0.5), "occlusion:0.4", 1.0, 1.0),
        ("", "occlusion", 1.0, 1.0),
    ],
)
def test_closed_forms(shapes: str, aov: str, meters_per_unit: float, expected: float) -> None:
    image = seen(shapes + (quad("away", 1.0, -500.0) if not shapes else ""), aov, meters_per_unit)
    found, error = mean(image)
    assert abs(found - expected) < 4.5 * error + 1e-4 + 0.003 * (0 < expected < 1)
    (made,) = image.aovs.values()
    assert made.channels == ("occlusion",)
    assert error < 0.002
    assert (error > 0) == (0 < expected < 1)


def test_its_errors_are_those_that_it_has() -> None:
    image = seen(FLOOR + disc("lid", 1.0, 1.0), "occlusion:100")
    (aov,) = image.aovs.values()
    truth = 0.5  # at the centre; nearly so over a picture of a quarter of the radius
    assert aov.errors is not None
    ratio = np.mean((aov.values - truth) ** 2) / np.mean(aov.errors.astype(float) ** 2)
    assert 0.8 < ratio < 1.3


def test_it_is_the_same_for_all_seeds_and_threads_and_changes_no_pixel() -> None:
    shapes = FLOOR + disc("lid", 1.0, 1.0)
    a, b = seen(shapes, threads=1), seen(shapes, threads=2, seed=3)
    assert np.array_equal(a.aovs["occlusion"].values, b.aovs["occlusion"].values)
    assert np.array_equal(a.pixels, seen(shapes, "depth", threads=1).pixels)


@pytest.mark.parametrize("name", ["occlusion:0", "occlusion:-1", "occlusion:x", "occlusion:inf", "occlusion:"])
def test_distances_that_are_none(name: str) -> None:
    with pytest.raises(primray.PrimrayError, match="unknown-aov"):
        primray.RenderSettings(aovs=[name])
