"""World-space areas against plain quadrature in double."""

from __future__ import annotations

import numpy as np
import pytest

from primray.photometry.light_shape import carlson_rg, cylinder_area, disk_area, rect_area, sphere_area

rng = np.random.default_rng(3)


def transform(linear: np.ndarray) -> np.ndarray:
    m = np.eye(4)
    m[:3, :3] = linear
    return m


SHEARED = [transform(rng.normal(size=(3, 3))) for _ in range(6)]


def sphere_by_quadrature(m: np.ndarray, radius: float, n: int = 400) -> float:
    """Gauss in cos theta, trapezoids in phi, of |cof(M) n| r^2."""
    z, w = np.polynomial.legendre.leggauss(n)
    phi = 2 * np.pi * np.arange(2 * n) / (2 * n)
    s = np.sqrt(1 - z * z)
    d = np.stack([s[:, None] * np.cos(phi), s[:, None] * np.sin(phi), z[:, None] + 0 * phi], -1)
    linear = m[:3, :3]
    cofactor = np.linalg.det(linear) * np.linalg.inv(linear).T
    return float((np.linalg.norm(d @ cofactor.T, axis=-1).sum(1) * w).sum() * (2 * np.pi / (2 * n)) * radius**2)


@pytest.mark.parametrize("m", SHEARED)
def test_ellipsoid(m: np.ndarray) -> None:
    assert sphere_area(m, 0.7) == pytest.approx(sphere_by_quadrature(m, 0.7), rel=1e-9)


@pytest.mark.parametrize("m", SHEARED)
def test_cylinder(m: np.ndarray) -> None:
    phi = 2 * np.pi * np.arange(20000) / 20000
    tangent = m[:3, :3] @ np.stack([0 * phi, -np.sin(phi), np.cos(phi)])
    swept = np.cross(m[:3, 0], tangent.T)
    expected = 1.5 * 0.3 * np.linalg.norm(swept, axis=1).mean() * 2 * np.pi
    assert cylinder_area(m, 1.5, 0.3) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("m", SHEARED)
def test_flat_shapes(m: np.ndarray) -> None:
    u, v = m[:3, 0], m[:3, 1]
    parallelogram = np.sqrt((u @ u) * (v @ v) - (u @ v) ** 2)
    assert rect_area(m, 2, 3) == pytest.approx(6 * parallelogram, rel=1e-12)
    assert disk_area(m, 2) == pytest.approx(4 * np.pi * parallelogram, rel=1e-12)


def test_known_values() -> None:
    assert sphere_area(np.eye(4), 2) == pytest.approx(16 * np.pi, rel=1e-14)
    assert sphere_area(transform(np.diag([3, 3, 1e-9])), 1) == pytest.approx(2 * np.pi * 9, rel=1e-9)  # both faces of a disc
    assert sphere_area(transform(np.diag([1, 1, 0])), 1) == pytest.approx(2 * np.pi, rel=1e-12)
    assert sphere_area(transform(np.diag([1, 0, 0])), 1) == 0
    assert cylinder_area(np.eye(4), 2, 0.5) == pytest.approx(2 * np.pi, rel=1e-14)
    # Ramanujan-free: the perimeter of an ellipse (1, 2) is 9.688448220547675.
    assert 8 * carlson_rg(0, 1, 4) == pytest.approx(9.688448220547675, rel=1e-14)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_scale(scale: float) -> None:
    m = transform(SHEARED[0][:3, :3] * scale)
    assert sphere_area(m, 1) == pytest.approx(sphere_area(SHEARED[0], 1) * scale**2, rel=1e-12)
