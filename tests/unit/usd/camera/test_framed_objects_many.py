"""Many instances together are framed by boxes around their placements, and nearly as each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.camera import framed_objects


def forest() -> Usd.Stage:
    """Two kinds of cubes, 300 and 20 of them."""
    stage = Usd.Stage.CreateInMemory()
    rng = np.random.default_rng(2)
    for name, count in (("trees", 300), ("rocks", 20)):
        made = UsdGeom.PointInstancer.Define(stage, f"/{name}")
        UsdGeom.Cube.Define(stage, f"/{name}/one")
        made.CreatePrototypesRel().AddTarget(f"/{name}/one")
        made.CreateProtoIndicesAttr(Vt.IntArray(count))
        made.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(rng.uniform(-50, 50, (count, 3)).astype(np.float32)))
    return stage


def found(stage: Usd.Stage) -> tuple[int, np.ndarray]:
    """How many objects are judged, and where the camera is."""
    d, _ = translate(stage, RenderSettings(resolution=(64, 36)))
    objects = framed_objects.framed_objects(d.shapes, d.static, d.prototypes, d.placements)
    return len(objects), d.camera.world_from_camera


def test_placements_share_what_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = forest()
    count, camera = found(stage)
    assert count == 320
    monkeypatch.setattr(framed_objects, "MOST_BOUNDED_TOGETHER", 320)
    assert found(stage)[0] == 320
    monkeypatch.setattr(framed_objects, "MOST_BOUNDED_TOGETHER", 319)
    fewer, nearly = found(stage)
    assert fewer == 21
    np.testing.assert_allclose(nearly, camera, atol=0.15 * np.abs(camera).max())
