"""What is authored as 1,600 lm arrives as 1,600 lm: photometric lights by meters around them, as they are rendered."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.reference.cases.profiles import half_profile, spot_profile, uneven_profile
from tests.reference.metered import WEIGHTS, lumens, picture, stage_at
from tests.reference.stages import Plane, light, rotation, scaling, translation

CLOSE = 2e-3
MIDDLE = translation(0.2, -0.1, 0.3) @ rotation([1, 0.4, 0.2], 50)
SHEARED = MIDDLE @ np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])
AREA, SHAPED = ("PhotometricAreaLightAPI",), ("PhotometricAreaLightAPI", "ShapingAPI")
POWER = "float photometric:power = 1600"
WIDE = "float inputs:shaping:cone:angle = 180"
SPOT = ("float inputs:shaping:cone:angle = 35", "float inputs:shaping:cone:softness = 0.3")
SIZES = {
    "RectLight": ("float inputs:width = 1.3", "float inputs:height = 0.6"),
    "DiskLight": ("float inputs:radius = 0.5",),
    "SphereLight": ("float inputs:radius = 0.5",),
    "CylinderLight": ("float inputs:radius = 0.2", "float inputs:length = 1.2"),
}
KINDS = list(SIZES)


def lamp(kind: str, *lines: str, m: np.ndarray = MIDDLE, apis: tuple[str, ...] = AREA) -> str:
    return light(kind, m, *SIZES[kind], *lines, apis=apis)


def image(folder: Path, pixels: np.ndarray, name: str = "a.exr") -> str:
    oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32)).write(str(folder / name))
    return f"asset inputs:texture:file = @./{name}@"


def profile(folder: Path, text: str) -> str:
    (folder / "a.ies").write_text(text, encoding="ascii")
    return "asset inputs:shaping:ies:file = @./a.ies@"


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
@pytest.mark.parametrize("kind", KINDS)
def test_power(kind: str, tmp_path: Path) -> None:
    """The default of 1,600 lm, where intensity, exposure, colour and normalize say otherwise."""
    others = ("float inputs:intensity = 7", "float inputs:exposure = -3", "color3f inputs:color = (0.2, 0.9, 0.4)")
    assert lumens(tmp_path, lamp(kind, *others)) == pytest.approx(1600, rel=CLOSE)
    assert lumens(tmp_path, lamp(kind, "bool inputs:normalize = 1", POWER, m=SHEARED)) == pytest.approx(1600, rel=CLOSE)


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
@pytest.mark.parametrize("kind", KINDS)
def test_power_of_shaped_lights(kind: str, tmp_path: Path) -> None:
    focused = ("float inputs:shaping:focus = 6", "color3f inputs:shaping:focusTint = (0.3, 0.1, 0.2)")
    for lines, m in ((SPOT, MIDDLE), ((WIDE, *focused), MIDDLE), ((*SPOT, *focused), SHEARED)):
        assert lumens(tmp_path, lamp(kind, POWER, *lines, m=m, apis=SHAPED), spp=256) == pytest.approx(1600, rel=CLOSE)


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("text", [uneven_profile(), spot_profile(), half_profile()], ids=["uneven", "spot", "half"])
def test_power_through_a_profile(kind: str, text: str, tmp_path: Path) -> None:
    file = profile(tmp_path, text)
    scaled = "float inputs:shaping:ies:angleScale = 0.7"
    assert lumens(tmp_path, lamp(kind, POWER, WIDE, file, apis=SHAPED), spp=256) == pytest.approx(1600, rel=CLOSE)
    normalized = lamp(kind, POWER, WIDE, file, scaled, "bool inputs:shaping:ies:normalize = 1", apis=SHAPED, m=SHEARED)
    assert lumens(tmp_path, normalized, spp=256) == pytest.approx(1600, rel=CLOSE)


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
def test_power_of_points_and_lines(tmp_path: Path) -> None:
    for kind, limit in (("SphereLight", "bool treatAsPoint = 1"), ("CylinderLight", "bool treatAsLine = 1")):
        assert lumens(tmp_path, lamp(kind, limit), 0.01) == pytest.approx(1600, rel=CLOSE)
        assert lumens(tmp_path, lamp(kind, limit, *SPOT, apis=SHAPED), spp=256) == pytest.approx(1600, rel=CLOSE)
    assert lumens(tmp_path, light("SphereLight", MIDDLE, "float inputs:radius = 0", apis=AREA)) == pytest.approx(
        1600, rel=CLOSE
    )


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
def test_power_through_an_image(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).random((5, 3, 3)) ** 3 * 10
    for lines, apis in (((), AREA), (SPOT, SHAPED)):
        textured = lamp("RectLight", POWER, image(tmp_path, pixels), "color3f inputs:color = (1, 0.3, 0.1)", *lines, apis=apis)
        assert lumens(tmp_path, textured, spp=256) == pytest.approx(1600, rel=CLOSE)
    missing = lamp("RectLight", POWER, "asset inputs:texture:file = @./none.exr@")
    assert lumens(tmp_path, missing) == pytest.approx(1600, rel=CLOSE)


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
def test_power_in_any_unit(tmp_path: Path) -> None:
    for meters in (0.01, 0.3048, 1000.0):
        assert lumens(tmp_path, lamp("RectLight", POWER), meters) == pytest.approx(1600, rel=CLOSE)


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:power")
def test_each_instance_gives_its_own(tmp_path: Path) -> None:
    """Three of 500 lm, whatever their scales."""
    text = 'def PointInstancer "many" {\n    rel prototypes = </many/one>\n    int[] protoIndices = [0, 0, 0]\n'
    text += "    point3f[] positions = [(0, 0, 0), (1, 1, 0), (-1, 0, 1)]\n"
    text += "    float3[] scales = [(1, 1, 1), (2, 1, 1), (0.1, 0.3, 1)]\n"
    one = light("RectLight", np.eye(4), "float photometric:power = 500", *SPOT, apis=SHAPED, name="one")
    assert lumens(tmp_path, f"{text}{one}}}\n", spp=256) == pytest.approx(1500, rel=CLOSE)


def lux_on(folder: Path, prims: str, plane: Plane, meters: float = 1.0, up: str = "Y", spp: int = 64) -> float:
    return float(picture(stage_at(folder, plane, prims, meters, up), spp).mean(axis=(0, 1)) @ WEIGHTS * math.pi)


AHEAD = ("float photometric:illuminance = 250", "float photometric:illuminance:distance = 2", "float photometric:power = 3")


@pytest.mark.conforms(
    "PhotometricAreaLightAPI.photometric:illuminance", "PhotometricAreaLightAPI.photometric:illuminance:distance"
)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("meters", [1.0, 0.01])
def test_illuminance_ahead(kind: str, meters: float, tmp_path: Path) -> None:
    """On a small patch that faces the light's origin, 2 m along its -Z; the light is as large as its distance, or small."""
    file = profile(tmp_path, uneven_profile())
    for lines, apis in (((), AREA), (SPOT, SHAPED), ((WIDE, file), SHAPED)):
        for m in (MIDDLE, SHEARED, MIDDLE @ scaling(3, 2, 1.5)):
            axis = -m[:3, 2] / np.linalg.norm(m[:3, 2])
            patch = Plane(_looking_back(m[:3, 3] + axis * (2 / meters), axis), 0.01, 0.01)
            found = lux_on(tmp_path, lamp(kind, *AHEAD, *lines, m=m, apis=apis), patch, meters)
            assert found == pytest.approx(250, rel=CLOSE)


def _looking_back(at: np.ndarray, axis: np.ndarray) -> np.ndarray:
    frame = np.eye(4)
    y = -axis
    x = np.cross(y, np.eye(3)[np.argmin(np.abs(y))])
    x /= np.linalg.norm(x)
    frame[:3, :3], frame[:3, 3] = np.stack([x, y, np.cross(x, y)], axis=1), at
    return frame


@pytest.mark.conforms("PhotometricAreaLightAPI.photometric:illuminance")
def test_illuminance_ahead_through_an_image(tmp_path: Path) -> None:
    pixels = np.random.default_rng(2).random((4, 6, 3)) ** 3 * 10
    file = profile(tmp_path, uneven_profile())
    for lines, apis, m in (((), AREA, MIDDLE @ scaling(3, 3, 1)), (SPOT, SHAPED, MIDDLE), ((WIDE, file), SHAPED, SHEARED)):
        axis = -m[:3, 2] / np.linalg.norm(m[:3, 2])
        patch = Plane(_looking_back(m[:3, 3] + axis * 2, axis), 0.01, 0.01)
        textured = lamp("RectLight", *AHEAD, image(tmp_path, pixels), *lines, m=m, apis=apis)
        assert lux_on(tmp_path, textured, patch, spp=256) == pytest.approx(250, rel=CLOSE)


@pytest.mark.conforms("PhotometricDistantLightAPI.photometric:illuminance")
@pytest.mark.parametrize("angle", [0, 0.53, 60, 180, 240])
def test_distant_illuminance(angle: float, tmp_path: Path) -> None:
    m = rotation([1, 0.3, 0.2], 130)
    facing = Plane(_looking_back(np.zeros(3), -m[:3, 2]))
    lines = (f"float inputs:angle = {angle}", "color3f inputs:color = (0.2, 0.4, 1)", "bool inputs:normalize = 1")
    sun = light("DistantLight", m, *lines, apis=("PhotometricDistantLightAPI",))
    assert lux_on(tmp_path, sun, facing, 0.01) == pytest.approx(10000, rel=CLOSE)


def sky(folder: Path, seed: int, height: int, width: int) -> str:
    return image(folder, np.random.default_rng(seed).random((height, width, 3)) ** 4 * 30)


@pytest.mark.conforms("PhotometricDomeLightAPI.photometric:illuminance")
@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("layout", ["", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross"])
def test_dome_illuminance(layout: str, up: str, tmp_path: Path) -> None:
    """On what faces the stage's up axis, whichever way the dome is turned."""
    facing = Plane(np.eye(4) if up == "Y" else rotation([1, 0, 0], 90))
    lines = ["float photometric:illuminance = 5000", "float inputs:intensity = 0.02", "color3f inputs:color = (0.3, 0.6, 0.9)"]
    if layout:
        shape = {"latlong": (8, 16), "cubeMapVerticalCross": (16, 12)}.get(layout, (12, 12))
        lines += [sky(tmp_path, 3, *shape), f'token inputs:texture:format = "{layout}"']
    for kind in ("DomeLight", "DomeLight_1"):
        dome = light(kind, MIDDLE, *lines, apis=("PhotometricDomeLightAPI",))
        assert lux_on(tmp_path, dome, facing, up=up, spp=1024) == pytest.approx(5000, rel=CLOSE)


@pytest.mark.conforms("PhotometricDomeLightAPI.photometric:illuminance")
def test_dome_illuminance_of_a_large_image(tmp_path: Path) -> None:
    """Whose texels are read as they are; half of it black."""
    rows = np.where(np.arange(1024) < 512, 1.0, 0.0)[:, None, None] * np.ones((1024, 2048, 3))
    half = image(tmp_path, rows)
    dome = light("DomeLight", np.eye(4), half, apis=("PhotometricDomeLightAPI",))
    assert lux_on(tmp_path, dome, Plane()) == pytest.approx(10000, rel=CLOSE)


@pytest.mark.conforms("Camera.exposure:fStop", "Camera.exposure:iso", "Camera.exposure:time", "Camera.exposure:responsivity")
def test_a_grey_card_under_a_known_lux(tmp_path: Path) -> None:
    """Luminance E albedo / pi, times what UsdGeomCamera's exposure multiplies it by."""
    card, sun = Plane(), light("DistantLight", rotation([1, 0, 0], -90), "float photometric:illuminance = 80000")
    stage = stage_at(tmp_path, card, sun)
    camera = stage.GetPrimAtPath("/view/camera")
    for name, value in (("time", 1 / 125), ("iso", 200.0), ("fStop", 16.0), ("responsivity", 0.012)):
        camera.GetAttribute(f"exposure:{name}").Set(value)
    camera.GetAttribute("exposure").Set(1.0)
    stage.GetPrimAtPath("/view/ground").GetAttribute("primvars:displayColor").Set([(0.18, 0.18, 0.18)])
    expected = 80000 * 0.18 / math.pi * (0.012 * (1 / 125) * (200 / 100) * 2 / 16**2)
    assert picture(stage, 16).mean() == pytest.approx(expected, rel=CLOSE)
