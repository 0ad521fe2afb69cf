"""Every public stage translates, whatever is in it; skipped where the shared assets are not at hand."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from primray.description import Mesh
from primray.diagnostics import Diagnostics
from primray.report.summary import summary
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[3] / "shared" / "assets"))
STAGES = sorted(p for p in ASSETS.rglob("*.usd*") if p.suffix in (".usd", ".usda", ".usdc", ".usdz"))


@pytest.mark.skipif(not STAGES, reason="the shared assets are not here")
@pytest.mark.parametrize("path", STAGES, ids=lambda p: str(p.relative_to(ASSETS)))
def test_translates(path: Path) -> None:
    description, _ = translate(open_stage(path, Diagnostics()), RenderSettings())
    for shape in description.shapes:
        if isinstance(shape, Mesh):
            count = len(shape.triangles)
            assert np.isfinite(shape.points).all()
            assert shape.triangles.min() >= 0
            assert shape.triangles.max() < len(shape.points)
            for values, lengths in (
                (shape.normals, (len(shape.points), 3 * count)),
                (shape.colors, (count, len(shape.points), 3 * count)),
            ):
                assert values is None or len(values) in lengths
        assert np.max(shape.surface) < len(description.surfaces)
    assert summary(description).memory_bytes >= 0


@pytest.mark.skipif(not STAGES, reason="the shared assets are not here")
def test_nested_instances_of_arnold() -> None:
    """100 native instances of an instancer of 100 cubes, one of each stored."""
    stage = open_stage(ASSETS / "arnold-usd/test_0218/test.usda", Diagnostics())
    found = summary(translate(stage, RenderSettings())[0])
    assert (found.instances, found.triangles_unique, found.triangles_instanced) == (10_000, 12, 120_000)
