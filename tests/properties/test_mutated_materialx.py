"""Whatever is wrong with a document, nothing crashes or hangs: the stage opens, translates, and says what is not there."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from tests.properties.mutated_materialx import GOOD, STAGE, mutated

from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate


def check(folder: Path, seeds: range) -> None:
    (folder / "scene.usda").write_text(STAGE)
    for seed in seeds:
        text = mutated(GOOD, seed)
        (folder / "looks.mtlx").write_bytes(text.encode("utf-8", "surrogatepass"))
        began = time.process_time()
        diagnostics = Diagnostics()
        stage = open_stage(folder / "scene.usda", diagnostics)
        description, told = translate(stage, RenderSettings())
        assert len(description.shapes) == 2, seed
        assert all(d.message and "Traceback" not in d.message for d in (*diagnostics, *told)), seed
        lost = {"/Looks/M", "/Looks/P"} - {surface.path for surface in description.surfaces}
        assert not lost or any(d.severity.value != "info" for d in (*diagnostics, *told)), (seed, lost)
        assert time.process_time() - began < 10, seed


def test_a_hundred(tmp_path: Path) -> None:
    check(tmp_path, range(100))


@pytest.mark.long
def test_two_thousand(tmp_path: Path) -> None:
    check(tmp_path, range(100, 2100))
