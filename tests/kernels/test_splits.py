"""How many paths go on from the first surface, and samples of lights are taken there: as pilots say that the error is worth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.bench.peers.grooms import groom
from tests.bench.peers.scene import Camera, Lamp, Look, Scene
from tests.bench.peers.scenes import cove
from tests.bench.peers.shapes import ball, rectangle
from tests.bench.peers.write_usd import CAMERA, write_usd

from primray import core
from primray.core.native import module
from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings


def balls(radiance: float) -> Scene:
    """On open ground under a large lamp: most of the error is edges of shadows, which every path from the camera sees anew."""
    scene = Scene("balls", (640, 360), 2, Camera((0, 2.3, 7.6), (0, 0.5, 0), 52.0))
    scene.looks = {"ground": Look("diffuse", (0.5, 0.5, 0.5)), "red": Look("diffuse", (0.7, 0.2, 0.2))}
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 30), (30, 0, 0)), "ground")
    for k in range(5):
        scene.add(f"ball_{k}", ball(5, 0.6, (1.45 * (k - 2), 0.6, 0), smooth=True), "red")
    scene.lamps = [Lamp("rect", (radiance,) * 3, (3, 5, 3), (1, 0, 0), (0, 0, 1))]
    return scene


def built(scene: Scene, folder: Path) -> tuple[core.CoreScene, RenderSettings]:
    path = folder / "scene.usdc"
    write_usd(scene, path)
    settings = RenderSettings(resolution=scene.resolution, camera=CAMERA, max_depth=scene.depth)
    opened = open_once(path, settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene, settings


def chosen(scene: Scene, folder: Path) -> core.Splits:
    return core.choose_splits(*built(scene, folder))


def test_a_scene_that_stays_asks_its_pilot_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For each depth: what another depth found is not taken for it; and anew for a quick look."""
    scene, settings = built(cove(), tmp_path)
    asked: list[int] = []
    pilot = module().choose_splits

    def counting(of: Any, how: Any, lanes: int) -> Any:
        asked.append(how.max_depth)
        return pilot(of, how, lanes)

    monkeypatch.setattr(module(), "choose_splits", counting)
    found = [core.choose_splits(scene, settings) for _ in range(2)]
    direct = core.choose_splits(scene, replace(settings, max_depth=1))
    assert found == [(8, 1), (8, 1)]
    assert direct != found[0]
    assert asked == [settings.max_depth, 1]
    assert core.choose_splits(scene, replace(settings, spp=1)) == (1, 1)
    scene.forget_guides()
    assert core.choose_splits(scene, settings) == (8, 1)
    assert asked == [settings.max_depth, 1, settings.max_depth]


def test_edges_of_shadows_count(tmp_path: Path) -> None:
    """Which samples of lights divide: 2 paths and one sample take 2.2 times as long to an error, 8 paths and one 4.4 times."""
    assert chosen(balls(30.0), tmp_path) == (4, 4)


def test_indirect_light_is_split(tmp_path: Path) -> None:
    """Of pilots that err by rare bright paths each in its own way."""
    assert chosen(cove(), tmp_path) == (8, 1)


def test_what_is_not_lit_is_not_split(tmp_path: Path) -> None:
    scene = balls(1.0)
    scene.lamps = [Lamp("rect", (1.0, 1.0, 1.0), (3, -5, 3), (1, 0, 0), (0, 0, 1))]  # below the ground
    assert chosen(scene, tmp_path) == (1, 1)


def test_paths_from_hair_do_not_split(tmp_path: Path) -> None:
    """Pilots would split them. And no guide is learnt where hair has all of the error."""
    scene, settings = built(groom(count=4000, radius=0.006), tmp_path)
    splits = core.choose_splits(scene, settings)
    assert splits == core.Splits(1, 1)
    assert scene.guide(settings, splits) is None
