"""Guides on surfaces with glossy, polished and coated lobes: the same light with less noise, and the same bits."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest
from tests.bench.stages import indirect
from tests.described import asked, replicate_means

from primray import core
from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings

DEPTH = indirect.MAX_DEPTH
SEEDS = 8
LOOKS = """
    def Scope "looks" {
        def Material "glossy" {
            token outputs:surface.connect = </World/looks/glossy/surface.outputs:surface>
            def Shader "surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0.6, 0.55, 0.5)
                float inputs:roughness = 0.3
                token outputs:surface
            }
        }
        def Material "polished" {
            token outputs:surface.connect = </World/looks/polished/surface.outputs:surface>
            def Shader "surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0.6, 0.4, 0.3)
                float inputs:roughness = 0
                token outputs:surface
            }
        }
        def Material "coated" {
            token outputs:mtlx:surface.connect = </World/looks/coated/surface.outputs:out>
            def Shader "surface" {
                uniform token info:id = "ND_open_pbr_surface_surfaceshader"
                color3f inputs:base_color = (0.5, 0.5, 0.6)
                float inputs:specular_roughness = 0.4
                float inputs:coat_weight = 0.5
                float inputs:coat_roughness = 0.2
                float inputs:fuzz_weight = 0.3
                token outputs:out
            }
        }
    }"""
WORN = {"door": {"floor": "glossy", "table": "polished", "walls": "coated"}, "uplight": {"room": "coated", "table": "polished"}}


@cache
def room(name: str) -> Any:
    """The core's scene of one of the two rooms whose light is indirect, small."""
    path = indirect.write(Path(mkdtemp()))[name]
    text = path.read_text().replace('def Xform "World" {', 'def Xform "World" {' + LOOKS)
    for mesh, look in WORN[name].items():
        bound = f'(prepend apiSchemas = ["MaterialBindingAPI"]) {{\n        rel material:binding = </World/looks/{look}>'
        text = text.replace(f'def Mesh "{mesh}" {{', f'def Mesh "{mesh}" {bound}')
    path.write_text(text)
    settings = RenderSettings(resolution=(48, 36), camera="/World/cam", max_depth=DEPTH)
    opened = open_once(path, settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene


@cache
def learnt(name: str) -> Any:
    return core.module().learn_guide(room(name)._scene, asked(max_depth=DEPTH, splits=2), core.lanes())


def rendered(name: str, spp: int, guide: Any, lanes: int = 0, seed: int = 0) -> Any:
    scene = room(name)
    film = core.Film(scene)
    settings = asked(max_depth=DEPTH, splits=2, threads=2, seed=seed, guide=guide)
    core.module().render_pass(scene._scene, film._film, core.uniform_ends(film, spp), settings, lanes=lanes or core.lanes())
    return film._film


def parts(name: str, guide: Any) -> Any:
    """Means of 4 x 3 parts of the picture, of each replicate of each seed."""
    means = [replicate_means(rendered(name, 64, guide, seed=seed)).mean(axis=-1) for seed in range(SEEDS)]
    return np.concatenate(means).reshape(2 * SEEDS, 3, 12, 4, 12).mean(axis=(2, 4))


@pytest.mark.parametrize("name", WORN)
def test_guided_paths_bring_the_same_light_with_less_noise(name: str) -> None:
    """By 5 standard errors of each part, which are about a percent. Variances are relative, as direct light rules others."""
    assert learnt(name) is not None
    guided, plain = parts(name, learnt(name)), parts(name, None)
    error = np.sqrt((guided.var(axis=0) + plain.var(axis=0)) / (2 * SEEDS - 1))
    assert np.median(error / plain.mean(axis=0)) < 0.05
    assert np.all(np.abs(guided.mean(axis=0) - plain.mean(axis=0)) < 5 * error)
    variances = [(means.var(axis=0) / plain.mean(axis=0) ** 2).mean() for means in (guided, plain)]
    assert variances[0] < 0.5 * variances[1]


def test_bits_do_not_depend_on_lanes() -> None:
    films = [rendered("door", 8, learnt("door"), lanes=lanes).replicates for lanes in (1, core.lanes())]
    np.testing.assert_array_equal(*films)
