"""Paths guided by what was learnt: the same bits however they are run, the same light, learnt where it is hard to find."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest
from tests.bench.peers.write_plain import write_scene
from tests.bench.peers.write_usd import CAMERA
from tests.bench.stages import indirect
from tests.described import asked, replicate_means

from primray import core
from primray.diagnostics import Diagnostics
from primray.render import open_once, prepare
from primray.report.report import Costs
from primray.settings import RenderSettings

DEPTH = indirect.MAX_DEPTH


@cache
def room(name: str) -> Any:
    """The core's scene of one of the two rooms, small."""
    settings = RenderSettings(resolution=(48, 36), camera="/World/cam", max_depth=DEPTH)
    opened = open_once(indirect.write(Path(mkdtemp()))[name], settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene


def rendered(name: str, spp: int, guide: Any, *, splits: int = 2, lanes: int = 0, threads: int = 2, seed: int = 0) -> Any:
    scene = room(name)
    film = core.Film(scene)
    ends, lanes = core.uniform_ends(film, spp), lanes or core.lanes()
    settings = asked(max_depth=DEPTH, splits=splits, threads=threads, seed=seed, guide=guide)
    core.module().render_pass(scene._scene, film._film, ends, settings, lanes=lanes)
    return film._film


def learnt(name: str, lanes: int = 0) -> Any:
    return core.module().learn_guide(room(name)._scene, asked(max_depth=DEPTH, splits=2), lanes or core.lanes())


def test_a_guide_is_learnt_where_light_is_hard_to_find() -> None:
    guide = learnt("door")
    assert guide is not None
    assert 20 < guide.regions < 5000


def peer_room(name: str, resolution: tuple[int, int], depth: int, folder: Path) -> Any:
    """A compared scene's core scene."""
    write_scene(name, folder)
    settings = RenderSettings(resolution=resolution, camera=CAMERA, max_depth=depth)
    opened = open_once(folder / f"{name}.usdc", settings)
    return prepare(opened.stage, opened.diagnostics, settings, Costs(), Diagnostics()).scene


def noise(scene: Any, depth: int, guide: Any) -> float:
    """As relMSE counts it, of four seeds."""
    found = 0.0
    for seed in range(4):
        film = core.Film(scene)
        settings = asked(max_depth=depth, splits=2, threads=2, seed=seed, guide=guide)
        core.module().render_pass(scene._scene, film._film, core.uniform_ends(film, 32), settings, lanes=core.lanes())
        one, other = replicate_means(film._film)
        found += float(((one - other) ** 2 / ((one + other) ** 2 / 4 + 0.01)).mean())
    return found


def test_a_guide_leads_to_windows(tmp_path: Path) -> None:
    """Half of the error there is direct light of the sky, which rays look for."""
    scene = peer_room("window", (48, 32), 8, tmp_path)
    guide = core.module().learn_guide(scene._scene, asked(max_depth=8, splits=2), core.lanes())
    assert guide is not None
    assert noise(scene, 8, guide) < 0.7 * noise(scene, 8, None)


def test_a_guide_that_gains_a_fifth_is_used(tmp_path: Path) -> None:
    """Among mesh lights a fifth of the error is direct light; one pair of pilots in four says that no guide pays there."""

    def is_used(size: tuple[int, int]) -> bool:
        found = core.module().learn_guide(
            peer_room("signs", size, 6, tmp_path)._scene, asked(max_depth=6, splits=1), core.lanes()
        )
        return found is not None

    assert sum(map(is_used, ((480, 320), (472, 320), (480, 312)))) >= 2
    scene = peer_room("signs", (96, 64), 6, tmp_path)
    guide = core.module().learn_guide(scene._scene, asked(max_depth=6, splits=1), core.lanes())
    assert guide is not None
    assert noise(scene, 6, guide) < 0.9 * noise(scene, 6, None)


def test_paths_go_on_by_what_they_are_expected_to_bring() -> None:
    """The guide's directions alone leave 0.65 of the error; with roulette by expected light it is 0.29."""

    def error(use: Any) -> float:
        means = [replicate_means(rendered("door", 64, use, seed=seed)) for seed in range(4)]
        return float(np.mean([(one - other) ** 2 for one, other in means]))

    assert error(learnt("door")) < 0.45 * error(None)


def test_bits_do_not_depend_on_lanes_or_threads() -> None:
    guides = {lanes: learnt("door", lanes) for lanes in (1, core.lanes())}
    runs = [(1, core.lanes(), 2), (1, 1, 1), (core.lanes(), 1, 3), (core.lanes(), core.lanes(), 1)]  # guide's, lanes, threads
    images = {rendered("door", 20, guides[g], lanes=w, threads=t).replicates.tobytes() for g, w, t in runs}
    assert len(images) == 1
    assert rendered("door", 20, None).replicates.tobytes() not in images


def test_a_pass_in_two_parts_has_the_same_bits() -> None:
    scene, guide = room("door"), learnt("door")
    film = core.Film(scene)
    for spp in (32, 70):
        ends = core.uniform_ends(film, spp)
        settings = asked(max_depth=DEPTH, splits=2, threads=2, guide=guide)
        core.module().render_pass(scene._scene, film._film, ends, settings, lanes=core.lanes())
    np.testing.assert_array_equal(film._film.replicates, rendered("door", 70, guide).replicates)


@pytest.mark.parametrize("splits", [1, pytest.param(4, marks=pytest.mark.long)])
def test_guided_paths_bring_the_same_light(splits: int) -> None:
    """Means of 4 x 3 parts of the picture, by 5 of their standard errors from 8 pairs of replicates; they are a few percent."""
    guide = learnt("door")

    def parts(use: Any) -> Any:
        means = np.concatenate(
            [replicate_means(rendered("door", 64, use, splits=splits, seed=seed)).mean(axis=-1) for seed in range(8)]
        )
        return means.reshape(16, 3, 12, 4, 12).mean(axis=(2, 4))

    a, b = parts(guide), parts(None)
    error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / 15)
    assert np.median(error / b.mean(axis=0)) < 0.05
    assert np.all(np.abs(a.mean(axis=0) - b.mean(axis=0)) < 5 * error)
    assert a.var(axis=0).mean() < 0.8 * b.var(axis=0).mean()  # what it is for


def test_more_is_learnt_for_pictures_that_take_longer(tmp_path: Path) -> None:
    def learn(resolution: tuple[int, int], lanes: int) -> tuple[Any, Any]:
        scene = peer_room("ajar", resolution, 10, tmp_path)
        return scene, core.module().learn_guide(scene._scene, asked(max_depth=10, splits=2), lanes)

    def picture(scene: Any, guide: Any) -> bytes:
        film = core.Film(scene)
        settings = asked(max_depth=10, splits=2, threads=2, guide=guide)
        core.module().render_pass(scene._scene, film._film, core.uniform_ends(film, 2), settings, lanes=core.lanes())
        return bytes(film._film.replicates.tobytes())

    scene, guide = learn((288, 192), core.lanes())
    little = learn((48, 32), core.lanes())[1]
    assert guide.regions > 1.2 * little.regions
    assert guide.share > little.share == 0.5
    assert picture(scene, guide) == picture(scene, learn((288, 192), 4)[1])


def test_a_guide_does_not_depend_on_the_unit_of_light(tmp_path: Path) -> None:
    """In a room that is 250 times darker, pilots see the same errors."""
    scene = peer_room("ajar", (96, 64), 10, tmp_path)
    guide = core.module().learn_guide(scene._scene, asked(max_depth=10, splits=2), core.lanes())
    assert guide is not None
    film = core.Film(scene)
    core.module().render_pass(
        scene._scene, film._film, core.uniform_ends(film, 4), asked(max_depth=10, splits=2), lanes=core.lanes()
    )
    assert replicate_means(film._film).mean() < 0.01


def test_paths_to_be_chosen_are_chosen() -> None:
    assert core.module().learn_guide(room("door")._scene, asked(max_depth=DEPTH, splits=0), core.lanes()) is not None


@pytest.mark.parametrize("bin", [None, 5])
def test_rays_that_mostly_follow_a_guide_bring_the_same_light(bin: int | None, tmp_path: Path) -> None:
    """One that has learnt for a larger picture has more than half of them; a guide that is wrong everywhere is only slower."""
    large, small = (peer_room("window", size, 8, tmp_path) for size in ((720, 480), (48, 32)))
    guide = core.module().learn_guide(large._scene, asked(max_depth=8, splits=2), core.lanes())
    assert 0.55 < guide.share < 0.7
    if bin is not None:
        core.module().testing.put_all_in_bin(guide, bin)

    def parts(use: Any) -> Any:
        means = []
        for seed in range(8):
            film = core.Film(small)
            settings = asked(max_depth=8, splits=2, threads=2, seed=seed, guide=use)
            core.module().render_pass(small._scene, film._film, core.uniform_ends(film, 64), settings, lanes=core.lanes())
            means.append(replicate_means(film._film).mean(axis=-1))
        return np.concatenate(means).reshape(16, 2, 16, 3, 16).mean(axis=(2, 4))

    a, b = parts(guide), parts(None)
    error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / 15)
    assert np.median(error / b.mean(axis=0)) < 0.08
    assert np.all(np.abs(a.mean(axis=0) - b.mean(axis=0)) < 5 * error)


def test_replicates_that_share_a_guide_are_independent() -> None:
    """Mean rank correlation of 4 x 3 parts of the picture over 400 renders; its standard error is 0.015."""
    guide = learnt("door")
    films = [replicate_means(rendered("door", 2, guide, seed=seed)).mean(axis=-1) for seed in range(400)]
    parts = np.stack(films).reshape(400, 2, 3, 12, 4, 12).mean(axis=(3, 5)).reshape(400, 2, 12)
    ranks = parts.argsort(axis=0).argsort(axis=0)
    assert abs(np.mean([np.corrcoef(ranks[:, 0, k], ranks[:, 1, k])[0, 1] for k in range(12)])) < 0.05
