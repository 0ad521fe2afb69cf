"""What pictures that are guided by photons are held to."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.described import render, replicate_means


def assert_mean_is_kept_with_less_noise(scene: Any, guide: Any, samples: int, depth: int) -> None:
    """Assert that pictures with the guide have the mean of those without, and less than 0.8 of their noise."""
    means, noise = [], []
    for caustics in (guide, None):
        pictures = [render(scene, samples, max_depth=depth, seed=s, splits=1, caustics=caustics) for s in range(4)]
        halves = np.concatenate([replicate_means(picture) for picture in pictures])
        means.append(halves.mean(axis=(1, 2)))
        noise.append(halves.std(axis=0).mean())
    error = np.sqrt(sum(m.var(axis=0, ddof=1) / len(m) for m in means))
    assert (np.abs(means[0].mean(axis=0) - means[1].mean(axis=0)) < 4 * error).all()
    assert noise[0] < 0.8 * noise[1]
