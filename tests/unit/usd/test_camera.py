"""Cameras against GfCamera, conform policies by the UsdRender text, framing by usdrecord's formula."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, UsdGeom

from primray.description import Camera, Projection
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd.adapters.camera import Aperture, conform
from primray.usd.adapters.render_product import ProductSettings

from .usd_text import stage_of, translate_text

TEXT = """def Xform "rig"
{
    double3 xformOp:translate = (3, -2, 8)
    float3 xformOp:rotateXYZ = (20, 130, -5)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    def Camera "camera"
    {
        token projection = "PROJECTION"
        float focalLength = 35
        float horizontalAperture = 30
        float verticalAperture = 20
        float horizontalApertureOffset = 2
        float verticalApertureOffset = -1
        float2 clippingRange = (0.1, 500)
    }
}
"""


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_projects_as_gf_frustum_does(projection: str) -> None:
    text = TEXT.replace("PROJECTION", projection)
    stage = stage_of(text)
    camera = translate_text(text, RenderSettings(resolution=(300, 200)))[0].camera
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/rig/camera")).GetCamera(0).frustum
    rng = np.random.default_rng(0)
    local = np.column_stack([rng.uniform(-1, 1, (50, 2)), rng.uniform(-9, -2, 50), np.ones(50)])
    points = (local @ camera.world_from_camera.T)[:, :3]
    matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    ndc = np.array([matrix.Transform(Gf.Vec3d(*p.tolist())) for p in points])
    expected = np.column_stack([(ndc[:, 0] + 1) * 150, (1 - ndc[:, 1]) * 100])
    assert np.abs(camera.project(points, (300, 200)) - expected).max() < 1e-4


def test_orthographic_width_is_a_tenth_of_the_aperture() -> None:
    camera = translate_text(TEXT.replace("PROJECTION", "orthographic"), RenderSettings(resolution=(300, 200)))[0].camera
    assert camera.projection is Projection.ORTHOGRAPHIC
    left, right, bottom, top = camera.window
    assert (right - left, top - bottom) == pytest.approx((3, 2))


WIDE, TALL = Aperture(40, 20), Aperture(10, 20)  # aspects 2 and 0.5, image aspect 1


@pytest.mark.parametrize(
    ("policy", "wide", "tall"),
    [
        ("expandAperture", (40, 40), (20, 20)),
        ("cropAperture", (20, 20), (10, 10)),
        ("adjustApertureWidth", (20, 20), (20, 20)),
        ("adjustApertureHeight", (40, 40), (10, 10)),
        ("adjustPixelAspectRatio", (40, 20), (10, 20)),
    ],
)
def test_conform_policies(policy: str, wide: tuple[float, float], tall: tuple[float, float]) -> None:
    for aperture, expected in ((WIDE, wide), (TALL, tall)):
        found = conform(aperture, (50, 50), ProductSettings(conform_policy=policy))
        assert (found.width, found.height) == expected


def test_pixel_aspect_ratio_widens_the_image() -> None:
    found = conform(TALL, (50, 50), ProductSettings(pixel_aspect_ratio=2.0))
    assert (found.width, found.height) == (40, 20)


def camera_of(body: str) -> tuple[Camera, list[str]]:
    description, found = translate_text(f'def Camera "camera"\n{{\n{body}\n}}\n')
    return description.camera, [code for code, _ in found]


def test_thin_lens_and_exposure() -> None:
    camera, _ = camera_of("float fStop = 2\nfloat focusDistance = 9\nfloat focalLength = 80")
    assert (camera.lens_radius, camera.focus_distance) == pytest.approx((2, 9))
    assert camera_of("float fStop = 2")[0].lens_radius == 0
    assert camera_of("float focusDistance = 2")[0].lens_radius == 0
    body = "float exposure = 3\nfloat exposure:iso = 50\nfloat exposure:time = 0.25\nfloat exposure:fStop = 4"
    body += "\nfloat exposure:responsivity = 2"
    stage = stage_of(f'def Camera "camera"\n{{\n{body}\n}}\n')
    expected = UsdGeom.Camera(stage.GetPrimAtPath("/camera")).ComputeLinearExposureScale()
    assert camera_of(body)[0].exposure_scale == pytest.approx(expected)
    assert expected == pytest.approx(2 * 0.25 * 0.5 * 8 / 16)
    camera, codes = camera_of("float exposure:fStop = 0")
    assert math.isfinite(camera.exposure_scale)
    assert "camera-input" in codes


def test_scaled_and_mirrored_cameras_become_rigid() -> None:
    for scale in ("(3, 3, 3)", "(-1, 1, 1)", "(1, 2, 5)"):
        op = f"float3 xformOp:scale = {scale}\ndouble xformOp:rotateY = 30\n"
        op += 'uniform token[] xformOpOrder = ["xformOp:rotateY", "xformOp:scale"]'
        camera, codes = camera_of(op)
        linear = camera.world_from_camera[:3, :3]
        assert np.allclose(linear @ linear.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(linear) == pytest.approx(1)
        assert "camera-scaled" in codes
    assert (
        "camera-scaled" not in camera_of('double xformOp:rotateY = 30\nuniform token[] xformOpOrder = ["xformOp:rotateY"]')[1]
    )


BOX = """#usda 1.0
(
    upAxis = "UP"
)
def Cube "box"
{
    double3 xformOp:translate = (10, 20, 30)
    float3 xformOp:scale = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
def Sphere "guide"
{
    uniform token purpose = "guide"
    double radius = 1000
}
"""


def test_automatic_camera_frames_as_usdrecord() -> None:
    description, found = translate_text(BOX.replace("UP", "Y"))
    tan_half = 20.955 / 2 / 50
    distance = math.hypot(1, 2) / tan_half + 3
    assert np.allclose(description.camera.world_from_camera[:3, 3], (10, 20, 30 + distance))
    assert np.allclose(description.camera.world_from_camera[:3, :3], np.eye(3))
    assert description.resolution == (960, 701)  # 20.955 x 15.2908
    assert ("camera-automatic", "") in found
    z_up = translate_text(BOX.replace("UP", "Z"))[0].camera.world_from_camera
    distance = math.hypot(1, 3) / tan_half + 2
    assert np.allclose(z_up[:3, 3], (10, 20 - distance, 30))
    assert np.allclose(z_up[:3, 2], (0, -1, 0))  # back, so it looks along +Y
    assert np.allclose(z_up[:3, 1], (0, 0, 1))


def test_automatic_camera_without_anything_to_see() -> None:
    camera = translate_text("")[0].camera
    assert np.isfinite(camera.world_from_camera).all()


TWO = """def Camera "one"
{
}
def Xform "x"
{
    def Camera "two"
    {
        float horizontalAperture = 40
        float verticalAperture = 20
    }
}
"""


def test_choice_of_camera() -> None:
    assert translate_text(TWO)[0].camera.path == "/one"
    assert translate_text(TWO, RenderSettings(camera="/x/two"))[0].camera.path == "/x/two"
    assert translate_text(TWO, RenderSettings(camera="two"))[0].camera.path == "/x/two"
    settings = 'def RenderSettings "settings"\n{\n    rel camera = </x/two>\n}\n'
    assert translate_text(TWO + settings)[0].camera.path == "/x/two"
    with pytest.raises(SettingsError, match="/x/two") as error:
        translate_text(TWO, RenderSettings(camera="/three"))
    assert error.value.code == "unknown-camera"
    for odd in ("", "a b", "/", "..", "/one.attribute"):
        with pytest.raises(SettingsError):
            translate_text(TWO, RenderSettings(camera=odd))


def test_resolution() -> None:
    two = RenderSettings(camera="two")
    assert translate_text(TWO, two)[0].resolution == (960, 480)
    assert translate_text(TWO, RenderSettings(camera="two", resolution=(100, 0)))[0].resolution == (100, 50)
    assert translate_text(TWO, RenderSettings(camera="two", resolution=(0, 100)))[0].resolution == (200, 100)
    settings = 'def RenderSettings "s"\n{\n    rel camera = </x/two>\n    uniform int2 resolution = (64, 64)\n}\n'
    description = translate_text(TWO + settings)[0]
    assert description.resolution == (64, 64)
    left, right, bottom, top = description.camera.window
    assert (right - left, top - bottom) == pytest.approx((0.8, 0.8))  # expanded upwards
    product = 'def RenderProduct "p"\n{\n    uniform int2 resolution = (32, 16)\n}\n'
    described = TWO + settings.replace("rel camera", "rel products = </p>\n    rel camera") + product
    assert translate_text(described)[0].resolution == (32, 16)
    with pytest.raises(SettingsError):
        translate_text(TWO, RenderSettings(resolution=(0, 0)))


def test_diagnostics_are_known() -> None:
    with pytest.raises(KeyError):
        Diagnostics().add("no-such-code", "", "")
