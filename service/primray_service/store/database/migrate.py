"""Migration of a database to this version's schema, in one transaction under one lock: of several servers that start at once
one migrates, and the others find it done; a killed migration leaves no trace."""

from __future__ import annotations

from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

from .engine import Database

SCRIPTS = Path(__file__).parent / "migrations"
LOCK = 0x7072696D726179  # "primray"


class SchemaTooNew(Exception):
    """A newer version of the service wrote this database."""


def configuration(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(SCRIPTS).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


def migrate(database: Database, revision: str = "head") -> None:
    """Migrate; raises SchemaTooNew, or Unavailable after waiting the better part of a minute for a database that is
    starting."""

    def work(connection: Connection) -> None:
        if connection.dialect.name == "postgresql":
            connection.execute(text("SET LOCAL lock_timeout = '120s'"))
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": LOCK})
        _refuse_newer(connection)
        command.upgrade(configuration(connection), revision)

    database.write_plainly(work)


def _refuse_newer(connection: Connection) -> None:
    scripts = ScriptDirectory.from_config(configuration())
    known = {script.revision for script in scripts.walk_revisions()}
    found = MigrationContext.configure(connection).get_current_revision()
    if found is not None and found not in known:
        raise SchemaTooNew(
            f"The database has schema {found}; this version of primray knows up to {scripts.get_current_head()}. "
            "Start the version that wrote it, or a later one, or restore the backup made before the upgrade."
        )
