"""The queue's oldest jobs are found without reading all that wait."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    waits = sa.text("queue_rank IS NOT NULL")
    columns = ["queue_rank", "created_at", "id"]
    op.create_index("ix_jobs_queue_by_age", "jobs", columns, sqlite_where=waits, postgresql_where=waits)
