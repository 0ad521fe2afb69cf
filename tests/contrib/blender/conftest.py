"""Tests with the fixture `blender` run in each version of Blender that is found; others are skipped by name."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from . import host


@pytest.fixture(params=host.VERSIONS)
def blender(request: pytest.FixtureRequest) -> Iterator[str]:
    host.choose(request.param)
    host.python()
    yield request.param
    host.choose(host.VERSIONS[0])
