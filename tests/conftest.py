"""What all tests share: a run of the whole keeps the claims about the conformance table that it collected."""

from __future__ import annotations

import pytest
from tests.docs.conformance.claims import CLAIMS, proofs_of


@pytest.hookimpl(tryfirst=True)  # before the long ones are left out
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        config.stash[CLAIMS] = proofs_of(items)
