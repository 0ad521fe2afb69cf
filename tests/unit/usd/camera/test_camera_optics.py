"""What UsdGeomCamera says of lens, aperture, shutter, clipping and exposure, and of things that are not followed."""

from __future__ import annotations

import math

import pytest
from pxr import UsdGeom
from tests.unit.usd.camera.optics_text import (
    MOVING,
    SHUTTER,
    camera_of,
    exposed,
    only,
    stage_with,
)

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

LENS = "float fStop = 2\nfloat focusDistance = 9\nfloat focalLength = 80\n"


@pytest.mark.conforms("Camera.fStop", "Camera.focusDistance", "Camera.focalLength", "RenderSettingsBase.disableDepthOfField")
def test_thin_lens() -> None:
    """Radius: half the focal length, in tenths of units, over fStop."""
    camera = only(LENS)
    assert (camera.lens_radius, camera.focus_distance, camera.blades) == (2.0, 9.0, 0)
    for pinhole in (
        "float fStop = 2",
        "float focusDistance = 2",
        LENS.replace("= 9", "= 0"),
        LENS.replace("fStop = 2", "fStop = 0"),
    ):
        assert only(pinhole).lens_radius == 0
    assert only(LENS, "uniform bool disableDepthOfField = 1").lens_radius == 0
    assert only(LENS, "uniform bool disableDepthOfField = 0").lens_radius == 2


@pytest.mark.parametrize(
    ("body", "attribute"),
    [
        (LENS.replace("fStop = 2", "fStop = -2"), "fStop"),
        (LENS.replace("= 9", "= -9"), "focusDistance"),
        (LENS.replace("fStop = 2", "fStop = 1e-30"), "fStop"),
    ],
)
def test_lenses_that_cannot_be(body: str, attribute: str) -> None:
    camera, codes = camera_of(body)
    assert (camera.lens_radius, codes) == (0, [("out-of-range", attribute)])


@pytest.mark.conforms("Camera.projection", "Camera.fStop")
def test_an_orthographic_camera_has_no_lens() -> None:
    body = 'token projection = "orthographic"\n' + LENS
    camera, codes = camera_of(body)
    assert (camera.lens_radius, codes) == (0, [("camera-input", "fStop")])
    assert only(body, "uniform bool disableDepthOfField = 1").lens_radius == 0


ARNOLD = "int primvars:arnold:aperture_blades = 5\nfloat primvars:arnold:aperture_rotation = 30\n"
RENDERMAN = "int ri:apertureNSides = 5\nfloat ri:apertureAngle = 30\n"


@pytest.mark.parametrize(
    "body",
    [
        ARNOLD,
        ARNOLD.replace("primvars:", ""),
        ARNOLD + "float primvars:arnold:aperture_blade_curvature = 0\nfloat primvars:arnold:aperture_aspect_ratio = 1",
        RENDERMAN,
        RENDERMAN.replace("apertureNSides", "camera:aperturensides").replace("apertureAngle", "camera:apertureangle"),
        RENDERMAN + "float ri:apertureRoundness = 0\nfloat ri:apertureDensity = 0",
    ],
)
def test_blades_by_known_conventions(body: str) -> None:
    camera = only(LENS + body)
    assert (camera.blades, camera.blade_rotation_deg) == (5, 30)
    assert only(body).blades == 0  # a pinhole has none


@pytest.mark.parametrize(
    "body",
    [
        ARNOLD.replace("= 5", "= 0"),
        ARNOLD + "float primvars:arnold:aperture_blade_curvature = 1",
        RENDERMAN + "float ri:apertureRoundness = 1",
        "float primvars:arnold:aperture_rotation = 30",
        RENDERMAN.replace("= 5", "= 100000"),
        "float primvars:arnold:aperture_blade_curvature = 0.5",
    ],
)
def test_circles(body: str) -> None:
    assert only(LENS + body).blades == 0


@pytest.mark.parametrize(
    ("body", "attribute", "blades"),
    [
        (ARNOLD.replace("= 5", "= 2"), "primvars:arnold:aperture_blades", 0),
        (ARNOLD.replace("= 5", "= -1"), "primvars:arnold:aperture_blades", 0),
        (ARNOLD.replace("int ", "string ").replace("= 5", '= "five"'), "primvars:arnold:aperture_blades", 0),
        (ARNOLD + "float primvars:arnold:aperture_blade_curvature = 0.5", "primvars:arnold:aperture_blade_curvature", 5),
        (ARNOLD + "float primvars:arnold:aperture_aspect_ratio = 2", "primvars:arnold:aperture_aspect_ratio", 5),
        (ARNOLD + "float primvars:arnold:aperture_size = 0.3", "primvars:arnold:aperture_size", 5),
        (RENDERMAN + "float ri:apertureDensity = 0.5", "ri:apertureDensity", 5),
        (RENDERMAN + "float ri:projection:dofMult = 2", "ri:projection:dofMult", 5),
        ("float cycles:camera:blades = 6", "cycles:camera:blades", 0),
        ("float lensDistortion:k1 = 0.1", "lensDistortion:k1", 0),
    ],
)
def test_what_else_is_authored_of_a_lens_is_told(body: str, attribute: str, blades: int) -> None:
    camera, codes = camera_of(LENS + body)
    assert (camera.blades, codes) == (blades, [("camera-input", attribute)])


# Exposure: the renderer multiplies the image by ComputeLinearExposureScale.

EXPOSURES = [
    "",
    "float exposure = 3",
    "float exposure = -2.5",
    "float exposure:iso = 800",
    "float exposure:time = 0.008",
    "float exposure:fStop = 5.6",
    "float exposure:responsivity = 0.18",
    "float exposure = 1.5\nfloat exposure:iso = 50\nfloat exposure:time = 0.25\n"
    "float exposure:fStop = 4\nfloat exposure:responsivity = 2",
]
EXPOSURE_ROWS = ["exposure", "exposure:iso", "exposure:time", "exposure:fStop", "exposure:responsivity"]


@pytest.mark.conforms(*(f"Camera.{row}" for row in EXPOSURE_ROWS))
@pytest.mark.parametrize("body", EXPOSURES)
def test_exposure(body: str) -> None:
    stage = stage_of(f'def Camera "eye"\n{{\n{body}\n}}\n')
    prim = stage.GetPrimAtPath("/eye")
    expected = UsdGeom.Camera(prim).ComputeLinearExposureScale()
    assert only(body).exposure_scale == pytest.approx(expected, rel=1e-6)

    def get(name: str) -> float:
        return float(prim.GetAttribute(name).Get())

    by_text = get("exposure:responsivity") * get("exposure:time") * get("exposure:iso") / 100
    by_text *= 2 ** get("exposure") / get("exposure:fStop") ** 2
    assert only(body).exposure_scale == pytest.approx(by_text, rel=1e-12)


def test_the_lens_fstop_is_not_the_exposures() -> None:
    assert only(LENS).exposure_scale == 1
    assert only("float exposure:fStop = 4").lens_radius == 0


# Clipping.


@pytest.mark.conforms("Camera.clippingPlanes", "Camera.clippingRange")
def test_clipping() -> None:
    camera = only("float4[] clippingPlanes = [(1, 2, 3, 4), (0, 0, 0, -1)]\nfloat2 clippingRange = (0.5, 20)")
    assert camera.clipping_planes == ((1, 2, 3, 4), (0, 0, 0, -1))
    assert camera.clipping_range == (0.5, 20)
    assert only("").clipping_planes == ()
    assert only("").clipping_range == (1, 1e6)
    camera, codes = camera_of("float4[] clippingPlanes = [(1, 2, nan, 4), (0, 0, 1, -1)]")
    assert (camera.clipping_planes, codes) == (((0, 0, 1, -1),), [("camera-input", "clippingPlanes")])
    camera, codes = camera_of("string clippingPlanes = 'x'")
    assert (camera.clipping_planes, codes) == ((), [("camera-input", "clippingPlanes")])


@pytest.mark.parametrize("role", ["left", "right"])
def test_stereo(role: str) -> None:
    assert camera_of(f'uniform token stereoRole = "{role}"')[1] == [("camera-input", "stereoRole")]
    assert only('uniform token stereoRole = "mono"')


# The shutter, and what moves while it is open.


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close")
def test_shutter() -> None:
    assert only("").shutter == (0, 0)
    assert only(SHUTTER).shutter == (-0.25, 0.25)
    assert only("double shutter:open = 3\ndouble shutter:close = 3").shutter == (3, 3)
    camera, codes = camera_of("double shutter:open = 0.1")
    assert (camera.shutter, camera.exposure_scale, codes) == ((0, 0), 0, [("camera-input", "shutter:close")])


@pytest.mark.conforms("RenderSettingsBase.disableMotionBlur", "RenderSettingsBase.instantaneousShutter")
@pytest.mark.parametrize(("name", "instant"), [("disableMotionBlur", 0.0), ("instantaneousShutter", -0.25)])
def test_no_motion_blur(name: str, instant: float) -> None:
    """At the frame, or when the shutter opens."""
    assert only(SHUTTER, f"uniform bool {name} = 1").shutter == (instant, instant)
    assert only("double shutter:open = 0.1", f"uniform bool {name} = 1").exposure_scale == 1
    still = f'def RenderSettings "settings"\n{{\nrel camera = </rig/eye>\nuniform bool {name} = 1\n}}\n'
    moving = MOVING["a transform"]
    assert exposed(moving).exposure is not None
    found = translate(stage_with(moving + still), RenderSettings(time_code=5.0))[0]
    assert found.exposure is None
    assert found.static[0].matrix[0, 3] == 0.5 + instant / 10


SAMPLES = ".timeSamples = { 0: FROM, 10: TO }"


@pytest.mark.conforms("Camera.horizontalAperture", "Camera.verticalAperture")
@pytest.mark.parametrize("name", ["horizontalAperture", "verticalAperture", "focalLength"])
@pytest.mark.parametrize("size", ["0", "-3"])
def test_sizes_that_cannot_be(name: str, size: str) -> None:
    camera, codes = camera_of(f"float {name} = {size}")
    assert camera.window == pytest.approx(only("").window)
    assert set(codes) == {("out-of-range", name)}
    assert all(map(math.isfinite, camera.window))
