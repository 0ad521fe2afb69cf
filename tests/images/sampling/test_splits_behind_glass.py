"""Paths split at the first surface that is not smooth: behind panes and bodies of glass too."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    perspective,
    render,
    replicate_means,
    rotation,
    translation,
)

from primray.description import Doubles, LightType, Shape, Sphere, Surface

DOWN = rotation((1, 0, 0), -90)
PANE = Surface("/pane", opacity=0.0, roughness=0.0, thin=True, diffuse_color=(1, 1, 1))
GLASS = Surface("/glass", opacity=0.0, roughness=0.0, ior=1.3, diffuse_color=(1, 1, 1))


def room(cover: str) -> Described:
    """A corner below a large lamp, which the camera sees through what covers it."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (ground(6.0), translation(0, 0, -2) @ rotation((1, 0, 0), 90)),
    ]
    surfaces = [lambert(0.6), PANE, GLASS]
    before = translation(0, 1.4, 5.5) @ rotation((1, 0, 0), 90)
    if cover == "pane":
        shapes.append((ground(2.0, 1), before))
    if cover == "body":
        shapes.append((Sphere("/lens", 1.0, 2), translation(0, 1.4, 4.2)))
    lamp = light(LightType.RECT, translation(0, 5, 0) @ DOWN, 5.0, width=3.0, height=3.0)
    return describe(shapes, surfaces, [lamp], perspective(look_at([0, 1.5, 6], [0, 1, 0]), 0.35), (16, 16))


def noise(scene: Described, splits: int) -> float:
    """Relative standard deviation of the pixels' replicates."""
    halves = np.concatenate([replicate_means(render(scene.build(), 64, max_depth=6, seed=s, splits=splits)) for s in range(6)])
    return float(np.median(halves.std(axis=0, ddof=1) / halves.mean(axis=0)))


@pytest.mark.parametrize("cover", ["pane", "body"])
def test_splits_gain_behind_it(cover: str) -> None:
    """Glass mirrors some paths away, so that eight paths gain less than the factor of 3.6 that they do without it."""
    assert noise(room(cover), splits=1) / noise(room(cover), splits=8) > 1.4  # 1.6; 1.02 where glass splits none


@pytest.mark.parametrize("cover", ["pane", "body"])
def test_the_mean_and_the_bits_stay(cover: str) -> None:
    scene = room(cover).build()
    split = [render(scene, 512, max_depth=6, splits=8, light_samples=2, seed=s) for s in range(4)]
    whole = [render(scene, 512, max_depth=6, splits=1, seed=s + 9) for s in range(4)]
    a, b = (np.concatenate([replicate_means(x) for x in films]).mean(axis=(1, 2, 3)) for films in (split, whole))
    assert abs(a.mean() - b.mean()) < 5 * np.sqrt((a.var() + b.var()) / 7)
    assert abs(a.mean() / b.mean() - 1) < 0.01
    found = {
        render(scene, 24, max_depth=6, splits=8, light_samples=2, lanes=lanes, threads=threads).replicates.tobytes()
        for lanes, threads in ((0, 1), (1, 2), (4, 3))
    }
    assert len(found) == 1
