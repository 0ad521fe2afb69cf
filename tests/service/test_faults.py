"""kill -9 at any moment: no job is lost, none is rendered twice into its result, and pixels have the undisturbed bits."""

from __future__ import annotations

import pytest
from tests.service.faults import study
from tests.service.postgres import Server, postgres_server

__all__ = ["postgres_server"]


@pytest.mark.long
def test_a_few_kills_on_sqlite() -> None:
    found = study("sqlite", kills=4, seed=3, weight=1.0, every_s=0.7)
    assert found.wrong == []
    assert found.jobs >= 4


def test_a_few_kills_on_postgresql(postgres_server: Server) -> None:
    found = study("postgresql", kills=5, seed=5, weight=1.0, every_s=0.7, server=postgres_server)
    assert found.wrong == []
    assert found.kills["connection"] > 0


@pytest.mark.long
@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_a_hundred_kills(database: str) -> None:
    found = study(database, kills=100, seed=11, weight=4.0, every_s=1.5)
    assert found.wrong == []
    assert sum(found.kills.values()) == 100
