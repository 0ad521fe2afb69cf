"""What prims hand down is what pxr's own functions say of each, on random stages; and what is cached changes nothing."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from primray.diagnostics import Diagnostic
from primray.settings import RenderSettings
from primray.usd import translate

from .drawn_leaves import leaves_by_usd, leaves_described
from .random_namespaces import stage_of
from .uncached import without_caches

STAGES, QUICK = 400, 40
SETTINGS = RenderSettings(default_light=False)


def as_usd_says(seeds: range) -> None:
    count = 0
    for seed in seeds:
        stage = stage_of(seed)
        description, _ = translate(stage, SETTINGS)
        expected = leaves_by_usd(stage)
        assert leaves_described(description) == expected, f"seed {seed}"
        count += len(expected)
    assert count > 5 * len(seeds)  # not of stages with nothing on them


def told(diagnostics: Iterable[Diagnostic]) -> set[tuple[str, str]]:
    """Of all but the near plane, which is not held against instances: what is alike is one without caches."""
    return {(d.code, d.message) for d in diagnostics if d.code != "near-plane"}


def as_without_caches(seeds: range) -> None:
    shared = 0
    for seed in seeds:
        stage = stage_of(seed, color_spaces=True)
        cached, said = translate(stage, SETTINGS)
        with pytest.MonkeyPatch.context() as patched:
            without_caches(patched)
            apart, said_apart = translate(stage, SETTINGS)
        assert leaves_described(cached) == leaves_described(apart), f"seed {seed}"
        assert told(said) == told(said_apart), f"seed {seed}"
        shared += len(apart.shapes) - len(cached.shapes)
    assert shared > 3 * len(seeds)  # so that much is held to be alike


@pytest.mark.parametrize("first", range(0, QUICK, 10))
@pytest.mark.conforms(
    "Imageable.visibility", "Imageable.purpose", "PrimvarsAPI.primvars:NAME", "GeomModelAPI.model:drawMode",
    "MaterialBindingAPI.bindMaterialAs", "VisibilityAPI.renderVisibility",
)  # fmt: skip
def test_what_is_drawn_is_what_usd_says(first: int) -> None:
    as_usd_says(range(first, first + 10))


@pytest.mark.parametrize("first", range(0, QUICK, 10))
def test_caches_change_nothing(first: int) -> None:
    as_without_caches(range(first, first + 10))


@pytest.mark.long
def test_what_is_drawn_is_what_usd_says_of_many() -> None:
    as_usd_says(range(QUICK, STAGES))


@pytest.mark.long
def test_caches_change_nothing_of_many() -> None:
    as_without_caches(range(QUICK, STAGES))
