"""What tests of a dispatcher share."""

from __future__ import annotations

import pytest


@pytest.fixture
def no_wait_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the dispatcher's own waits last longer than a test, so that only what it is asked ends them."""
    monkeypatch.setattr("primray_service.dispatcher.frames.running.LOOK_S", 300.0)
    monkeypatch.setattr("primray_service.dispatcher.scheduler.STOP_WITHIN_S", 60.0)
