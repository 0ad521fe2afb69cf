"""Rooms with metal or glass in them: photons, a learnt guide, or both, whichever serves; the light stays the same."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from tests.described import asked, replicate_means

from primray import core
from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings

DEPTH, SPLITS = 6, 2

# A closed room, 6 x 3 x 8; a part of it is of metal.
STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
    metersPerUnit = 1
)
def Xform "World" {{
    def Mesh "walls" {{
        point3f[] points = [(-3, 0, -4), (3, 0, -4), (3, 0, 4), (-3, 0, 4), (-3, 3, -4), (3, 3, -4), (3, 3, 4), (-3, 3, 4)]
        int[] faceVertexCounts = [4, 4, 4, 4, 4]
        int[] faceVertexIndices = [4, 5, 6, 7, 0, 1, 5, 4, 3, 7, 6, 2, 0, 4, 7, 3, 1, 2, 6, 5]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(0.7, 0.68, 0.6)]
    }}
    def Mesh "floor" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
        point3f[] points = [(-3, 0, -4), (-3, 0, 4), (3, 0, 4), (3, 0, -4)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(0.4, 0.4, 0.4)]
        {floor}
    }}
    def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
        double radius = 0.5
        double3 xformOp:translate = (0.4, 0.5, -0.8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        color3f[] primvars:displayColor = [(0.4, 0.4, 0.4)]
        {ball}
    }}
    def Material "metal" {{
        token outputs:surface.connect = <surface.outputs:surface>
        def Shader "surface" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.85, 0.75, 0.6)
            float inputs:metallic = 1
            float inputs:roughness = {roughness}
            token outputs:surface
        }}
    }}
    {lamp}
    def Camera "cam" {{
        float focalLength = 18
        double3 xformOp:translate = (0, 1.4, 3.6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""
BOUND = "rel material:binding = </World/metal>"
WIDE = """def RectLight "lamp" {
        float inputs:width = 0.8
        float inputs:height = 0.8
        float inputs:intensity = 50
        double3 xformOp:translate = (0, 2.9, -0.5)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }"""
SMALL = """def SphereLight "lamp" {
        float inputs:radius = 0.02
        float inputs:intensity = 4000
        double3 xformOp:translate = (1.2, 2.2, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }"""
ROOMS = {
    "rough floor": {"floor": BOUND, "ball": "", "roughness": 0.3, "lamp": WIDE},
    "rough metal": {"floor": BOUND, "ball": BOUND, "roughness": 0.3, "lamp": WIDE},
    "smooth ball": {"floor": "", "ball": BOUND, "roughness": 0.05, "lamp": SMALL},
}


@cache
def room(name: str) -> Any:
    settings = RenderSettings(resolution=(48, 36), camera="/World/cam", max_depth=DEPTH)
    path = Path(mkdtemp()) / "room.usda"
    path.write_text(STAGE.format(**ROOMS[name]))
    opened = open_once(path, settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene


@cache
def guides(name: str, lanes: int = 0) -> tuple[Any, Any]:
    """What is learnt there, and the photons."""
    scene, lanes = room(name)._scene, lanes or core.lanes()
    photons = core.module().learn_caustics(scene, DEPTH, 2, lanes)
    return core.module().learn_guide(scene, asked(max_depth=DEPTH, splits=SPLITS, caustics=photons), lanes), photons


def rendered(name: str, spp: int, guide: Any, photons: Any, *, lanes: int = 0, threads: int = 2, seed: int = 0) -> Any:
    film = core.Film(room(name))
    ends, lanes = core.uniform_ends(film, spp), lanes or core.lanes()
    settings = asked(max_depth=DEPTH, splits=SPLITS, threads=threads, seed=seed, guide=guide, caustics=photons)
    core.module().render_pass(room(name)._scene, film._film, ends, settings, lanes=lanes)
    return film._film


def test_large_lights_on_rough_metal_are_left_to_the_guide() -> None:
    guide, photons = guides("rough metal")
    assert photons is not None
    assert photons.sharp < 0.05
    assert guide is not None
    assert guide.alone
    used, beside, without = (
        np.mean([_error(rendered("rough metal", 32, *use, seed=seed)) for seed in range(4)])
        for use in ((guide, None), (guide, photons), (None, photons))
    )
    assert used < 1.4 * without  # both of which take half as long again
    assert used < 1.4 * beside


def test_photons_are_launched_from_a_lamp_inside_the_bounds_of_a_floor() -> None:
    guide, photons = guides("rough floor")
    assert photons is not None
    assert guide is None  # it finds no more
    alone = core.module().learn_guide(room("rough floor")._scene, asked(max_depth=DEPTH, splits=SPLITS), core.lanes())
    used, by_guide, without = (
        np.mean([_error(rendered("rough floor", 32, *use, seed=seed)) for seed in range(4)])
        for use in ((None, photons), (alone, None), (None, None))
    )
    assert used < 0.4 * without  # 0.24 when this was written
    assert used < 1.1 * by_guide


def test_photons_from_small_lights_stay() -> None:
    guide, photons = guides("smooth ball")
    assert photons.sharp > 0.3
    assert guide is None or not guide.alone


def _error(film: Any) -> float:
    one, other = replicate_means(film)
    mean = (one + other) / 2
    return float((((one - other) / 2) ** 2 / (mean**2 + 0.01)).mean())


def test_both_together_bring_the_same_light() -> None:
    """Means of 4 x 3 parts of the picture, by 5 of their standard errors from 8 pairs of replicates."""

    def parts(*use: Any) -> Any:
        films = [rendered("rough metal", 64, *use, seed=seed) for seed in range(8)]
        means = np.concatenate([replicate_means(film).mean(axis=-1) for film in films])
        return means.reshape(16, 3, 12, 4, 12).mean(axis=(2, 4))

    learnt = guides("rough metal")
    assert None not in learnt
    a, b = parts(*learnt), parts(None, None)
    error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / 15)
    assert np.median(error / b.mean(axis=0)) < 0.05
    assert np.all(np.abs(a.mean(axis=0) - b.mean(axis=0)) < 5 * error)
    a, b = a.mean(axis=(1, 2)), b.mean(axis=(1, 2))
    assert abs(a.mean() - b.mean()) < 5 * np.sqrt((a.var() + b.var()) / 15)  # 0.1 %


def test_bits_do_not_depend_on_lanes_or_threads() -> None:
    name, wide = "rough metal", core.lanes()
    images = {
        rendered(name, 8, *guides(name, learnt), lanes=lanes, threads=threads).replicates.tobytes()
        for learnt, lanes, threads in ((1, wide, 2), (wide, 1, 1), (wide, wide, 3))
    }
    assert len(images) == 1


def test_the_report_tells_what_guides() -> None:
    settings = RenderSettings(max_depth=DEPTH, spp=64)
    scene = room("rough metal")
    assert core.choose_splits(scene, settings).paths > 1
    assert scene.caustics(settings) is not None
    told = {row["name"].split(" in ")[0].split(" by ")[0] for row in scene.features}
    assert "caustics guided" in told
    assert scene.guide(settings, core.Splits(SPLITS)).alone
    told = {row["name"].split(" in ")[0].split(" by ")[0] for row in scene.features}
    assert "caustics guided" not in told
    assert "indirect light guided" in told
