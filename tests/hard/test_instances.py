"""Instances with matrices that are hard on floats, crowds of them in one place, and nesting."""

from __future__ import annotations

import time

import numpy as np
import pytest
from tests.expanded import flat_stage
from tests.hard.placed_scenes import CUBE, codes, problems, shot, stage_of
from pxr import Usd

from primray import RenderSettings, render, Filter
from primray.image import Image

CAMERA = """def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float2 clippingRange = (0.1, 1000)
}
def DistantLight "sun"
{
    float inputs:intensity = 3
    float inputs:angle = 0
    float3 xformOp:rotateXYZ = (-30, 25, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
INSTANCER = """def PointInstancer "crowd"
{
    rel prototypes = </crowd/cube>
    def Mesh "cube"
    {
        color3f[] primvars:displayColor = [(0.8, 0.4, 0.2)]
        float3 xformOp:rotateXYZ = (20, 30, 0)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
        %s
    }
}
""" % CUBE


def crowd(positions: np.ndarray, scales: np.ndarray | None = None) -> Usd.Stage:
    stage = stage_of(CAMERA + INSTANCER)
    prim = stage.GetPrimAtPath("/crowd")
    from pxr import UsdGeom, Vt
    instancer = UsdGeom.PointInstancer(prim)
    instancer.CreateProtoIndicesAttr(Vt.IntArray(len(positions), 0))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
    if scales is not None:
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales.astype(np.float32)))
    return stage
def pic(stage, **kw):
    return render(stage, RenderSettings(**({"resolution": (32, 24), "spp": 4, "max_depth": 2, "filter": Filter.BOX, "threads": 2} | kw)))
if __name__=="__main__":
    one=pic(crowd(np.zeros((1,3))))
    for n in (10_000, 1_000_000):
        t=time.perf_counter(); im=pic(crowd(np.zeros((n,3)))); print(n,time.perf_counter()-t, im.report["diagnostics"], np.abs(im.pixels-one.pixels).max())
    r=np.random.default_rng(0)
    t=time.perf_counter(); im=pic(crowd(r.normal(size=(10_000,3))*1e-6),resolution=(8,6),spp=1); print("near",time.perf_counter()-t, im.report["diagnostics"], im.report["stages_s"])
    print(np.abs(im.pixels-pic(crowd(np.zeros((1,3))),resolution=(8,6),spp=1).pixels).max())
