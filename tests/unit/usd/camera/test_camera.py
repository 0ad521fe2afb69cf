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
from primray.usd.camera.camera import Aperture, conform, pixel_aspect_ratio
from primray.usd.render_settings.render_product import ProductSettings

from ..usd_text import stage_of, translate_text

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


@pytest.mark.conforms(
    "Camera.projection",
    "Camera.focalLength",
    "Camera.horizontalAperture",
    "Camera.verticalAperture",
    "Camera.horizontalApertureOffset",
    "Camera.verticalApertureOffset",
)
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


@pytest.mark.conforms("Camera.projection", "Camera.horizontalAperture")
def test_orthographic_width_is_a_tenth_of_the_aperture() -> None:
    camera = translate_text(TEXT.replace("PROJECTION", "orthographic"), RenderSettings(resolution=(300, 200)))[0].camera
    assert camera.projection is Projection.ORTHOGRAPHIC
    left, right, bottom, top = camera.window
    assert (right - left, top - bottom) == pytest.approx((3, 2))


WIDE, TALL = Aperture(40, 20, 3, -1), Aperture(10, 20, 3, -1)  # aspects 2 and 0.5

# Policy, pixels (50 x 50) of aspect 1 and of aspect 2: what becomes of WIDE and of TALL, and the pixels' aspect in the end.
Sizes = tuple[float, float]
POLICIES: dict[tuple[str, float], tuple[Sizes, Sizes, float, float]] = {
    ("expandAperture", 1): ((40, 40), (20, 20), 1, 1),
    ("expandAperture", 2): ((40, 20), (40, 20), 2, 2),
    ("expandAperture", 4): ((80, 20), (80, 20), 4, 4),
    ("cropAperture", 1): ((20, 20), (10, 10), 1, 1),
    ("cropAperture", 2): ((40, 20), (10, 5), 2, 2),
    ("cropAperture", 4): ((40, 10), (10, 2.5), 4, 4),
    ("adjustApertureWidth", 1): ((20, 20), (20, 20), 1, 1),
    ("adjustApertureWidth", 4): ((80, 20), (80, 20), 4, 4),
    ("adjustApertureHeight", 1): ((40, 40), (10, 10), 1, 1),
    ("adjustApertureHeight", 4): ((40, 10), (10, 2.5), 4, 4),
    ("adjustPixelAspectRatio", 1): ((40, 20), (10, 20), 2, 0.5),
    ("adjustPixelAspectRatio", 4): ((40, 20), (10, 20), 2, 0.5),
}


@pytest.mark.conforms("RenderSettingsBase.aspectRatioConformPolicy", "RenderSettingsBase.pixelAspectRatio")
@pytest.mark.parametrize(("policy", "aspect"), POLICIES)
def test_conform_policies(policy: str, aspect: float) -> None:
    wide, tall, *ratios = POLICIES[policy, aspect]
    product = ProductSettings(conform_policy=policy, pixel_aspect_ratio=aspect)
    for aperture, expected, ratio in ((WIDE, wide, ratios[0]), (TALL, tall, ratios[1])):
        found = conform(aperture, (50, 50), product)
        assert (found.width, found.height) == expected
        assert (found.offset_x, found.offset_y) == (3, -1)  # they shift what was adjusted
        assert pixel_aspect_ratio(aperture, (50, 50), product) == ratio
        if policy == "adjustPixelAspectRatio":
            assert pixel_aspect_ratio(aperture, (100, 50), product) == ratio / 2


@pytest.mark.conforms(
    "RenderSettingsBase.aspectRatioConformPolicy",
    "RenderSettingsBase.pixelAspectRatio",
    "RenderSettingsBase.resolution",
    "Camera.horizontalApertureOffset",
    "Camera.verticalApertureOffset",
)
@pytest.mark.parametrize(("policy", "aspect"), POLICIES)
def test_pictures_cover_the_conformed_aperture(policy: str, aspect: float) -> None:
    """Corners of the aperture at unit distance are at corners of the picture, whose pixels are square in the end."""
    text = 'def Camera "eye"\n{\nfloat focalLength = 50\nfloat horizontalAperture = 40\nfloat verticalAperture = 20\n'
    text += "float horizontalApertureOffset = 3\nfloat verticalApertureOffset = -1\n}\n"
    text += f'def RenderSettings "s"\n{{\nuniform int2 resolution = (50, 50)\nuniform float pixelAspectRatio = {aspect}\n'
    text += f'uniform token aspectRatioConformPolicy = "{policy}"\n}}\n'
    description = translate_text(text)[0]
    (width, height), _, ratio, _ = POLICIES[policy, aspect]
    corners = [[(3 + x * width / 2) / 50, (-1 + y * height / 2) / 50, -1] for x in (-1, 1) for y in (-1, 1)]
    pixels = description.camera.project(corners, description.resolution)
    assert np.abs(pixels - [[0, 50], [0, 0], [50, 50], [50, 0]]).max() < 1e-4
    assert description.pixel_aspect_ratio == ratio
    assert width / 50 / (height / 50) == pytest.approx(ratio)


def camera_of(body: str) -> tuple[Camera, list[str]]:
    description, found = translate_text(f'def Camera "camera"\n{{\n{body}\n}}\n')
    return description.camera, [code for code, _ in found]


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


USDRECORD = RenderSettings(auto_camera="usdrecord")


def test_automatic_camera_frames_as_usdrecord() -> None:
    description, found = translate_text(BOX.replace("UP", "Y"), USDRECORD)
    tan_half = 20.955 / 2 / 50
    distance = math.hypot(1, 2) / tan_half + 3
    assert np.allclose(description.camera.world_from_camera[:3, 3], (10, 20, 30 + distance))
    assert np.allclose(description.camera.world_from_camera[:3, :3], np.eye(3))
    assert description.resolution == (960, 701)  # 20.955 x 15.2908
    assert ("camera-automatic", "") in found
    z_up = translate_text(BOX.replace("UP", "Z"), USDRECORD)[0].camera.world_from_camera
    distance = math.hypot(1, 3) / tan_half + 2
    assert np.allclose(z_up[:3, 3], (10, 20 - distance, 30))
    assert np.allclose(z_up[:3, 2], (0, -1, 0))  # back, so it looks along +Y
    assert np.allclose(z_up[:3, 1], (0, 0, 1))


def test_automatic_camera_without_anything_to_see() -> None:
    camera = translate_text("", USDRECORD)[0].camera
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


@pytest.mark.conforms("RenderSettingsBase.camera")
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


@pytest.mark.conforms("RenderSettingsBase.resolution", "RenderSettings.products")
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
