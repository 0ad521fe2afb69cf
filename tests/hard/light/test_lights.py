"""Lights of any size at any distance, against closed forms and quadrature in double precision."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from tests.described import light as described_light
from tests.described import rotation, translation
from tests.statistics.lights.placed_lights import irradiances

from primray.description import LightType

from .lit_stages import Shown, camera_at, dome, ground, irradiance, light, placed, prim, show

Measured = Callable[[str], None]

HALF = 0.05  # of the ground that irradiance() sees
KINDS = {
    "sphere": ("SphereLight", LightType.SPHERE, ("radius",), 0.0),
    "disk": ("DiskLight", LightType.DISK, ("radius",), -90.0),
    "rect": ("RectLight", LightType.RECT, ("width", "height"), -90.0),
    "cylinder": ("CylinderLight", LightType.CYLINDER, ("length", "radius"), 0.0),
}


def sized(kind: str, size: float, height: float, *more: str) -> str:
    name, _, sizes, turn = KINDS[kind]
    return light(name, *(f"float inputs:{s} = {size!r}" for s in sizes), *more, at=placed(y=height, rotate_x=turn))


def over_the_view(e: Callable[[np.ndarray], np.ndarray]) -> float:
    """Mean over the view, by Gauss's rule, of what points (N, 3) of the ground receive."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    x, z = np.meshgrid(nodes * HALF, nodes * HALF, indexing="ij")
    p = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    return float(np.outer(weights, weights).ravel() / 4 @ e(p))


def quadrature(kind: str, size: float, height: float, steps: int = 160) -> float:
    _, type_, sizes, turn = KINDS[kind]
    x = described_light(type_, translation(0, height, 0) @ rotation([1, 0, 0], turn), **dict.fromkeys(sizes, size))
    return over_the_view(lambda p: irradiances(x, p, [0, 1, 0], steps))


def near(found: float, wanted: float, within: float = 1e-3) -> None:
    assert found == pytest.approx(wanted, rel=within)


# Radiant intensity over irradiance's own falloff: what normalize leaves of a light without size, straight below it. Of a line
# or a cylinder that is seen from its side pi L r l / (2 pi r l) = L / pi... times its silhouette's 2 r l.
POINT_LIMIT = {"sphere": 1 / 4, "disk": 1.0, "rect": 1.0, "cylinder": 1 / math.pi}


@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-9], ids=["0", "1e-30", "1e-9"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.hard_case(
    "Lights", "size and normalize: %s", expected="the point's limit", plain_float="1 / r^2 is inf below 1e-19, the picture NaN"
)
def test_no_size_with_normalize(kind: str, size: float, measured: Measured) -> None:
    found = irradiance(sized(kind, size, 2.0, "bool inputs:normalize = 1"), spp=256)

    # I cos / d^2, and once more the cosine of flat lights; a cylinder's silhouette turns with the angle to its axis.
    def point(p: np.ndarray) -> np.ndarray:
        to = np.array([0, 2.0, 0]) - p
        d = np.linalg.norm(to, axis=1)
        lobe = {"sphere": 1.0, "cylinder": np.hypot(to[:, 1], to[:, 2]) / d}.get(kind, to[:, 1] / d)
        return POINT_LIMIT[kind] * lobe * to[:, 1] / d**3

    wanted = over_the_view(point)
    near(found.mean, wanted)
    assert not found.noted
    assert found.invalid_samples == 0
    measured(f"{found.mean / wanted:.4f} of it")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.hard_case("Lights", "size 0 without normalize: %s", expected="black, and a diagnostic")
def test_no_size_emits_nothing(kind: str, measured: Measured) -> None:
    found = irradiance(sized(kind, 0.0, 2.0), spp=4)
    assert not found.pixels.any()
    assert set(found.noted) == {"light-dark"}
    measured("black, light-dark")


@pytest.mark.parametrize("size", [1e-9, 1e-3], ids=["1e-9", "1e-3"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.hard_case("Lights", "size %s", expected="the quadrature's irradiance")
def test_small(kind: str, size: float, measured: Measured) -> None:
    found, wanted = irradiance(sized(kind, size, 2.0), spp=256), quadrature(kind, size, 2.0)
    near(found.mean, wanted)
    measured(f"{found.mean / wanted:.4f} of it")


@pytest.mark.parametrize("gap", [2.0, 0.02], ids=["2", "0.02"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.hard_case(
    "Lights", "size 1e6, the ground that far below: %s", expected="pi, by closed form",
    plain_float="d^2 - r^2 has no digits: a gap of 0.02 is none, and a cylinder 2 away is 3 % too bright",
)  # fmt: skip
def test_huge(kind: str, gap: float, measured: Measured) -> None:
    size = 1e6
    height = gap if kind in ("rect", "disk") else size + gap
    found = irradiance(sized(kind, size, height), spp=1024)
    near(found.mean, math.pi * (size / height) ** 2 if kind == "sphere" else math.pi, 2e-3)
    measured(f"{found.mean / math.pi:.3f} pi")


def test_beyond_all_measure() -> None:
    """Radii whose squares are no floats: as good as a wall at the same distance."""
    found = irradiance(sized("sphere", 1e15, 1e15 + 2.0), spp=64)
    near(found.mean, math.pi, 5e-3)


@pytest.mark.hard_case("Lights", "the camera in a sphere light", expected="its inside emits nothing: as without it")
def test_camera_in_a_sphere(measured: Measured) -> None:
    """Lights emit outwards and shadow nothing: from inside, a sphere light is not there."""
    others = (dome("float inputs:intensity = 0.3"), camera_at(0.0, 1.0))
    inside = show(*others, light("SphereLight", "float inputs:radius = 2"), spp=4)
    np.testing.assert_array_equal(inside.pixels, show(*others, spp=4).pixels)
    measured("the same picture")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.hard_case("Lights", "the camera on a light: %s", expected="finite: the light, or what is behind it")
def test_camera_on_a_light(kind: str, measured: Measured) -> None:
    """On a sphere's or cylinder's side, in the plane of a flat one; the view goes through the light."""
    name, _, sizes, _ = KINDS[kind]
    at = placed(z=-1.0 if kind in ("sphere", "cylinder") else 0.0)
    lamp = light(name, *(f"float inputs:{s} = 1" for s in sizes), "float inputs:intensity = 2", at=at)
    found = show(dome("float inputs:intensity = 0.5"), camera_at(0.0, 1.0), lamp, spp=4)
    assert set(np.unique(found.pixels.round(5))) <= {0.5, 2.0}
    assert found.invalid_samples == 0
    measured("0.5 behind it" if found.gray.max() < 1 else "the light's 2 and 0.5 behind it")


@pytest.mark.hard_case("Lights", "a surface through a sphere light", expected="black inside, outside the quadrature")
def test_surface_through_a_sphere(measured: Measured) -> None:
    """Half of a sphere stands over the ground, which is lit outside it alone; the half below lights nothing above."""
    lamp = sized("sphere", 0.5, 0.0)
    # Seen from below the light's top, beside it: a strip of the ground from 0.6 to 0.7 along x.
    camera = prim(
        "Camera", "camera", "float2 clippingRange = (0.0001, 1000000)", 'token projection = "orthographic"',
        "float horizontalAperture = 1", "float verticalAperture = 1", placed(0.65, 0.01, 0, -90),
    )  # fmt: skip
    found = show(camera, ground(), lamp, spp=1024, max_depth=1)

    def half_sphere(p: np.ndarray) -> np.ndarray:
        # Radiance 1 from the part of the sphere's disc above the horizon: by symmetry half of the disc at angle 90 degrees.
        r = np.hypot(p[:, 0] + 0.65, p[:, 2])
        s = 0.5 / r
        # Half a cone of sine s about a horizontal axis: integral of the cosine, by quadrature in the cone's own angles.
        t, weights = np.polynomial.legendre.leggauss(64)
        theta, phi = np.arcsin(s)[:, None] * (t + 1) / 2, np.pi * (t + 1) / 2
        radial = np.sin(theta) ** 2 @ weights * np.arcsin(s) / 2
        return np.asarray(radial * (np.sin(phi) @ weights * np.pi / 2))

    near(found.mean * math.pi, over_the_view(half_sphere), 2e-3)
    inside = irradiance(sized("sphere", 0.5, 0.3), spp=4)
    assert not inside.pixels.any()
    measured(f"{found.mean * math.pi / over_the_view(half_sphere):.3f} of it, 0 inside")


@pytest.mark.parametrize("kind", ["rect", "disk"])
@pytest.mark.hard_case("Lights", "a surface in the plane of a light: %s", expected="no light from it; pi just below; no noise")
def test_surface_in_the_plane(kind: str, measured: Measured) -> None:
    """Light samples and scattered rays agree on the side of the light on which a surface is."""
    assert not irradiance(sized(kind, 2.0, 0.0)).pixels.any()
    for gap in (1e-9, 1e-7, 1e-6, 1e-5):
        found = irradiance(sized(kind, 2.0, gap)).pixels
        assert not found.any() or np.abs(found - math.pi).max() < 0.1
    assert irradiance(sized(kind, 2.0, 1e-6)).pixels.all()
    measured("0 in it, pi from a gap of 1e-6 on")


@pytest.mark.parametrize("kind", ["rect", "disk"])
@pytest.mark.hard_case("Lights", "a surface just below a light: %s", expected="pi")
def test_surface_just_below(kind: str, measured: Measured) -> None:
    found = [irradiance(sized(kind, 4.0, gap), spp=1024).mean for gap in (1e-4, 1e-3, 5e-3)]
    np.testing.assert_allclose(found, math.pi, rtol=2e-3)
    measured(f"{found[0] / math.pi:.3f} pi at 1e-4")


TOUCHING = {
    "sphere": (sized("sphere", 0.5, 0.5), 3),
    "cylinder": (light("CylinderLight", "float inputs:length = 1000", "float inputs:radius = 0.5", at=placed(y=0.5)), 2),
}


@pytest.mark.parametrize("kind", TOUCHING)
@pytest.mark.hard_case(
    "Lights", "a light that touches the surface: %s", expected="pi (r / d)^n; dark at most where the gap is 2e-6 of the ground"
)
def test_touching(kind: str, measured: Measured) -> None:
    """n = 3 for a sphere, 2 for a long cylinder. What is within rounding of the light is taken to lie inside."""
    lamp, power = TOUCHING[kind]
    found = irradiance(lamp, spp=1024)
    centers = ((np.arange(8) + 0.5) / 8 * 2 - 1) * HALF
    z, x = np.meshgrid(centers, centers if kind == "sphere" else np.zeros(8), indexing="ij")
    wanted = math.pi * (1 + (x**2 + z**2) / 0.25) ** (-power / 2)
    away = np.hypot(x, z) > HALF / 4
    np.testing.assert_allclose(found.gray[away], wanted[away], rtol=5e-3)
    # At 2e-6 of the ground's 10 units the gap's width on either side is sqrt(2 r gap) = 0.0045 of 0.05.
    assert found.mean > wanted.mean() * (1 - 0.09)
    measured(f"{found.gray[away].mean() / wanted[away].mean():.4f} of it, {found.mean / wanted.mean():.2f} with the contact")


ANGLES = [0.0, 1e-6, 1e-3, 0.53, 179.0, 180.0, 181.0, 359.0, 360.0]


@pytest.mark.parametrize("normalize", [False, True], ids=["", "normalize"])
@pytest.mark.parametrize("angle", ANGLES, ids=[f"{a:g}" for a in ANGLES])
@pytest.mark.hard_case(
    "Lights", "distant, angle and normalize: %s", expected="UsdLux's size factor",
    plain_float="1 - cos is 0 below 0.03 degrees: no light, or inf",
)  # fmt: skip
def test_distant(angle: float, normalize: bool, measured: Measured) -> None:
    lamp = light(
        "DistantLight", f"float inputs:angle = {angle!r}", "float inputs:intensity = 1",
        f"bool inputs:normalize = {int(normalize)}", at=placed(rotate_x=-90),
    )  # fmt: skip
    found = irradiance(lamp, spp=1024)
    theta = math.radians(angle) / 2
    received = 1.0 if angle == 0 else math.pi * math.sin(min(theta, math.pi / 2)) ** 2
    size = 1.0
    if normalize and angle > 0:
        size = math.pi * math.sin(theta) ** 2 if angle <= 180 else math.pi * (2 - math.sin(theta) ** 2)
    near(found.mean, received / size, 5e-4)
    measured(f"{found.mean * size / received:.4f} of it")


@pytest.mark.parametrize("angle", [-5.0, 720.0])
@pytest.mark.hard_case("Lights", "distant, angle %s", expected="the nearest angle there is, and a diagnostic")
def test_distant_out_of_range(angle: float, measured: Measured) -> None:
    def of(a: float) -> Shown:
        inputs = (f"float inputs:angle = {a!r}", "float inputs:intensity = 1")
        return irradiance(light("DistantLight", *inputs, at=placed(rotate_x=-90)))

    found = of(angle)
    np.testing.assert_array_equal(found.pixels, of(min(max(angle, 0.0), 360.0)).pixels)
    assert set(found.noted) == {"out-of-range"}
    measured("as that, out-of-range")


# What is left of the light straight ahead of a small sphere: the formula's own values.
SHAPED: dict[str, tuple[float, set[str]]] = {
    "cone:angle = 0": (0.0, {"light-dark"}),
    "cone:angle = 90": (1.0, set()),
    "cone:angle = nan": (1.0, {"wrong-type"}),
    "cone:angle = 180": (1.0, set()),
    "focus = -1": (1.0, {"light-input"}),
    "cone:softness = 2": (1.0, {"out-of-range"}),
}


@pytest.mark.parametrize("shape", SHAPED)
@pytest.mark.hard_case("Lights", "shaping:%s", expected="the formula's value, and a diagnostic where a value is changed")
def test_shaping(shape: str, measured: Measured) -> None:
    share, codes = SHAPED[shape]
    at, tiny = placed(y=2000.0, rotate_x=-90), ("float inputs:radius = 0.001", "float inputs:intensity = 1e12")
    plain = irradiance(light("SphereLight", *tiny, at=at))
    shaped = irradiance(light("SphereLight", f"float inputs:shaping:{shape}", *tiny, at=at, apis=["ShapingAPI"]))
    np.testing.assert_allclose(shaped.pixels, share * plain.pixels, rtol=1e-4)
    assert set(shaped.noted) == codes
    measured(f"{share:g} of the light ahead" + "".join(f", `{code}`" for code in sorted(codes)))


@pytest.mark.hard_case("Lights", "shaping:focus = 10000", expected="cos^10000 of the angle off the axis")
def test_sharp_focus(measured: Measured) -> None:
    angle = math.radians(0.5)
    at, tiny = placed(y=2000.0, rotate_x=-90.5), ("float inputs:radius = 0.001", "float inputs:intensity = 1e12")
    plain = irradiance(light("SphereLight", *tiny, at=at))
    focused = irradiance(light("SphereLight", "float inputs:shaping:focus = 10000", *tiny, at=at, apis=["ShapingAPI"]))
    near(focused.mean, plain.mean * math.cos(angle) ** 10000, 2e-3)
    measured(f"{focused.mean / plain.mean:.3f} at half a degree")


BAD: dict[str, tuple[str, set[str]]] = {
    "intensity nan": ("float inputs:intensity = nan", {"wrong-type"}),
    "intensity inf": ("float inputs:intensity = inf", {"wrong-type"}),
    "intensity -1": ("float inputs:intensity = -1", {"out-of-range"}),
    "intensity 1e38": ("float inputs:intensity = 1e38", {"out-of-range"}),
    "exposure 1e3": ("float inputs:exposure = 1000", {"out-of-range"}),
    "exposure -1e3": ("float inputs:exposure = -1000", set()),
    "exposure nan": ("float inputs:exposure = nan", {"wrong-type"}),
    "color nan": ("color3f inputs:color = (nan, 1, 1)", {"wrong-type"}),
    "color -1": ("color3f inputs:color = (-1, 1, 1)", {"out-of-range"}),
    "diffuse -1": ("float inputs:diffuse = -1", {"out-of-range"}),
    "radius nan": ("float inputs:radius = nan", {"wrong-type"}),
    "radius -0.5": ("float inputs:radius = -0.5", {"out-of-range"}),
    "scale 0": ("", {"light-dark"}),
    "flat": ("", {"light-dark"}),
}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.hard_case("Lights", "%s", expected="finite, never negative, and a diagnostic where a value is changed")
def test_values_out_of_range(bad: str, measured: Measured) -> None:
    text, codes = BAD[bad]
    at = placed(y=2.0)
    if bad in ("scale 0", "flat"):
        factors = (0, 0, 0) if bad == "scale 0" else (0, 1, 1)
        at = f"float3 xformOp:scale = {factors}\n" + at.replace('["xformOp:translate"', '["xformOp:translate", "xformOp:scale"')
    found = irradiance(light("SphereLight", text, at=at), spp=16)
    assert set(found.noted) == codes
    assert found.pixels.min() >= 0
    assert found.invalid_samples == 0
    if codes == {"wrong-type"} or bad == "radius -0.5":  # the default, or the same size
        near(found.mean, irradiance(light("SphereLight", at=placed(y=2.0)), spp=16).mean, 1e-6)
    measured(", ".join(sorted(codes)) or "black")


@pytest.mark.hard_case("Lights", "scale 1e-6 along one axis", expected="a flat disc's light, by quadrature")
def test_nearly_flat(measured: Measured) -> None:
    ops = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
    at = f"double3 xformOp:translate = (0, 2, 0)\ndouble3 xformOp:scale = (1, 1e-6, 1)\n{ops}"
    found = irradiance(light("SphereLight", at=at), spp=256)
    disc = described_light(LightType.DISK, translation(0, 2, 0) @ rotation([1, 0, 0], -90), radius=0.5)
    wanted = over_the_view(lambda p: irradiances(disc, p, [0, 1, 0], 160))
    near(found.mean, wanted, 2e-3)
    assert not found.noted
    measured(f"{found.mean / wanted:.3f} of it")
