"""A region of the picture is a data window of its own: it takes the place of the stage's, and what cannot be is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from primray import render
from primray.errors import SettingsError

STAGE = """#usda 1.0
(renderSettingsPrimPath = "/Render/s")
def Camera "c" { double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball" {
}
def Scope "Render" {
    def RenderSettings "s" { int2 resolution = (40, 20)
        float4 dataWindowNDC = (0.5, 0.5, 0.75, 1)
        rel camera = </c>
    }
}
"""


def test_a_region_stands_where_it_stands_in_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "s.usda"
    path.write_text(STAGE)
    whole = render(path, spp=2, region=(0, 0, 1, 1), aovs=("depth",))
    part = render(path, spp=2, region=(0.25, 0.5, 0.75, 1), aovs=("depth",))
    stage = render(path, spp=2, aovs=("depth",))
    assert whole.pixels.shape[:2] == (20, 40)
    assert part.pixels.shape[:2] == (10, 20)  # the upper half: rows count from the top
    assert stage.pixels.shape[:2] == (10, 10)
    assert (part.aovs["depth"].values == whole.aovs["depth"].values[:10, 10:30]).all()
    assert part.report["settings"]["region"] == [0.25, 0.5, 0.75, 1.0]
    assert "region" not in stage.report["settings"]
    with pytest.raises(SettingsError, match="a region must be left, bottom, right and top"):
        render(path, region=(0.5, 0, 0.5, 1))
