"""Below `class`, `over` and `def` twins of a library the same is seen: prims are led to, whatever keeps them from the world."""

from __future__ import annotations

import pytest
from pxr import Usd

from primray.settings import RenderSettings
from primray.usd import translate

from ..translation.describe import describe
from .random_libraries import HOLDERS, stage_text


def described(seed: int, kind: str, time: float | None) -> str:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(stage_text(seed, kind))
    description, diagnostics = translate(stage, RenderSettings(time_code=time))
    return describe(description, diagnostics, "/none/")


@pytest.mark.parametrize("time", [None, 5.0])
@pytest.mark.parametrize("seed", range(24))
def test_twins_are_described_alike(seed: int, time: float | None) -> None:
    expected = described(seed, "def", time)
    for kind in HOLDERS:
        assert described(seed, kind, time) == expected, kind


def test_the_stages_have_what_may_go_wrong() -> None:
    texts = [described(seed, "def", 5.0) for seed in range(24)]
    for what in (" posed /Lib/", '"exposure": {', '"PrimvarInput"', '"lights": [\n   {', '"kind": "Sphere"'):
        assert any(what in text for text in texts), what
