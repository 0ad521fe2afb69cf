"""A closed room full of fog: a spot lights a pool on its floor, and that the rest."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from tests.bench.stages.indirect import box, mesh, stage

from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings

DEPTH = 12
SPOT = """
    def SphereLight "spot" (prepend apiSchemas = ["ShapingAPI"]) {
        float inputs:radius = 0.05
        float inputs:intensity = 8000
        float inputs:shaping:cone:angle = 12
        float inputs:shaping:cone:softness = 0.1
        double3 xformOp:translate = (-1.5, 2.8, -1)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }"""
FOG = """def Xform "World" (prepend apiSchemas = ["PrimrayFogAPI"]) {
    float primray:fog:density = 0.15
    float primray:fog:anisotropy = 0.2"""


@cache
def room(fog: bool = True) -> Any:
    """The core's scene, small."""
    prims = [mesh("walls", box((-3, 0, -4), (3, 3, 4)), "white"), SPOT]
    text = stage((0, 1.4, 3.6), -4, 0, prims)
    settings = RenderSettings(resolution=(48, 36), camera="/World/cam", max_depth=DEPTH)
    path = Path(mkdtemp()) / "room.usda"
    path.write_text(text.replace('def Xform "World" {', FOG) if fog else text)
    opened = open_once(path, settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene
