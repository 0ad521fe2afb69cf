"""A moving world built by calls of Embree alone finds what the renderer's finds: the benchmark of moving rays compares them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.bench.cores.moving_rays import built
from tests.described import describe, lambert

from primray import core
from primray.description import Sphere
from primray.settings import RenderSettings


@pytest.mark.parametrize(("kind", "times"), [("terrain", 3), ("instances", 3), ("turning", 3)])
def test_both_worlds_are_one(kind: str, times: int, tmp_path) -> None:
    """But at outlines: Embree makes matrices of instances in single precision."""
    scene, facts = built(kind, 2000, times, tmp_path, (32, 20))
    [moving] = facts["moving"].values()
    assert moving["segments"] == times - 1
    testing = core.module().testing
    recording = core.Recording(scene, RenderSettings(spp=8, max_depth=3))._recording
    bare = testing.BareWorld(scene._scene)
    for shadow in (False, True):
        rays, apart = testing.replay_agreement(recording, bare, shadow)
        assert rays > 3000
        assert apart <= (0 if kind == "terrain" else 0.004 * rays)
        for entry in range(3):
            assert all(seconds > 0 for seconds in testing.replay_interleaved(recording, bare, shadow, entry))


def test_what_it_has_not_is_refused() -> None:
    scene = describe([(Sphere("/ball", 1.0, 0), np.eye(4))], [lambert(0.5)]).build()
    with pytest.raises(core.module().CoreError, match="does not support curved shapes"):
        core.module().testing.BareWorld(scene)
