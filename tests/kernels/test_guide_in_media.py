"""Paths guided inside media by what was learnt there: the same bits however they are run, the same light with less noise."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.described import asked, replicate_means
from tests.kernels.foggy_room import DEPTH, room

from primray import core

SPLITS = 2


@cache
def learnt(lanes: int = 0) -> Any:
    return core.module().learn_guide(room()._scene, asked(max_depth=DEPTH, splits=SPLITS), lanes or core.lanes())


def rendered(
    spp: int, guide: Any, *, lanes: int = 0, threads: int = 2, seed: int = 0, depth: int = DEPTH, before: tuple[int, ...] = ()
) -> Any:
    scene = room()
    film = core.Film(scene)
    settings = asked(max_depth=depth, splits=SPLITS, threads=threads, seed=seed, guide=guide)
    for end in (*before, spp):
        ends = core.uniform_ends(film, end)
        core.module().render_pass(scene._scene, film._film, ends, settings, lanes=lanes or core.lanes())
    return film._film


@cache
def pictures(guide: Any, depth: int = DEPTH) -> Any:
    """Both replicates of 8 seeds, without colours."""
    films = [rendered(32, guide, seed=seed, depth=depth) for seed in range(8)]
    return np.concatenate([replicate_means(film).mean(axis=-1) for film in films])


def cells(guide: Any, depth: int = DEPTH) -> Any:
    """Means of 4 x 3 parts of these pictures."""
    return pictures(guide, depth).reshape(16, 3, 12, 4, 12).mean(axis=(2, 4))


def noise(guide: Any) -> float:
    """Variance of pixels relative to their squared means."""
    found = pictures(guide)
    return float((found.var(axis=0) / (found.mean(axis=0) ** 2 + 0.01 * found.mean() ** 2)).mean())


def errors_of_mean(a: Any, b: Any) -> Any:
    """Differences of means in their standard errors."""
    return (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt((a.var(axis=0) + b.var(axis=0)) / 15)


def test_a_guide_learns_inside_media() -> None:
    assert learnt() is not None
    inside = core.module().testing.regions_inside_media(learnt())
    assert 10 < inside < learnt().regions


def test_bits_do_not_depend_on_lanes_or_threads() -> None:
    guides = {lanes: learnt(lanes) for lanes in (1, core.lanes())}
    runs = [(1, core.lanes(), 2), (1, 1, 1), (core.lanes(), 1, 3), (core.lanes(), core.lanes(), 1)]  # guide's, lanes, threads
    images = {rendered(12, guides[g], lanes=w, threads=t).replicates.tobytes() for g, w, t in runs}
    assert len(images) == 1
    assert rendered(12, None).replicates.tobytes() not in images


def test_a_pass_in_two_parts_has_the_same_bits() -> None:
    whole = rendered(48, learnt()).replicates
    np.testing.assert_array_equal(rendered(48, learnt(), before=(20,)).replicates, whole)


def test_guided_paths_bring_the_same_light_with_less_noise() -> None:
    a, b = cells(learnt()), cells(None)
    error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / 15)
    assert np.median(error / b.mean(axis=0)) < 0.05
    assert np.all(np.abs(errors_of_mean(a, b)) < 5)
    assert noise(learnt()) < 0.8 * noise(None)  # what it is for


@pytest.mark.parametrize("bin", [0, 131])
def test_a_guide_that_is_wrong_everywhere_brings_the_same_light(bin: int) -> None:
    wrong = core.module().learn_guide(room()._scene, asked(max_depth=DEPTH, splits=SPLITS), core.lanes())
    core.module().testing.put_all_in_bin(wrong, bin)
    assert np.all(np.abs(errors_of_mean(cells(wrong, 4), cells(None, 4))) < 5)
