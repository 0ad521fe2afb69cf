"""Distortion as cameras have it: lens schemas of Omniverse, registered with USD or not, and projections of older stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.unit.usd.camera.lens_text import camera_of, translated

from primray.lens.distortion import DistortionModel

P = "omni:lensdistortion:"


def attributes(model: str, values: Mapping[str, object], named: bool = True) -> str:
    def line(name: str, value: object) -> str:
        kind = {int: "float", float: "float", str: "asset"}.get(type(value), "float2")
        if name == "imageSize":
            kind = "int2"
        return f"{kind} {P}{model}:{name} = {value}"

    token = f'token {P}model = "{model}"\n' if named else ""
    return token + "\n".join(line(name, value) for name, value in values.items())


PINHOLE = {"imageSize": (320, 200), "fx": 180, "fy": 170, "cx": 150, "cy": 110, "k1": -0.25, "p1": 0.5, "s4": 0.125, "k6": 2}


FISHEYE = {"imageSize": (320, 200), "fx": 180, "fy": 170, "cx": 150, "cy": 110, "k1": 0.5, "k4": 0.25}


NOMINAL = {"nominalWidth": 400, "nominalHeight": 200, "opticalCenter": (150, 110), "maxFov": 190}


F_THETA = NOMINAL | {"k0": 0, "k1": 0.0078125, "k2": 0.000030517578125}


KB3 = NOMINAL | {"k0": 128, "k1": -12.8}


RAD_TAN = NOMINAL | {"k0": -0.25, "k2": 0.5, "k3": 1, "p0": 0.125, "s3": 2}


def test_opencv_pinhole() -> None:
    camera, said = camera_of(attributes("opencvPinhole", PINHOLE), resolution=(320, 200))
    lens = camera.distortion
    assert said == []
    assert lens is not None
    assert (lens.model, lens.most_angle_deg) == (DistortionModel.RATIONAL, 90.0)
    assert lens.coefficients == (-0.25, 0, 0.5, 0, 0, 0, 0, 2, 0, 0, 0, 0.125)
    assert camera.window == pytest.approx((-150 / 180, 170 / 180, -90 / 170, 110 / 170))


def test_opencv_fisheye() -> None:
    camera, said = camera_of(attributes("opencvFisheye", FISHEYE), resolution=(320, 200))
    lens = camera.distortion
    assert said == []
    assert lens is not None
    assert (lens.model, lens.coefficients) == (DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.5, 0.0, 0.0, 0.25))


def test_f_theta() -> None:
    """By the distance in pixels, which the focal length of 128 scales."""
    camera, said = camera_of(attributes("ftheta", F_THETA), resolution=(400, 200))
    lens = camera.distortion
    assert said == []
    assert lens is not None
    assert lens.coefficients == pytest.approx((0, 1, 0.5, 0, 0))
    assert (lens.model, lens.most_angle_deg) == (DistortionModel.RADIUS_TO_ANGLE, 95.0)
    assert camera.window == pytest.approx((-150 / 128, 250 / 128, -90 / 128, 110 / 128))


def test_kannala_brandt() -> None:
    camera, said = camera_of(attributes("kannalaBrandtK3", KB3), resolution=(400, 200))
    assert said == []
    assert camera.distortion is not None
    assert camera.distortion.coefficients == pytest.approx((1, -0.1, 0, 0, 0))


def test_rational_tangential_thin_prism() -> None:
    body = attributes("radTanThinPrism", RAD_TAN) + "\nfloat focalLength = 30\nfloat horizontalAperture = 40"
    camera, said = camera_of(body, resolution=(400, 200))
    assert said == []
    assert camera.distortion is not None
    assert camera.distortion.coefficients == (-0.25, 0, 0.125, 0, 0.5, 1, 0, 0, 0, 0, 0, 2)
    assert camera.window[1] == pytest.approx(250 / 300)


def equidistant_image(path: Path, width: int = 64, height: int = 32, pixels_a_radian: float = 20.0) -> None:
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5)
    angle = np.hypot(x, y) / pixels_a_radian
    across = np.sin(angle) / np.hypot(x, y)
    directions = np.stack([x * across, y * across, -np.cos(angle)], axis=-1).astype(np.float32)
    directions[angle > 1.5] = (0, 0, 1)
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, oiio.FLOAT))
    image.set_pixels(oiio.ROI(), directions)
    assert image.write(str(path))


def test_a_look_up_table(tmp_path: Path) -> None:
    equidistant_image(tmp_path / "enter.exr")
    values = {
        "nominalWidth": 64,
        "nominalHeight": 32,
        "opticalCenter": (32, 16),
        "rayEnterDirectionTexture": f"@{tmp_path}/enter.exr@",
    }
    camera, said = camera_of(attributes("lut", values), resolution=(64, 32))
    assert said == []
    assert camera.distortion is not None
    angle = 1.2
    point = np.array([[np.sin(angle) * 0.8, np.sin(angle) * 0.6, -np.cos(angle)]])
    # Linear between texels a twentieth of a radian apart.
    assert camera.project(point, (64, 32))[0] == pytest.approx((32 + 24 * 0.8, 16 - 24 * 0.6), abs=0.02)
    assert np.isnan(camera.project([[np.sin(1.57), 0, -np.cos(1.57)]], (64, 32))).all()


@pytest.mark.parametrize(("path", "word"), [("@missing.exr@", "cannot be found"), ("@@", "no image")], ids=["missing", "empty"])
def test_a_table_that_is_not_there(path: str, word: str) -> None:
    values = {"nominalWidth": 64, "nominalHeight": 32, "rayEnterDirectionTexture": path}
    camera, said = camera_of(attributes("lut", values))
    assert camera.distortion is None
    assert ("camera-input", f"{P}lut:rayEnterDirectionTexture") in said


MODELS = {
    "opencvPinhole": ("OmniLensDistortionOpenCvPinholeAPI", PINHOLE),
    "opencvFisheye": ("OmniLensDistortionOpenCvFisheyeAPI", FISHEYE),
    "ftheta": ("OmniLensDistortionFthetaAPI", F_THETA),
    "kannalaBrandtK3": ("OmniLensDistortionKannalaBrandtK3API", KB3),
    "radTanThinPrism": ("OmniLensDistortionRadTanThinPrismAPI", RAD_TAN),
}


@pytest.mark.parametrize("model", MODELS)
def test_an_applied_schema_names_the_model(model: str) -> None:
    """Without the token; and neither schema nor attributes are told of as unknown."""
    schema, values = MODELS[model]
    camera, said = camera_of(attributes(model, values, named=False), schema)
    assert said == []
    assert camera.distortion is not None
    assert camera == camera_of(attributes(model, values))[0]


def test_without_attributes_the_schema_says() -> None:
    """ovrtx's defaults: 0.00245 radians a pixel, 200 degrees, on a sensor of 1936 x 1216."""
    camera, said = camera_of("", "OmniLensDistortionFthetaAPI", resolution=(1936, 1216))
    assert said == []
    assert camera.distortion is not None
    assert camera.distortion.most_angle_deg == 100.0
    assert camera.window == pytest.approx(
        (-970.9424 * 0.00245, (1936 - 970.9424) * 0.00245, (600.3748 - 1216) * 0.00245, 600.3748 * 0.00245), rel=1e-6
    )


@pytest.mark.parametrize(
    ("body", "attribute"),
    [
        (f'token {P}model = "bent"', f"{P}model"),
        (attributes("opencvPinhole", PINHOLE | {"fx": 0}), f"{P}opencvPinhole:fx"),
        (attributes("opencvPinhole", PINHOLE | {"imageSize": (0, 3)}), f"{P}opencvPinhole:imageSize"),
        (attributes("ftheta", F_THETA | {"k1": -1}), f"{P}ftheta:k1"),
        (attributes("ftheta", F_THETA | {"nominalWidth": 0}), f"{P}ftheta:nominalWidth"),
        (attributes("kannalaBrandtK3", NOMINAL), f"{P}kannalaBrandtK3:k0"),
    ],
)
def test_what_cannot_be_is_told_and_distorts_nothing(body: str, attribute: str) -> None:
    camera, said = camera_of(body)
    assert camera.distortion is None
    assert said == [("camera-input", attribute)]
    assert camera.window == camera_of("")[0].window


def test_an_orthographic_camera_does_not_distort() -> None:
    camera, said = camera_of('token projection = "orthographic"\n' + attributes("opencvPinhole", PINHOLE))
    assert camera.distortion is None
    assert said == [("camera-input", f"{P}model")]


def test_the_picture_has_the_sensors_aspect_or_conforms_to_its_own() -> None:
    """A picture twice as wide shows as much above and below as before, as apertures expand."""
    body = attributes("opencvFisheye", FISHEYE | {"cx": 160, "cy": 100})
    description, _ = translated(f'def Camera "eye" {{\n{body}\n}}\n', resolution=(640, 0))
    assert description.resolution == (640, 400)
    wide, _ = camera_of(body, resolution=(640, 200))
    assert wide.window == pytest.approx((-320 / 180, 320 / 180, -100 / 170, 100 / 170))


def test_depth_of_field_goes_by_the_focal_length() -> None:
    body = "float fStop = 2\nfloat focusDistance = 9\nfloat focalLength = 80\n" + attributes("opencvFisheye", FISHEYE)
    camera, said = camera_of(body)
    assert (camera.lens_radius, camera.focus_distance, said) == (2.0, 9.0, [])


OLDER = {
    "fthetaWidth": 400,
    "fthetaHeight": 200,
    "fthetaCx": 150,
    "fthetaCy": 110,
    "fthetaMaxFov": 190,
    "fthetaPolyB": 0.0078125,
}


def older(projection: str, **more: float) -> str:
    values = OLDER | {"fthetaPolyC": 0.000030517578125} | more
    return f'token cameraProjectionType = "{projection}"\n' + "\n".join(f"float {name} = {v}" for name, v in values.items())


def test_a_polynomial_fisheye_of_older_stages_is_f_theta() -> None:
    """Its attributes have no schema; those of the schemas win where a camera has both."""
    wanted, _ = camera_of(attributes("ftheta", F_THETA), resolution=(400, 200))
    found, said = camera_of(older("fisheyePolynomial"), resolution=(400, 200))
    assert said == []
    assert found == wanted
    assert camera_of(older("fisheyePolynomial"))[0].distortion is not None
    both, said = camera_of(older("fisheyePolynomial") + "\n" + attributes("opencvFisheye", FISHEYE))
    assert said == []
    assert both.distortion is not None
    assert both.distortion.model is DistortionModel.ANGLE_TO_RADIUS
    assert camera_of(older("fisheyePolynomial", fthetaPolyF=0.1))[1] == [("camera-input", "fthetaPolyF")]


@pytest.mark.parametrize("projection", ["generalizedProjection", "pinhole"])
def test_other_projections_of_older_stages_are_reported(projection: str) -> None:
    camera, said = camera_of(older(projection))
    assert camera.distortion is None
    assert said == ([] if projection == "pinhole" else [("camera-input", "cameraProjectionType")])


@pytest.mark.parametrize(
    ("projection", "radius"),
    [
        ("fisheyeOrthographic", np.sin),
        ("fisheyeEquidistant", lambda a: a),
        ("fisheyeEquisolid", lambda a: 2 * np.sin(a / 2)),
    ],
)
def test_fisheyes_by_their_closed_forms(projection: str, radius: Callable[[Any], Any]) -> None:
    """The circle of half of fthetaMaxFov touches the nominal picture's left and right, about its optical centre."""
    camera, said = camera_of(older(projection), resolution=(400, 200))
    assert said == []
    most = np.radians(90.0 if projection == "fisheyeOrthographic" else 95.0)
    a = np.linspace(0.01, 0.999, 30) * most
    at = camera.project(np.stack([np.sin(a), np.zeros(30), -np.cos(a)], axis=1) + camera.world_from_camera[:3, 3], (400, 200))
    np.testing.assert_allclose(at[:, 0], 150 + 200 * radius(a) / radius(most), atol=1e-5)
    np.testing.assert_allclose(at[:, 1], 110)


def test_older_lenses_of_opencv() -> None:
    """fthetaPolyA to F are OpenCV's radial coefficients there, openCVFx and openCVFy its focal lengths in pixels."""
    focal = {"openCVFx": 180.0, "openCVFy": 170.0}
    fisheye, said = camera_of(older("fisheyeKannalaBrandtK3", **focal, fthetaPolyA=0.5, fthetaPolyB=0.25, fthetaPolyC=0.0))
    assert said == []
    assert fisheye.distortion is not None
    assert fisheye.distortion.model is DistortionModel.ANGLE_TO_RADIUS
    assert fisheye.distortion.coefficients == (1.0, 0.5, 0.25, 0.0, 0.0)
    k = {f"fthetaPoly{letter}": float(n) for n, letter in enumerate("ABCDEF", 1)}
    pinhole, said = camera_of(
        older("fisheyeRadTanThinPrism", **focal, **k, p0=0.5, p1=0.25, s0=1.0, s3=2.0), resolution=(400, 200)
    )
    assert said == []
    assert pinhole.distortion is not None
    assert pinhole.distortion.coefficients == (1.0, 2.0, 0.5, 0.25, 3.0, 4.0, 5.0, 6.0, 1.0, 0.0, 0.0, 2.0)
    assert pinhole.window == pytest.approx((-150 / 180, 250 / 180, -90 / 170, 110 / 170))


@pytest.mark.parametrize("size", [(400, 200), (300, 300)])
def test_a_spherical_fisheye_is_lat_long_over_the_frame(size: tuple[int, int]) -> None:
    camera, said = camera_of(older("fisheyeSpherical"), resolution=size)
    assert said == []
    at = camera.project(camera.world_from_camera[:3, 3] + [[0, 0, -1.0], [1.0, 0, 0], [0, 1.0, -1e-9]], size)
    np.testing.assert_allclose(at, np.array([[0.5, 0.5], [0.75, 0.5], [0.5, 0.0]]) * size, atol=1e-6)


@pytest.mark.parametrize("is_left", [True, False])
def test_one_eye_of_omnidirectional_stereo(is_left: bool) -> None:
    text = older("omniDirectionalStereo", interpupillaryDistance=0.5) + f"\nbool isLeftEye = {int(is_left)}"
    camera, said = camera_of(text, resolution=(360, 180))
    assert said == []
    at = camera.project(camera.world_from_camera[:3, 3] + [[0.0, 0.0, -2.0]], (360, 180))[0]
    aside = np.degrees(np.arcsin(0.25 / 2.0))
    assert at.tolist() == [pytest.approx(180 + aside if is_left else 180 - aside), pytest.approx(90)]
