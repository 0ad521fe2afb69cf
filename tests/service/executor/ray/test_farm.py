"""Frames in parts on a Ray cluster, without a service, and how the cluster is shown meanwhile.

Before test_jobs.py, which ends the cluster.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.ray.cluster import RunningCluster
from tests.service.losing import KillsUntilLost

import primray
from primray.cli import run
from primray_service.farm.ray_parts import LIMITS, RayParts
from primray_service.farm.ray_stages import RayStages
from primray_service.farm.status import FarmStatus, farm_status

SCENE = Path(__file__).parents[4] / "scenes/features/glass/scene.usda"
SIZE = (48, 36)
TARGET = 0.02


@pytest.fixture(scope="module")
def parts(cluster: RunningCluster) -> Iterator[RayParts]:
    with RayParts(cluster.address, limits=LIMITS) as made:
        yield made


def test_the_bits_of_one_machine_on_two_nodes(parts: RayParts) -> None:
    image = primray.render(SCENE, resolution=SIZE, target_error=TARGET, seed=5, executor=parts)
    one = primray.render(SCENE, resolution=SIZE, target_error=TARGET, seed=5, adaptive=False)
    for name in ("pixels_sha256", "stop", "error", "samples_per_pixel"):
        assert image.report[name] == one.report[name], name
    assert image.report["distribution"]["slots"] == 2


def test_whatever_is_killed(parts: RayParts, cluster: RunningCluster) -> None:
    with KillsUntilLost(parts, cluster.workers) as kills:
        image = primray.render(SCENE, resolution=SIZE, spp=4000, progress=kills, executor=parts)
    assert kills.killed
    assert image.report["distribution"]["lost"] >= 1
    assert image.report["pixels_sha256"] == primray.render(SCENE, resolution=SIZE, spp=4000).report["pixels_sha256"]


def test_what_runs_where(parts: RayParts, cluster: RunningCluster, capsys: pytest.CaptureFixture[str]) -> None:
    found: list[FarmStatus] = []
    asked: dict[str, Any] = {"address": cluster.address, "cores": None, "labels": {}, "allow_unsandboxed": False}

    def look(fraction: float, samples: int, rays: int) -> bool:
        if samples:
            found.append(farm_status(asked))
        return not any(owner["chunks"] for status in found for owner in status.owners)

    with pytest.raises(primray.errors.RenderCancelled):
        primray.render(SCENE, resolution=SIZE, spp=1 << 20, progress=look, executor=parts)
    nodes = {node["id"]: node["slots"] for node in found[-1].nodes}
    assert list(nodes.values()) == [1, 1]
    chunks = [chunk for owner in found[-1].owners for chunk in owner["chunks"]]
    assert {chunk["node"] for chunk in chunks} <= set(nodes)
    assert all(chunk["kind"] == "render" and chunk["name"].startswith("scene.usda ") for chunk in chunks)
    assert run(["farm", "status", "--ray-address", cluster.address, "--json"]) == 0
    assert [node["slots"] for node in json.loads(capsys.readouterr().out)["nodes"]] == [1, 1]


def test_by_the_command(cluster: RunningCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.cli.commands.render.ray_executor", RayParts)
    out, report = tmp_path / "o.exr", tmp_path / "r.json"
    flags = ["--res", "48", "36", "-o", str(out), "--report", str(report), "--spp", "32", "--ray", cluster.address]
    assert run(["render", str(SCENE), *flags]) == 0
    one = primray.render(SCENE, resolution=SIZE, spp=32)
    assert json.loads(report.read_text())["pixels_sha256"] == one.report["pixels_sha256"]


def test_a_contact_sheet_by_the_command(
    cluster: RunningCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("primray.cli.ray_sheets.ray_stages", RayStages)
    library = tmp_path / "library"
    library.mkdir()
    for k in range(4):
        (library / f"{k}.usda").write_text(f'#usda 1.0\ndef Sphere "s"\n{{\n    double radius = {k + 1}\n}}\n')
    flags = ["-o", str(tmp_path / "s.html"), "--imageWidth", "48", "--spp", "4", "--timeout", "600"]
    flags += ["--keep", str(tmp_path / "kept")]
    assert run(["sheet", str(library), *flags, "--ray", cluster.address]) == 0
    rows = json.loads((tmp_path / "s.json").read_text())
    for row in rows:
        one = primray.render(library / row["stage"], resolution=(48, 0), spp=4)
        assert row["report"]["pixels_sha256"] == one.report["pixels_sha256"]
    capsys.readouterr()
    assert run(["sheet", str(library), *flags, "--ray", cluster.address]) == 0
    assert "4 stages, 0 failed, 0 odd, 4 unchanged" in capsys.readouterr().out
