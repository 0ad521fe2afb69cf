"""Stages of scenes/analytic show, rendered from their files, the radiance that they say."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

import primray

FOLDER = Path(__file__).parents[2] / "scenes" / "analytic"
TOLD = re.compile(r"radiance there ([0-9.]+?)\.? ")
STAGES = {path.stem: path for path in sorted(FOLDER.glob("*.usda")) if TOLD.search(path.read_text())}


def test_most_stages_say_what_they_show() -> None:
    assert len(STAGES) > 12


@pytest.mark.parametrize("name", STAGES)
def test_radiance(name: str) -> None:
    """All pixels see the same point, so that their spread is the error of one."""
    stage = Usd.Stage.Open(str(STAGES[name]))
    said = TOLD.search(stage.GetMetadata("documentation"))
    assert said is not None
    frame = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    seen = primray.render(stage, spp=256, max_depth=1, time_code=frame).pixels[..., :3].astype(np.float64)
    each = seen.mean(axis=2)
    error = 5 * each.std() / np.sqrt(each.size)
    assert abs(each.mean() / float(said[1]) - 1) < error / float(said[1]) + 5e-5
    assert error < 0.01 * float(said[1])
