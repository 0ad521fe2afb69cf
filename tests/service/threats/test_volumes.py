"""Stages with OpenVDB files: packages bring them, files that are not there are named, and broken ones do no harm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests import vdb_writer as vdb
from tests.service.threats.fates import Canary, Fate, fate, package, usda, usdz
from tests.unit.usd.volumes.volume_text import grid, volume_text
from tests.unit.volumes.test_vdb_file_damaged import damaged

ROOM = """
def Camera "cam" { double3 xformOp:translate = (3.5, 3.5, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def DomeLight "sky" { }
"""
SMOKE = vdb.vdb_bytes([grid(0.25)])
STAGE = usda(ROOM + volume_text())


def rendered(found: Fate) -> dict[str, Any]:
    assert found.end == "succeeded", (found.problem, found.said[-6000:])
    return found.job


@pytest.mark.parametrize("pack", [package, usdz])
def test_packages_bring_their_files(pack: Any, client: Any) -> None:
    found = fate(client, pack({"root.usda": STAGE, "smoke.vdb": SMOKE}))
    rendered(found)
    assert "volume-convention" in found.warnings
    assert not {"asset-missing", "asset-not-uploaded", "volume-field"} & set(found.warnings)


def test_a_file_that_was_not_uploaded_is_named(client: Any) -> None:
    found = fate(client, usda(ROOM + volume_text() + 'def Sphere "ball" { }'))
    rendered(found)
    [missing] = [w for w in found.job["warnings"] + found.scene["warnings"] if w["code"] == "asset-missing"][:1]
    assert "smoke.vdb" in missing["detail"]
    assert missing["prim"] == "/Smoke/density"


def test_a_file_outside_is_refused(client: Any, canary: Canary) -> None:
    (canary.folder / "secret.vdb").write_bytes(SMOKE)
    text = volume_text().replace("./smoke.vdb", canary.path("secret.vdb"))
    found = fate(client, package({"root.usda": usda(ROOM + text)}))
    assert found.slug == "asset-path-outside-job"
    canary.never_sang(found)


def test_broken_files_do_no_harm(client: Any) -> None:
    """Sixteen fields in one stage, each with damage of its own."""
    rng = np.random.default_rng(1)
    files: dict[str, str | bytes] = {f"{k}.vdb": damaged(SMOKE, rng) for k in range(16)}
    files["head.vdb"], files["empty.vdb"], files["zeros.vdb"] = SMOKE[:100], b"", bytes(100_000)
    text = "".join(volume_text().replace("smoke.vdb", name).replace('"Smoke"', f'"Smoke{k}"') for k, name in enumerate(files))
    found = fate(client, package({"root.usda": usda(ROOM + text + 'def Sphere "ball" { }'), **files}))
    rendered(found)
    assert "volume-field" in found.warnings


def test_a_grid_that_is_larger_than_memory(client: Any) -> None:
    """Four billion voxels by the tree, in a file of some kilobytes."""
    tile = vdb.Grid(name="density", tiles=[vdb.Tile((0, 0, 0), 4096, 1.0)])
    found = fate(client, package({"root.usda": STAGE, "smoke.vdb": vdb.vdb_bytes([tile])}))
    assert found.end in ("succeeded", "failed"), found.problem
