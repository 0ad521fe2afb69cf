"""Comparison of renders: no more false alarms than asked for on any scene, and changes of scenes found.

Significance: false alarms are counted against the binomial distribution of a rate alpha, at 1e-4.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.compared_scenes import CHANGES, room, scenes
from tests.measured import BuiltScene

from primray import RenderSettings
from primray.compare.comparison import Comparison, Verdict, compare

ALPHAS = (0.05, 0.01)
SAMPLES = ((8, 8), (16, 16), (64, 64), (8, 64), (16, 512))  # of A and of B
SCENES = dict(scenes())


@cache
def built(name: str, width: int) -> BuiltScene:
    return BuiltScene(SCENES[name], RenderSettings(resolution=(width, width * 2 // 3)))


@cache
def built_room(change: str | None) -> BuiltScene:
    changes: dict[str, Any] = CHANGES[change] if change else {}
    return BuiltScene(room(**changes), RenderSettings(resolution=(64, 48), threads=2))


def least_p(comparison: Comparison) -> float:
    findings = [comparison.finding, *(tile.finding for tile in comparison.tiles)]
    return min((finding.p for finding in findings if finding is not None), default=1.0)


def most_alarms(pairs: int, alpha: float, significance: float = 1e-4) -> int:
    """The least number that so many pairs exceed with a probability of at most `significance`."""
    tail, k = 1.0, 0
    while True:
        tail -= math.comb(pairs, k) * alpha**k * (1 - alpha) ** (pairs - k)
        if tail <= significance:
            return k
        k += 1


def alarms(width: int, pairs: int) -> tuple[int, list[tuple[float, str]]]:
    """Of `pairs` of every scene and sampling: how many there were, and p and case of those below the larger alpha."""
    found, count = [], 0
    for name in SCENES:
        for a, b in SAMPLES:
            for pair in range(pairs):
                seed = 1 + 2 * pair
                images = built(name, width).render(seed, a), built(name, width).render(seed + 1, b)
                p = least_p(compare(*images, alpha=max(ALPHAS), tolerance=0))
                count += 1
                if p <= max(ALPHAS):
                    found.append((p, f"{name} {a} {b} seed {seed}"))
    return count, found


def check_alarms(count: int, found: list[tuple[float, str]]) -> None:
    for alpha in ALPHAS:
        these = [case for p, case in found if p <= alpha]
        assert len(these) <= most_alarms(count, alpha), f"{len(these)} of {count} at {alpha}: {these}"


def test_false_alarms() -> None:
    check_alarms(*alarms(width=24, pairs=4))


@pytest.mark.long
def test_false_alarms_of_many_pairs() -> None:
    count, found = alarms(width=48, pairs=50)
    print(f"{count} pairs, p and case of alarms at 0.05: {found}")
    assert count >= 1000
    check_alarms(count, found)


@pytest.mark.parametrize("change", CHANGES)
def test_changes_are_found(change: str) -> None:
    """At enough samples; at few the noise may hide them, but never is the picture said to be unchanged."""
    many = compare(built_room(None).render(1, 512), built_room(change).render(2, 512))
    assert many.verdict is Verdict.CHANGED
    few = compare(built_room(None).render(3, 4), built_room(change).render(4, 4))
    assert few.verdict in (Verdict.CHANGED, Verdict.UNDECIDED)


def decides(scene: BuiltScene, seed: int, spp: float, tolerance: float) -> bool:
    images = (scene.render(seed + k, 2 * round(spp / 2)) for k in (2, 3))
    return compare(*images, tolerance=tolerance).verdict is not Verdict.UNDECIDED


def test_the_samples_asked_for_decide() -> None:
    """And a third of them do not: the room, where it takes some six times the pilot's 4."""
    first = compare(built_room(None).render(1, 4), built_room(None).render(2, 4))
    assert first.needs is not None
    assert first.needs.a is not None
    assert decides(built_room(None), 1, 4 + first.needs.a, 0.01)
    assert not decides(built_room(None), 1, (4 + first.needs.a) / 3, 0.01)


@pytest.mark.long
def test_samples_asked_for_in_many_renders() -> None:
    """Scenes without rare bright paths, tolerances that take 2 to 6 times the pilot's 32 samples.

    1.5 times the number decides nearly always; 1 / 1.5 of it seldom, or it would be too cautious: beyond the noise of the
    pilot, quasi-random points do better than the 1 / samples that it goes by.
    """
    # The last has reflections of a small light that a pilot of 32 samples knows badly.
    for name, nearly, mostly in (("room", 0.85, 0.6), ("emission", 0.85, 0.6), ("clearcoat", 0.6, 0.3)):
        scene, counts = built(name, 48), {1 / 1.5: 0, 1.0: 0, 1.5: 0}
        pilot = compare(scene.render(1, 32), scene.render(2, 32))
        worst = max(tile.resolution for tile in pilot.tiles)
        cases = [(seed, worst / np.sqrt(times)) for seed in range(11, 131, 10) for times in (2, 4)]
        asked = 0
        for seed, tolerance in cases:
            needs = compare(scene.render(seed, 32), scene.render(seed + 1, 32), tolerance=tolerance).needs
            if needs is None or needs.a is None:
                continue
            asked += 1
            for factor in counts:
                counts[factor] += decides(scene, seed, factor * (32 + needs.a), tolerance)
        print(f"{name}: of {asked}, decided by a factor of the samples asked for: {counts}")
        assert asked >= 20
        assert counts[1.5] >= nearly * asked
        assert counts[1.0] >= mostly * asked
        assert counts[1 / 1.5] <= 0.5 * asked


def test_an_unchanged_room() -> None:
    comparison = compare(built_room(None).render(1, 512), built_room(None).render(2, 512))
    assert comparison.verdict is Verdict.UNCHANGED
