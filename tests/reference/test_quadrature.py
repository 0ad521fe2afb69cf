"""The referee against closed forms, and against itself by another road: it must be right before it may judge."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from tests.reference.cases.profiles import uneven_profile
from tests.reference.emitters import emitters
from tests.reference.irradiance import irradiance, irradiance_of, size_factor
from tests.reference.polygons import lambert_polygon
from tests.reference.stages import Plane, light, rotation, scaling, stage, translation

UP = np.array([0.0, 1.0, 0.0])
# Receivers all over, none on an axis.
POINTS = np.array([[0.3, 0.0, 0.2], [-1.1, 0.0, 0.7], [2.0, 0.0, -1.4], [0.01, 0.0, 0.02], [-30.0, 0.0, 11.0]])
DOWNWARD = translation(0, 1, 0) @ rotation([1, 0, 0], -90)


def received(prims: str, p: np.ndarray = POINTS, n: np.ndarray = UP) -> np.ndarray:
    return irradiance(emitters(stage(prims, Plane())), p, n).value[:, 0]


def clipped(p: np.ndarray, n: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """A polygon cut off at the horizon (Sutherland and Hodgman 1974)."""
    out = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        da, db = (a - p) @ n, (b - p) @ n
        if da >= 0:
            out.append(a)
        if da * db < 0:
            out.append(a + (b - a) * da / (da - db))
    return np.array(out)


@pytest.mark.parametrize(
    "m",
    [
        DOWNWARD,
        DOWNWARD @ rotation([1, 2, 3], 20) @ scaling(3, 0.2, 1),
        translation(0, 0.1, -2) @ rotation([0, 1, 0], 180),  # through the horizon
        DOWNWARD @ scaling(1e6, 1e6, 1),
        translation(0, 1e-3, 0) @ rotation([1, 0, 0], -90),
    ],
    ids=["plain", "stretched", "through the horizon", "1e6", "1e-3 above"],
)
def test_rect_is_lamberts_contour_integral(m: np.ndarray) -> None:
    found = received(light("RectLight", m, "float inputs:width = 1.2", "float inputs:height = 0.7"))
    c = np.array([[0.6, 0.35], [-0.6, 0.35], [-0.6, -0.35], [0.6, -0.35]])
    corners = c @ m[:3, :2].T + m[:3, 3]
    front = [(p - m[:3, 3]) @ np.linalg.inv(m)[2, :3] < 0 for p in POINTS]
    polygons = [clipped(p, UP, corners) for p in POINTS]
    exact = [lambert_polygon(p, UP, q) if f and len(q) else 0.0 for p, f, q in zip(POINTS, front, polygons, strict=True)]
    np.testing.assert_allclose(found, exact, rtol=2e-6, atol=2e-8 * max(exact))


def test_tiny_rect_is_a_point() -> None:
    found = received(light("RectLight", DOWNWARD @ scaling(1e-6, 1e-6, 1)))
    np.testing.assert_allclose(found, 1e-12 / (1 + POINTS[:, 0] ** 2 + POINTS[:, 2] ** 2) ** 2, rtol=1e-6)


@pytest.mark.parametrize("radius", [1e-6, 0.5, 0.999, 1e3])
def test_sphere_above_the_horizon_is_its_solid_angle(radius: float) -> None:
    height = max(radius, 1.0) * 1.001 if radius > 0.9 else 1.0
    found = received(light("SphereLight", translation(0, height, 0), f"float inputs:radius = {radius}"))
    d = POINTS - [0, height, 0]
    r = np.linalg.norm(d, axis=1)
    whole = height / r > radius / r  # wholly above
    np.testing.assert_allclose(found[whole], (pi * radius**2 * height / r**3)[whole], rtol=2e-6, atol=1e-12)


def test_sphere_half_below_the_horizon() -> None:
    """A sphere whose centre is on the horizon, at distance d: pi R - R^2 terms by Snyder's sphere to plate formula."""
    radius, away = 0.5, np.array([0.8, 1.0, 3.0, 50.0])
    p = np.stack([away, 0 * away, 0 * away], axis=-1)
    found = received(light("SphereLight", np.eye(4), f"float inputs:radius = {radius}"), p)
    # Howell's catalogue, B-42 (plane element to sphere, edge on): F = (atan(1/sqrt(H^2-1)) - sqrt(H^2-1)/H^2) / pi.
    h = away / radius
    exact = np.arctan(1 / np.sqrt(h * h - 1)) - np.sqrt(h * h - 1) / h**2
    np.testing.assert_allclose(found, exact, rtol=2e-6, atol=1e-12)


def test_ellipsoid_is_its_outline() -> None:
    """Far away, radiance times projected area: of x^T A x = 1 along d, pi sqrt(det A^-1 d^T A d)."""
    m = np.array([[1, 0.6, 0.2, 0], [0, 1.2, 0.4, 0], [0, 0, 0.7, 0], [0, 0, 0, 1.0]])
    where = np.array([300.0, 800.0, -200.0])
    found = received(light("SphereLight", translation(*where) @ m, "float inputs:radius = 1e-3"), np.zeros((1, 3)))
    s = 1e-3 * m[:3, :3]
    a = np.linalg.inv(s @ s.T)
    r = np.linalg.norm(where)
    d = where / r
    np.testing.assert_allclose(found, pi * np.sqrt(d @ a @ d / np.linalg.det(a)) * d[1] / r**2, rtol=3e-6)


@pytest.mark.parametrize("radius", [1e-6, 0.5, 1e6])
def test_disk_on_its_axis(radius: float) -> None:
    found = received(light("DiskLight", DOWNWARD, f"float inputs:radius = {radius}"), np.zeros((1, 3)))
    np.testing.assert_allclose(found, pi * radius**2 / (radius**2 + 1), rtol=2e-6, atol=1e-12)


def test_disk_off_its_axis() -> None:
    """Parallel element, Howell's catalogue, B-13."""
    found = received(light("DiskLight", DOWNWARD, "float inputs:radius = 0.5"))
    r, a = 0.5, np.hypot(POINTS[:, 0], POINTS[:, 2])
    z = 1 + a**2 + r**2
    np.testing.assert_allclose(found, pi / 2 * (1 - (z - 2 * r * r) / np.sqrt(z * z - 4 * r * r * a * a)), rtol=2e-6)


@pytest.mark.parametrize("half", [1e-5, 0.3, pi / 2])
def test_distant_cap(half: float) -> None:
    for tilt in (0.0, 40.0):
        m = rotation([1, 0, 0], -90 + tilt)
        if np.radians(tilt) + half > pi / 2 and tilt:
            continue
        found = received(
            light("DistantLight", m, "float inputs:intensity = 1", f"float inputs:angle = {float(np.degrees(2 * half))!r}")
        )
        np.testing.assert_allclose(found, pi * np.sin(half) ** 2 * np.cos(np.radians(tilt)), rtol=1e-6)


def test_distant_hemisphere_tilted_and_whole_sphere() -> None:
    """Half of all directions about an axis at angle t to the normal: pi (1 + cos t) / 2. All directions: pi."""
    for tilt in (0.0, 30.0, 90.0, 150.0):
        m = rotation([1, 0, 0], -90 + tilt)
        found = received(light("DistantLight", m, "float inputs:intensity = 1", "float inputs:angle = 180"))
        np.testing.assert_allclose(found, pi * (1 + np.cos(np.radians(tilt))) / 2, rtol=2e-6, atol=1e-12)
        found = received(light("DistantLight", m, "float inputs:intensity = 1", "float inputs:angle = 360"))
        np.testing.assert_allclose(found, pi, rtol=2e-6, atol=1e-12)


@pytest.mark.parametrize(
    "m",
    [translation(0, 1, 0) @ rotation([1, 1, 1], 25), translation(0.2, 0.1, 1.4) @ scaling(1, 0.7, 1.5)],
    ids=["over", "horizon"],
)
def test_cylinder_as_many_small_patches(m: np.ndarray) -> None:
    """The other road: the midpoint rule over all of it, without asking what can be seen."""
    radius, length, k = 0.3, 1.2, 1600
    found = received(
        light("CylinderLight", m, f"float inputs:radius = {radius}", f"float inputs:length = {length}"), POINTS[:3]
    )
    psi, x = (np.arange(k) + 0.5) / k * 2 * pi, ((np.arange(k) + 0.5) / k - 0.5) * length
    ring = np.stack([0 * psi, np.cos(psi), np.sin(psi)], axis=-1)
    normal = ring @ np.linalg.inv(m[:3, :3]) * np.linalg.det(m[:3, :3])
    for e, p in zip(found, POINTS[:3], strict=True):
        total = 0.0
        for xi in x:
            d = p - ((radius * ring + [xi, 0, 0]) @ m[:3, :3].T + m[:3, 3])
            r = np.linalg.norm(d, axis=1)
            total += (np.maximum(-d @ UP, 0) * np.maximum((d * normal).sum(axis=1), 0) / r**4).sum()
        assert e == pytest.approx(total * radius * length * 2 * pi / k**2, rel=3e-6)


def test_size_factors() -> None:
    """Areas of an ellipsoid of revolution (prolate, closed form), of an ellipse, of a stretched cylinder's round."""
    a = 3.0
    e = np.sqrt(1 - 1 / a**2)

    def factor(kind: str, m: np.ndarray, *lines: str) -> float:
        return size_factor(emitters(stage(light(kind, m, *lines), Plane()))[0])

    prolate = 2 * pi * (1 + a / e * np.arcsin(e))
    turned = rotation([1, 2, 3], 50) @ scaling(1, a, 1)
    assert factor("SphereLight", turned, "float inputs:radius = 1") == pytest.approx(prolate, rel=1e-9)
    assert factor("DiskLight", turned, "float inputs:radius = 0.5") == pytest.approx(pi * a / 4)
    assert factor("CylinderLight", scaling(2, 1, 1), "float inputs:radius = 0.5") == pytest.approx(2 * pi)
    # Perimeter of an ellipse with axes 3 and 1, by the complete elliptic integral: 13.3648932205553.
    assert factor("CylinderLight", scaling(1, a, 1), "float inputs:radius = 1") == pytest.approx(13.3648932205553, rel=1e-10)


def shaped(kind: str, m: np.ndarray, *lines: str) -> str:
    return light(kind, m, *lines, apis=["ShapingAPI"])


@pytest.mark.parametrize("angle", [1.0, 30.0, 60.0])
def test_hard_cone_on_a_disk(angle: float) -> None:
    """On the axis of a disk the cone leaves a smaller disk: pi sin^2 of the lesser angle."""
    found = received(shaped("DiskLight", DOWNWARD, f"float inputs:shaping:cone:angle = {angle}"), np.zeros((1, 3)))
    np.testing.assert_allclose(found, pi * min(np.sin(np.radians(angle)) ** 2, 0.2), rtol=2e-6)


def test_focus_on_a_disk() -> None:
    """On the axis, focus k: integral of cos^(k+1) sin over the angle, with the tint in the green channel."""
    text = shaped("DiskLight", DOWNWARD, "float inputs:shaping:focus = 3", "color3f inputs:shaping:focusTint = (0, 0.5, 1)")
    found = irradiance(emitters(stage(text, Plane())), np.zeros((1, 3)), UP).value[0]
    c, whole = 1 / np.sqrt(1.25), pi * 0.2
    focused = 2 * pi * (1 - c**5) / 5
    np.testing.assert_allclose(found, [focused, (focused + whole) / 2, whole], rtol=2e-6)


SHAPED = {
    "hard cone": ["float inputs:shaping:cone:angle = 50"],
    "soft cone, focus": ["float inputs:shaping:cone:angle = 110", "float inputs:shaping:cone:softness = 0.6",
                         "float inputs:shaping:focus = 1.5"],
    "profile": ["asset inputs:shaping:ies:file = @ASSETS/uneven.ies@", "float inputs:shaping:ies:angleScale = -1.3"],
}  # fmt: skip


@pytest.mark.parametrize("shape", ["SphereLight", "CylinderLight", "RectLight"])
@pytest.mark.parametrize("shaping", SHAPED)
def test_shaped_lights_as_many_small_patches(shape: str, shaping: str, tmp_path: Path) -> None:
    """The other road again: cuts in closed form against none at all, to what a midpoint rule can tell."""
    m = translation(0.2, 0.9, -0.3) @ rotation([1, 0.2, 0.4], -65) @ scaling(1, 0.6, 1.4)
    (tmp_path / "uneven.ies").write_text(uneven_profile(), encoding="ascii")
    lines = [line.replace("ASSETS", str(tmp_path)) for line in SHAPED[shaping]]
    one = emitters(stage(shaped(shape, m, "float inputs:radius = 0.5", *lines), Plane()))[0]
    found = irradiance_of(one, POINTS[:2], UP).value
    i = np.arange(317811)  # a Fibonacci lattice, which no edge of light is parallel to
    a, b = (i + 0.5) / i.size, (i * 196418 / i.size) % 1
    if shape == "RectLight":
        own, normal, share = np.stack([a - 0.5, b - 0.5, 0 * a], axis=-1), np.array([[0, 0, -1.0]]), 1.0
    elif shape == "CylinderLight":
        normal = np.stack([0 * a, np.cos(2 * pi * a), np.sin(2 * pi * a)], axis=-1)
        own, share = 0.5 * normal + np.stack([b - 0.5, 0 * b, 0 * b], axis=-1), pi
    else:
        r = np.sqrt(1 - (2 * b - 1) ** 2)
        normal = np.stack([r * np.cos(2 * pi * a), r * np.sin(2 * pi * a), 2 * b - 1], axis=-1)
        own, share = 0.5 * normal, pi
    cofactor = np.linalg.inv(m[:3, :3]) * np.linalg.det(m[:3, :3])
    for e, p in zip(found, POINTS[:2], strict=True):
        d = p - (own @ m[:3, :3].T + m[:3, 3])
        r = np.linalg.norm(d, axis=1)
        f = np.maximum(-d @ UP, 0) * np.maximum((d * (normal @ cofactor)).sum(axis=1), 0) / r**4
        assert one.shaping is not None
        factor = one.shaping.factor(d @ one.axis / r, d @ np.linalg.inv(m[:3, :3]).T)
        total = (f[:, None] * factor).mean(axis=0) * share
        np.testing.assert_allclose(e * np.ones(3), total, rtol=1e-3, atol=1e-9)


def test_bounds_hold() -> None:
    """The stated error against a run at a thousandth of it."""
    m = translation(0.1, 0.4, 0.1) @ rotation([1, 0.3, 0.2], -70) @ scaling(1.5, 0.4, 0.8)
    for kind in ("SphereLight", "DiskLight", "RectLight", "CylinderLight"):
        shaped = ["float inputs:shaping:cone:angle = 40", "float inputs:shaping:focus = 3"]
        one = emitters(stage(light(kind, m, "float inputs:radius = 0.4", *shaped, apis=["ShapingAPI"]), Plane()))[0]
        rough = irradiance_of(one, POINTS, UP, relative=1e-4)
        fine = irradiance_of(one, POINTS, UP, order=24, relative=1e-9)
        top = fine.value.max()
        assert (np.abs(rough.value - fine.value).max(axis=1) <= rough.error + 1e-6 * top).all()
        assert np.abs(irradiance_of(one, POINTS, UP).value - fine.value).max() < 1e-5 * top
