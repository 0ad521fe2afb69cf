"""Environment of Alembic: upgrades over the connection that store/database/migrate.py opened, in its transaction."""

from __future__ import annotations

from alembic import context

from primray_service.store.database.schema import metadata

context.configure(connection=context.config.attributes["connection"], target_metadata=metadata)
context.run_migrations()
