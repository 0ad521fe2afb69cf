"""Hooks of all tests: property tests disregard the clock, and a run of the whole suite keeps the claims about the conformance
table that it collected."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings
from tests.docs.conformance.claims import CLAIMS, proofs_of

# A busy machine is no fault of the code: neither examples nor their generation have a deadline.
settings.register_profile("primray", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("primray")


@pytest.hookimpl(tryfirst=True)  # before the long ones are left out
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        config.stash[CLAIMS] = proofs_of(items)
