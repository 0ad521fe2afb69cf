"""Databases of every release become today's; one of a later release is refused; many servers may start at once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import inspect, text

from primray_service.store import SchemaTooNew, SqlStore, open_store
from primray_service.store.base import Unavailable
from primray_service.store.database import schema
from primray_service.store.database.engine import Database, engine_url
from primray_service.store.database.migrate import configuration, migrate

from ...postgres import Server
from ..world import World

REVISIONS = [script.revision for script in ScriptDirectory.from_config(configuration()).walk_revisions()][::-1]


@pytest.fixture(params=["sqlite", "postgresql"])
def empty_url(request: pytest.FixtureRequest, tmp_path: Path):
    """Of a database with nothing in it."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'new.sqlite'}"
        return
    server: Server = request.getfixturevalue("postgres_server")
    name = server.new_database()
    yield server.url_of(name)
    server.drop(name)


def test_the_first_release_is_0001():
    assert REVISIONS[0] == "0001"


@pytest.mark.parametrize("revision", REVISIONS)
def test_a_database_of_any_release_becomes_what_the_code_expects(empty_url: str, revision: str):
    database = Database(empty_url)
    migrate(database, revision)
    store = open_store(empty_url)
    store.migrate()
    with store._db._writer.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), schema.metadata) == []
        assert MigrationContext.configure(connection).get_current_revision() == REVISIONS[-1]
        # What compare_metadata does not look at: the conditions of partial indexes
        for table in schema.metadata.sorted_tables:
            dialect = connection.dialect.name
            found = {index["name"]: index for index in inspect(connection).get_indexes(table.name)}
            for index in table.indexes:
                where = index.dialect_options[dialect]["where"]
                stored = found[index.name].get("dialect_options", {}).get(f"{dialect}_where")
                assert (where is None) == (stored is None), index.name
                if dialect == "sqlite" and where is not None:
                    assert str(where) == str(stored)
    world = World(store)
    world.lead()
    world.finished()
    store.close()
    database.close()


def test_migrating_again_keeps_what_is_there(world: World):
    job = world.finished()
    world.store.migrate()
    assert world.get(job) == job


def test_a_database_of_a_later_release_is_refused(url: str):
    store = open_store(url)

    def say(version: str) -> None:
        with store._db._writer.begin() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = :version"), {"version": version})

    say("9999")
    with pytest.raises(SchemaTooNew, match=f"schema 9999.*up to {REVISIONS[-1]}"):
        store.migrate()
    say(REVISIONS[-1])  # databases go from test to test
    store.close()


def test_a_migration_that_fails_leaves_nothing(empty_url: str, monkeypatch: pytest.MonkeyPatch):
    database = Database(empty_url)

    def fails(*_: object) -> None:
        raise RuntimeError

    with monkeypatch.context() as patch:
        patch.setattr("alembic.runtime.migration.HeadMaintainer.update_to_step", fails)
        with pytest.raises(RuntimeError):
            migrate(database)
    with database._reader.connect() as connection:
        assert not set(inspect(connection).get_table_names()) - {"alembic_version"}
    migrate(database)
    database.check()
    database.close()


PROGRAM = """
import sys, time
from primray_service.store import open_store
store = open_store(sys.argv[1])
time.sleep(max(0, float(sys.argv[2]) - time.time()))
store.migrate()
store.check()
"""


def test_several_servers_migrate_at_once(empty_url: str):
    import time

    at = str(time.time() + 2.5)
    servers = [
        subprocess.Popen([sys.executable, "-c", PROGRAM, empty_url, at], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for _ in range(4)
    ]
    said = [server.communicate(timeout=120)[0].decode() for server in servers]
    assert [server.returncode for server in servers] == [0] * 4, "\n".join(said)
    store = open_store(empty_url)
    with store._db._reader.connect() as connection:
        assert connection.execute(text("SELECT count(*) FROM leader")).scalar() == 1
    store.close()


@pytest.mark.parametrize("url", ["mysql://host/db", "sqlite://", "sqlite:///:memory:", "nonsense"])
def test_other_databases_are_refused(url: str):
    with pytest.raises((ValueError, Exception), match=r"neither|parse"):
        open_store(url)


def test_a_refusal_shows_no_password():
    with pytest.raises(ValueError, match="neither") as caught:
        open_store("mysql://user:hunter2@host/db")
    assert "hunter2" not in str(caught.value)


def test_usual_urls_get_the_driver():
    for url in ("postgresql://u@h/d", "postgresql+psycopg2://u@h/d", "postgresql+psycopg://u@h/d"):
        assert engine_url(url).drivername == "postgresql+psycopg"


def test_a_server_that_does_not_answer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("primray_service.store.database.engine.KEEP_TRYING_S", 0.2)
    store = SqlStore(f"postgresql://nobody@/none?host={tmp_path}")
    for call in (store.check, store.migrate, store.counts, lambda: store.release_lease(1)):
        with pytest.raises(Unavailable, match="does not answer"):
            call()
    store.close()
