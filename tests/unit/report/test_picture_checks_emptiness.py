"""Why nothing is drawn: an image that a light lacks is no geometry that is missing."""

from __future__ import annotations

from pathlib import Path

import primray

STAGE = """#usda 1.0
def DomeLight "sky" {
    asset inputs:texture:file = @none.exr@
}
"""


def test_a_texture_that_is_missing_is_no_missing_geometry(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(STAGE)
    image = primray.render(str(tmp_path / "a.usda"), resolution=(8, 6), spp=1)
    codes = [d["code"] for d in image.report["diagnostics"]]
    assert "asset-missing" in codes
    assert "empty-picture" not in codes  # a sky alone is what the stage has
