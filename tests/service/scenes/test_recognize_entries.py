"""Which of a package's layers is meant."""

from __future__ import annotations

import pytest

from primray_service.problems import Problem
from primray_service.scenes.recognize import candidates, choose


@pytest.mark.parametrize(
    ("paths", "roots"),
    [
        (["shot.usda", "assets/a.usd", "tex/a.png"], ["shot.usda"]),
        (["show/shot.usda", "show/assets/a.usd", "readme.txt"], ["show/shot.usda"]),
        (["a.usda", "b.USDC", "c.usdz", "d/e.usda"], ["a.usda", "b.USDC", "c.usdz"]),
        (["__MACOSX/._a.usda", ".hidden/b.usda", "x/y/a.usda"], ["x/y/a.usda"]),
        (["a.png"], []),
    ],
)
def test_the_outermost_layers_can_be_the_root(paths: list[str], roots: list[str]) -> None:
    assert candidates(paths) == roots


def test_the_entry_is_the_one_named_or_the_only_one() -> None:
    assert choose(None, ["a.usda"]) == "a.usda"
    assert choose("d/e.usda", ["a.usda"], ["a.usda", "d/e.usda"]) == "d/e.usda"
    with pytest.raises(Problem) as ambiguous:
        choose(None, ["a.usda", "b.usda"])
    assert (ambiguous.value.slug, ambiguous.value.extra["candidates"]) == ("ambiguous-entry", ["a.usda", "b.usda"])
    with pytest.raises(Problem) as missing:
        choose("c.usda", ["a.usda", "b.usda"])
    assert missing.value.slug == "entry-missing"
