"""Every test of the contract runs over SQLite and over PostgreSQL, and leaves a database in which all rules hold."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from primray_service.store import SqlStore, open_store

from ..postgres import postgres_databases, postgres_server, postgres_url
from .world import World, broken_rules

__all__ = ["postgres_databases", "postgres_server", "postgres_url"]


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Of an empty database whose schema is up to date."""
    if request.param == "postgresql":
        return str(request.getfixturevalue("postgres_url"))
    found = f"sqlite:///{tmp_path / 'primray.sqlite'}"
    store = open_store(found)
    store.migrate()
    store.close()
    return found


@pytest.fixture
def store(url: str) -> Iterator[SqlStore]:
    opened = open_store(url)
    yield opened
    broken = broken_rules(opened)
    opened.close()
    assert not broken, "\n".join(broken)


@pytest.fixture
def world(store: SqlStore) -> World:
    made = World(store)
    made.lead()
    return made


def database_of(url: str) -> str:
    found = re.search(r"/(primray_\w+)", url)
    assert found is not None
    return found[1]
