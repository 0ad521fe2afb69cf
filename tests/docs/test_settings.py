"""Sources that are generated from the rows of RenderSettings are up to date."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from primray.settings import RenderSettings
from primray.settings.setting import setting, whole

from .settings import ROOT, files, written


@pytest.mark.parametrize("path", files())
def test_generated_sources_are_up_to_date(path: str) -> None:
    assert (ROOT / path).read_text(encoding="utf-8") == files()[path], "run `make docs`"


def test_a_new_setting_is_among_the_types() -> None:
    @dataclass(frozen=True)
    class Further(RenderSettings):
        tiles: int | None = setting(None, whole)

    assert written(Further).rstrip().endswith("\n    tiles: int | None")
