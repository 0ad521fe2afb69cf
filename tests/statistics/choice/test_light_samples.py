"""More samples of lights at the first surface: the same light, less noise, the same bits whatever shares a packet."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    quad,
    render,
    replicate_means,
    rotation,
    translation,
)

from primray.description import Doubles, LightType, Shadow, Surface

SPP, SEEDS = 64, 6
PLASTIC = Surface("/a", roughness=0.3, diffuse_color=(0.5, 0.2, 0.2))


def room(surface: Surface, *, lights: int = 2, special: bool = False) -> Any:
    """Ground under a lamp and a sun, in the half shadow of a roof."""
    down = rotation([1, 0, 0], -90)
    lamps = [light(LightType.RECT, translation(0.2, 1.5, 0) @ down, 8.0, width=0.8, height=0.8)]
    lamps += [light(LightType.DISTANT, rotation([1, 0, 0], -60), 2.0, angle_deg=3.0)][: lights - 1]
    if special:
        lamps = [replace(lamp, shadow=Shadow(color=(0.2, 0.4, 0.6))) for lamp in lamps]
    roof = quad([(-0.3, 0.5, -0.3), (-0.3, 0.5, 0.3), (0.3, 0.5, 0.3), (0.3, 0.5, -0.3)], 1)
    d = describe(
        [(ground(3), np.eye(4)), (roof, np.eye(4))],
        [surface, lambert(0.0)],
        lamps,
        orthographic(look_at([0, 0.4, 0], [0, 0, 0], up=(0, 0, -1)), 1.0),
        (24, 24),
    )
    return d.build()


def pictures(scene: Any, light_samples: int) -> Doubles:
    """(2 SEEDS, H, W, C): replicates."""
    how: dict[str, Any] = {"max_depth": 1, "threads": 2, "splits": 1, "light_samples": light_samples}
    return np.concatenate([replicate_means(render(scene, SPP, seed=seed, **how)) for seed in range(SEEDS)])


def check_the_same(one: Doubles, more: Doubles, light_samples: int) -> None:
    of_frame = [p.mean(axis=(1, 2, 3)) for p in (one, more)]
    error = np.sqrt(sum(m.var(ddof=1) for m in of_frame) / (2 * SEEDS))
    assert error < 1e-3 * of_frame[0].mean()
    # Student's t with 11 degrees of freedom and more: 5.5 and 7 are exceeded by 1 of 5,000 and of 40,000 values.
    assert abs(of_frame[1].mean() - of_frame[0].mean()) < 5.5 * error
    error = np.sqrt((one.var(axis=0) + more.var(axis=0)) / (2 * SEEDS - 1))
    assert (np.abs(more.mean(axis=0) - one.mean(axis=0)) <= 7 * error + 1e-6).mean() > 0.998
    assert more.var(axis=0).mean() < 1.6 / light_samples * one.var(axis=0).mean()


@pytest.mark.parametrize("surface", [lambert(0.5), PLASTIC], ids=["matte", "plastic"])
@pytest.mark.parametrize("light_samples", [2, 4])
def test_the_same_light_with_less_noise(surface: Surface, light_samples: int) -> None:
    scene = room(surface)
    check_the_same(pictures(scene, 1), pictures(scene, light_samples), light_samples)


def test_special_shadows_are_divided_as_well() -> None:
    scene = room(lambert(0.5), special=True)
    check_the_same(pictures(scene, 1), pictures(scene, 4), 4)


def test_bits_depend_on_no_lanes_threads_or_passes() -> None:
    scene = room(PLASTIC)

    def picture(spp: int = 40, **how: Any) -> Any:
        return render(scene, spp, max_depth=3, splits=2, light_samples=4, **how).pixels()

    whole = picture()
    np.testing.assert_array_equal(picture(lanes=1), whole)
    np.testing.assert_array_equal(picture(threads=2), whole)
    begun = render(scene, 16, max_depth=3, splits=2, light_samples=4)
    np.testing.assert_array_equal(picture(film=begun.film), whole)


def test_so_many_rays_are_traced() -> None:
    scene = room(lambert(0.5), lights=1)
    rays = [render(scene, 16, max_depth=1, splits=1, light_samples=n).shadow_rays for n in (1, 4)]
    assert rays[1] == pytest.approx(4 * rays[0], rel=0.02)


def test_numbers_that_there_are_not() -> None:
    for wrong in (0, 5):
        with pytest.raises(ValueError, match="light_samples"):
            render(room(PLASTIC), 2, splits=1, light_samples=wrong)
