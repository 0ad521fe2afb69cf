"""One Ray cluster for all of these tests; none where ray is not installed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec

import pytest
from tests.service.executor.ray.cluster import RunningCluster


@pytest.fixture(scope="session")
def cluster() -> Iterator[RunningCluster]:
    """Its token is in this process's environment, as it would be in a server's."""
    if find_spec("ray") is None:
        pytest.skip("skipped: no ray")
    running = RunningCluster()
    before = dict(os.environ)
    os.environ.update(running.environment)
    yield running
    os.environ.clear()
    os.environ.update(before)
    running.stop()
