"""What no lens does is refused."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import pytest

from primray.camera import camera_as_json, camera_of
from primray.lens.diffusion import NO_DIFFUSION, Diffusion, diffusion_of

from ..conftest import make_camera


@pytest.mark.parametrize(
    "values",
    [
        {"strength": 1.1},
        {"strength": float("nan")},
        {"glare": -0.1},
        {"glare": 0.6, "starburst": 0.6},
        {"bloom_width": 0.0},
        {"starburst_width": float("inf")},
        {"blades": 2},
        {"blades": -3},
        {"blade_rotation_deg": float("nan")},
    ],
)
def test_what_no_lens_does(values: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(values))):
        Diffusion(**values)


def test_it_comes_back_from_json() -> None:
    some = Diffusion(0.2, 0.1, 0.01, 0.4, 0.002, 7, 12.0)
    assert diffusion_of(asdict(some)) == some
    camera = replace(make_camera(), diffusion=some)
    assert camera_of(camera_as_json(camera)) == camera
    older = {name: value for name, value in camera_as_json(camera).items() if name != "diffusion"}
    assert camera_of(older).diffusion == NO_DIFFUSION
