"""Whether times are even is decided once: what the seam says, the core knows."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import kernels, render, translation
from tests.images.motion.motion_scenes import alone, box_average, deforming, instanced, moving, profile, square

from primray.core.scene import inverse_cdf
from primray.core.scene_upload import upload
from primray.description.motion import SAME_TIME, handed_over, is_uniform
from primray.settings import Filter

COUNTS = (2, 3, 4, 8, 11, 30, 129, 500, 1001)


def even(count: int) -> np.ndarray:
    return np.arange(count) / (count - 1)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1e-8, 5e-8, 2e-7, 1e-6, 1e-5, 1e-3])
def test_the_core_knows_what_the_seam_says(count: int, size: float) -> None:
    """However far off times are, and however many there are: the core's own rounding decides nothing."""
    times = even(count)
    times[1:-1] += np.random.default_rng(count).uniform(-1, 1, count - 2) * min(size, 0.2 / count)
    off = float(np.abs(times - even(count)).max())
    assert is_uniform(times) == (off < SAME_TIME)
    given = handed_over(times)
    assert kernels().is_even_clock(given) == is_uniform(times)
    np.testing.assert_allclose(given, times, atol=2e-7)


def test_one_time_is_no_clock() -> None:
    assert not is_uniform([0.0])
    assert not is_uniform([])


def curved(times: np.ndarray) -> np.ndarray:
    """Where something is that starts from rest."""
    return np.asarray(4 * times**2 - 2)


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("count", [3, 65, 129, 301, 1001])
def test_meshes_may_have_any_number_of_times(count: int, uneven: bool) -> None:
    """More than Embree takes are made fewer, which is told; what is seen is where they are."""
    times = even(count) ** 1.5 if uneven else even(count)
    shape = square()
    steps = [shape.points + np.array([x, 0, 0]) for x in curved(times).tolist()]
    made = alone(deforming(shape, steps, times.tolist()))
    scene, warnings, _ = upload(made.description, {}, 1.0, inverse_cdf(Filter.BOX, 1.0))
    assert [code for code, _, _ in warnings] == (["motion"] if count > 129 else [])
    found = render(scene, 2048).pixels()[..., 3].mean(axis=0)
    path = np.interp(middles(2000), times, curved(times))
    expected = box_average(lambda x: (np.abs(x[:, None] - path) < 1).mean(axis=1))
    np.testing.assert_allclose(found, expected, atol=0.02)


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("count", [129, 301, 1001])
def test_instances_may_have_any_number_of_times(count: int, turns: bool) -> None:
    times = even(count)
    level = moving([translation(x, 0, 0) for x in curved(times).tolist()], times.tolist(), turns=turns)
    found = profile(instanced(square(), level), 2048)
    path = curved(middles(2000))
    expected = box_average(lambda x: (np.abs(x[:, None] - path) < 1).mean(axis=1))
    np.testing.assert_allclose(found, expected, atol=0.02)


def middles(count: int) -> np.ndarray:
    return (np.arange(count) + 0.5) / count
