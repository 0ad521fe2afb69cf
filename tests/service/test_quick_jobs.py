"""Small jobs are quick: ten times what is aimed at, as machines that run tests do other things too; the figures are made by
tests.bench.service.quick_jobs."""

from __future__ import annotations

import pytest
from tests.bench.service.quick_jobs import AT_MOST_S, seconds_of
from tests.service.api_calls import upload
from tests.service.serving import RunningServer


@pytest.mark.parametrize("frames", list(AT_MOST_S))
def test_small_jobs_are_quick(server: RunningServer, frames: int) -> None:
    client = server.client()
    scene = upload(client)
    assert min(seconds_of(client, scene, frames) for _ in range(2)) < 10 * AT_MOST_S[frames]
