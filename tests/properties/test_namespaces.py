"""What prims hand down is what pxr's own functions say of each, on random stages; and caches change nothing."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings
from primray.usd import translate

from .drawn_leaves import leaves_by_usd, leaves_described
from .random_namespaces import stage_of

STAGES, QUICK = 400, 40


def check(seed: int) -> None:
    stage = stage_of(seed)
    description, _ = translate(stage, RenderSettings(default_light=False))
    assert leaves_described(description) == leaves_by_usd(stage)


@pytest.mark.parametrize("seed", range(QUICK))
def test_what_is_drawn_is_what_usd_says(seed: int) -> None:
    check(seed)
