"""The automatic camera's bounds where USD's own would make all matrices at once, and where instances are kept in two levels."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.camera import framed_objects
from primray.usd.camera.framed_objects import shape_bounds
from primray.usd.scene.bounds import Bounds

from ..usd_text import stage_of

NESTED = """def PointInstancer "p"
{
    rel prototypes = </p/q>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (30, 0, 0), (0, 10, 0)]
    def PointInstancer "q"
    {
        rel prototypes = </p/q/box>
        int[] protoIndices = [0, 0, 0, 0, 0, 0, 0, 0]
        point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0), (6, 0, 0), (0, 0, 3), (2, 0, 3), (4, 0, 3), (6, 0, 3)]
        def Cube "box"
        {
        }
    }
}
"""


def bounds(stage: Usd.Stage, settings: RenderSettings) -> Bounds:
    d, _ = translate(stage, settings)
    return shape_bounds(d.shapes, d.static, d.prototypes, d.placements)


@pytest.mark.parametrize("settings", [RenderSettings(), RenderSettings(max_memory_bytes=11 * 200)])
def test_nested_instances(settings: RenderSettings) -> None:
    center, size = bounds(stage_of(NESTED), settings)
    np.testing.assert_allclose(center, [18, 5, 1.5])
    np.testing.assert_allclose(size, [38, 12, 5])


def test_many_instances_are_bounded_by_their_arrays(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Usd.Stage.CreateInMemory()
    instancer = UsdGeom.PointInstancer.Define(stage, "/p")
    UsdGeom.Cube.Define(stage, "/p/box")
    instancer.CreatePrototypesRel().AddTarget("/p/box")
    instancer.CreateProtoIndicesAttr(Vt.IntArray(1000))
    positions = np.random.default_rng(1).uniform(-50, 50, (1000, 3)).astype(np.float32)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    instancer.CreateScalesAttr(Vt.Vec3fArray([(2, 1, 1)] * 1000))
    center, size = bounds(stage, RenderSettings())
    monkeypatch.setattr(framed_objects, "MOST_BOUNDED_INSTANCES", 10)
    for found, expected in zip(bounds(stage, RenderSettings()), (center, size), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
