"""White furnace: what a surface reflects of light from all around, against double-precision quadrature, and never above 1."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.described import kernels, lambert
from tests.statistics.surfaces.preview_surface import PreviewSurface, diffuse_directions
from tests.statistics.surfaces.surface_cases import WHITE, direction, evaluate, lattice, rows, sample, side

from primray.core.inputs import surface_input
from primray.description import Surface

COSINES = (0.001, 0.003, 0.013, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0)
ROUGHNESSES = (0.0, 0.01, 0.03, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
IORS = (0.5, 1.0, 1.33, 1.5, 2.0, 5.0)
U = lattice(2**14, 2)
TOLERANCE = 1e-3


def albedo(s: Surface, cos: float, front: bool = True) -> np.ndarray:
    """Mean weight of samples, (3,): of each lobe by itself, times its chance (which test_bsdf.py holds against the draws)."""
    wo = direction(cos)
    chances = kernels().bsdf_lobes(surface_input(s), rows(wo, 1), side(1, front))[0][0, :3].astype(np.float64)
    edges = np.append(np.insert(np.cumsum(chances), 0, 0), 1.0)
    total = np.zeros(3)
    for low, high in pairwise(edges):
        if high - low > 1e-6:
            u = np.insert(U, 0, np.float32((low + high) / 2), axis=1)
            total += (high - low) * sample(s, wo, u, front)[1].astype(np.float64).mean(axis=0)
    return total


def check(s: Surface) -> None:
    reference = PreviewSurface(s)
    for cos in COSINES:
        measured = float(albedo(s, cos)[0])
        assert measured == pytest.approx(reference.albedo(cos), abs=TOLERANCE)
        # The lattice's own error, largest at the horizon; test_never_above_one has none.
        assert measured <= 1 + (5e-5 if cos > 0.1 else 5e-4)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.conforms("UsdPreviewSurface.inputs:roughness", "UsdPreviewSurface.inputs:metallic")
def test_base(roughness: float, metallic: float) -> None:
    check(replace(WHITE, roughness=roughness, metallic=metallic))


@pytest.mark.parametrize("roughness", ROUGHNESSES[::2])
@pytest.mark.parametrize("clearcoat", [(0.5, 0.01), (1.0, 0.1), (1.0, 0.6)])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.conforms("UsdPreviewSurface.inputs:clearcoat", "UsdPreviewSurface.inputs:clearcoatRoughness")
def test_clearcoat(roughness: float, clearcoat: tuple[float, float], metallic: float) -> None:
    check(replace(WHITE, roughness=roughness, metallic=metallic, clearcoat=clearcoat[0], clearcoat_roughness=clearcoat[1]))


@pytest.mark.parametrize("ior", IORS)
@pytest.mark.conforms("UsdPreviewSurface.inputs:ior")
def test_index_of_refraction(ior: float) -> None:
    for roughness in (0.1, 0.5):
        check(replace(WHITE, ior=ior, roughness=roughness))


@pytest.mark.parametrize("ior", [*IORS, 1e6])
def test_never_above_one(ior: float) -> None:
    """The diffuse lobe, evaluated, under a quadrature that has no error to speak of, and the specular lobe's exact albedo: all
    that the tables decide, at every roughness between their rows too."""
    cos_in, azimuth, weight = diffuse_directions()
    sin_in = np.sqrt(1 - cos_in**2)
    wi = np.stack([sin_in * np.cos(azimuth), sin_in * np.sin(azimuth), cos_in], axis=1)
    for roughness in (0.0, *np.geomspace(0.01, 1, 24)):
        s = replace(WHITE, ior=ior, roughness=float(roughness))
        reference = PreviewSurface(s)
        for cos in (1e-5, 1e-4, *COSINES):
            diffuse, _, _ = evaluate(s, direction(cos, 0.0), wi)
            reflected = float(np.sum(weight * diffuse[:, 0] * np.pi / cos_in) + reference.specular_albedo(cos))
            assert reflected <= 1 + 3e-5
            if cos >= COSINES[0]:
                assert reflected == pytest.approx(reference.albedo(cos), abs=6e-4)


@pytest.mark.parametrize("specular", [0.0, 0.5, 1.0])
@pytest.mark.conforms("UsdPreviewSurface.inputs:useSpecularWorkflow", "UsdPreviewSurface.inputs:specularColor")
def test_specular_workflow(specular: float) -> None:
    for roughness in (0.0, 0.3, 0.8):
        check(replace(WHITE, use_specular_workflow=True, specular_color=(specular,) * 3, roughness=roughness))


@pytest.mark.parametrize("opacity", [0.0, 0.5])
@pytest.mark.conforms("UsdPreviewSurface.inputs:opacity")
def test_transparent(opacity: float) -> None:
    for roughness in (0.0, 0.3, 0.8):
        check(replace(WHITE, opacity=opacity, roughness=roughness, thin=True))


def test_exactly_one() -> None:
    glass = replace(WHITE, opacity=0.0, roughness=0.0)
    mirror = replace(WHITE, metallic=1.0, roughness=0.0)
    for cos in COSINES:
        for s, front in (
            (lambert(1.0), True),
            (mirror, True),
            (glass, True),
            (glass, False),
            (replace(glass, thin=True), True),
        ):
            np.testing.assert_allclose(albedo(s, cos, front), 1, atol=2e-6)
