"""Surfaces of all kinds side by side have the same bits at any number of lanes and threads."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

import primray
from primray.core import native, passes

from .worn import light, wear

MOST = native.lanes()
MATERIALS: tuple[dict[str, object], ...] = (
    {"base_color": (0.7, 0.1, 0.1)},
    {"base_metalness": 1.0, "specular_roughness": 0.0},
    {"base_metalness": 1.0, "specular_roughness": 0.4, "specular_roughness_anisotropy": 0.7},
    {"transmission_weight": 1.0, "specular_roughness": 0.0},
    {"transmission_weight": 1.0, "specular_roughness": 0.3, "transmission_dispersion_scale": 1.0},
    {"transmission_weight": 0.5, "base_diffuse_roughness": 0.6, "geometry_opacity": 0.7},
    {"transmission_weight": 1.0, "specular_roughness": 0.2, "geometry_thin_walled": True},
    {"subsurface_weight": 0.7, "geometry_thin_walled": True, "base_diffuse_roughness": 0.3},
    {"coat_weight": 0.8, "coat_color": (0.9, 0.5, 0.3), "coat_roughness": 0.2},
    {"fuzz_weight": 1.0, "fuzz_color": (0.4, 0.5, 0.9)},
    {"thin_film_weight": 1.0, "specular_roughness": 0.1},
    {},
)


def spheres() -> Usd.Stage:
    """Of each material one, the last two of UsdPreviewSurface and of displayColor, above a floor."""
    stage = Usd.Stage.CreateInMemory()
    for k, inputs in enumerate(MATERIALS):
        ball = UsdGeom.Sphere.Define(stage, f"/ball{k}")
        ball.CreateRadiusAttr(0.45)
        ball.AddTranslateOp().Set((k % 4 - 1.5, k // 4 - 1.0, 0.0))
        if k == len(MATERIALS) - 1:
            break
        wear(ball, f"/m{k}", inputs, "ND_open_pbr_surface_surfaceshader" if inputs else "UsdPreviewSurface")
    light(stage)
    return stage


def test_lanes_and_threads_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = spheres()
    pictures = []
    for lanes, threads in ((1, 1), (4, 2), (0, 1)):
        settings = primray.RenderSettings(resolution=(48, 36), spp=16, threads=threads)
        monkeypatch.setattr(passes, "lanes", lambda lanes=lanes: lanes or MOST)
        pictures.append(np.asarray(primray.render(stage, settings).pixels))
    assert np.isfinite(pictures[0]).all()
    for other in pictures[1:]:
        np.testing.assert_array_equal(pictures[0], other)
