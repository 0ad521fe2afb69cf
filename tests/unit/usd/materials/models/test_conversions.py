"""Reflections in OpenPBR's words, against the models that they come from."""

from __future__ import annotations

import numpy as np
import pytest

from primray.usd.materials.materialx.expressions import Expressions
from primray.usd.materials.models.conversions import (
    EDGE,
    ior_for_reflectance,
    ior_under_coat,
    metal_edge_tint,
    normal_reflectance,
)
from primray.usd.materials.models.open_pbr import Reader


def reader() -> Reader:
    return Reader({}, Expressions())


@pytest.mark.parametrize("reflected", [0.0, 0.04, 0.08, 0.5])
def test_an_index_reflects_what_it_is_of(reflected: float) -> None:
    assert normal_reflectance(ior_for_reflectance(reflected)) == pytest.approx(reflected)


@pytest.mark.parametrize("coat", [0.0, 0.25, 1.0])
def test_the_base_under_a_coat_meets_the_index_that_it_had(coat: float) -> None:
    found = ior_under_coat(reader(), (1.5,), (coat,), (1.6,))
    assert isinstance(found, tuple)
    n = found[0]
    assert (1 - coat) * n + coat * n / 1.6 == pytest.approx(1.5)  # OpenPBR: lerp(n_b / n_a, n_b / n_c, C)


def gulbrandsen(f0: float, g: float, cosine: float) -> float:
    """What a conductor of these reflects, by the s and p amplitudes from its real and imaginary parts (Born and Wolf 14.4)."""
    n = g * (1 - f0) / (1 + f0) + (1 - g) * (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    k2 = (f0 * (n + 1) ** 2 - (n - 1) ** 2) / (1 - f0)
    sine2 = 1 - cosine**2
    t0 = n * n - k2 - sine2
    a2b2 = np.sqrt(t0 * t0 + 4 * n * n * k2)
    a = np.sqrt((a2b2 + t0) / 2)
    s = (a2b2 + cosine**2 - 2 * a * cosine) / (a2b2 + cosine**2 + 2 * a * cosine)
    top, t4 = cosine**2 * a2b2 + sine2**2, 2 * a * cosine * sine2
    return float((s * (top - t4) / (top + t4) + s) / 2)


@pytest.mark.parametrize("f0", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("g", [0.0, 0.25, 0.5])
def test_a_metals_edge_reflects_as_the_conductor(f0: float, g: float) -> None:
    found = metal_edge_tint(reader(), (f0,) * 3, (g,) * 3)
    assert isinstance(found, tuple)
    schlick = f0 + (1 - f0) * (1 - EDGE) ** 5
    assert found[0] * schlick == pytest.approx(gulbrandsen(f0, g, EDGE), rel=1e-9)
    assert gulbrandsen(f0, g, 1.0) == pytest.approx(f0)


def test_white_edges_stay_white() -> None:
    assert metal_edge_tint(reader(), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)) == (1.0, 1.0, 1.0)
