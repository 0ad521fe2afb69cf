"""Point instances that the core places itself are where their matrices in NumPy say, to the bit of the picture."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

import primray
from primray.core import scene_upload
from primray.settings import RenderSettings

SETTINGS = RenderSettings(resolution=(64, 36), spp=4, threads=1)
COUNT = 700


def field(orientations: type, *, moved: bool, turned: bool = True, scaled: bool = True) -> Usd.Stage:
    """Cubes at random; some quaternions are of length 0, some sizes are 0 or mirror."""
    rng = np.random.default_rng(3)
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    instancer = UsdGeom.PointInstancer.Define(stage, "/field")
    UsdGeom.Cube.Define(stage, "/field/one").CreateSizeAttr(1.0)
    instancer.CreatePrototypesRel().SetTargets(["/field/one"])
    instancer.CreateProtoIndicesAttr(Vt.IntArray(COUNT))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(rng.uniform(-9, 9, (COUNT, 3)).astype(np.float32)))
    turns = rng.normal(size=(COUNT, 4))
    turns[::50] = 0
    sizes = rng.uniform(0.3, 1, (COUNT, 3)).astype(np.float32)
    sizes[::40, 0] *= -1
    sizes[::70, 1] = 0
    if turned and orientations is np.float16:
        instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns.astype(np.float16)))
    elif turned:
        instancer.CreateOrientationsfAttr(Vt.QuatfArray.FromNumpy(turns.astype(np.float32)))
    if scaled:
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(sizes))
    if moved:
        instancer.AddTranslateOp().Set(Gf.Vec3d(0.37, -1.1, 2.03))
        instancer.AddRotateXYZOp().Set(Gf.Vec3f(13, 29, 51))
        instancer.AddScaleOp().Set(Gf.Vec3f(1.1, 1.1, 1.1))
    UsdLux.DomeLight.Define(stage, "/sky")
    return stage


@pytest.mark.parametrize("moved", [False, True], ids=["as it is", "moved"])
@pytest.mark.parametrize("given", [{}, {"turned": False}, {"scaled": False}, {"orientations": np.float32}])
def test_the_same_picture(moved: bool, given: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    stage = field(**{"orientations": np.float16, "moved": moved, **given})  # type: ignore[arg-type]
    here = primray.render(stage, settings=SETTINGS, aovs=("depth", "instance"))
    monkeypatch.setattr(scene_upload, "PointInstances", int)  # which no level is
    monkeypatch.delattr(scene_upload, "_add_points")
    there = primray.render(stage, settings=SETTINGS, aovs=("depth", "instance"))
    assert here.report["pixels_sha256"] == there.report["pixels_sha256"]
    for name in ("depth", "instance"):
        np.testing.assert_array_equal(np.asarray(here.aovs[name]), np.asarray(there.aovs[name]))
