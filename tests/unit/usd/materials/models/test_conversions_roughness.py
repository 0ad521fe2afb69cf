"""Widths of microfacets: OpenPBR's from another model's are the same two widths."""

from __future__ import annotations

import math

import pytest

from primray.description import Operand
from primray.usd.materials.materialx.expressions import Expressions
from primray.usd.materials.models.conversions import roughness_by_aspect, roughness_by_strength
from primray.usd.materials.models.open_pbr import Reader


def widths(roughness: Operand, anisotropy: Operand) -> tuple[float, float]:
    """OpenPBR's alpha_t and alpha_b ("Microfacet model")."""
    assert isinstance(roughness, tuple)
    assert isinstance(anisotropy, tuple)
    r, a = roughness[0], anisotropy[0]
    along = r * r * math.sqrt(2 / (1 + (1 - a) ** 2))
    return along, (1 - a) * along


def reader() -> Reader:
    return Reader({}, Expressions())


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("anisotropy", [0.25, 0.9, 1.0])
def test_by_aspect(roughness: float, anisotropy: float) -> None:
    aspect = math.sqrt(1 - min(anisotropy, 0.98))
    expected = (min(roughness**2 / aspect, 1.0), roughness**2 * aspect)
    assert widths(*roughness_by_aspect(reader(), (roughness,), (anisotropy,))) == pytest.approx(expected)


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("strength", [0.25, 1.0])
def test_by_strength(roughness: float, strength: float) -> None:
    alpha = roughness**2
    expected = (alpha + (1 - alpha) * strength**2, alpha)
    assert widths(*roughness_by_strength(reader(), (roughness,), (strength,))) == pytest.approx(expected)


def test_what_is_smooth_stays_a_number() -> None:
    assert roughness_by_aspect(reader(), (0.0,), (0.5,))[0] == (0.0,)


def test_without_anisotropy_the_roughness_is_the_same() -> None:
    assert roughness_by_aspect(reader(), (0.3,), (0.0,)) == roughness_by_strength(reader(), (0.3,), (0.0,)) == ((0.3,), (0.0,))
