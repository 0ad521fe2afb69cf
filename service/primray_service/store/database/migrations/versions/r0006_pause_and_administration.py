"""Jobs may be paused; administrators list the jobs of all tenants and set quotas of a tenant."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"

ACTIVE = sa.text("state IN ('preparing', 'running', 'canceling', 'pausing')")


def upgrade() -> None:
    op.drop_index("ix_jobs_active", table_name="jobs")
    op.create_index("ix_jobs_active", "jobs", ["tenant"], sqlite_where=ACTIVE, postgresql_where=ACTIVE)
    op.create_index("ix_jobs_of_all", "jobs", ["created_at", "id"])
    op.create_index("ix_jobs_of_all_by_state", "jobs", ["state", "created_at", "id"])
    op.create_table(
        "tenant_quotas",
        sa.Column("tenant", sa.Text(), nullable=False),
        sa.Column("quotas", sa.Text(), nullable=False),
        sa.Column("changed_at", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("tenant", name="pk_tenant_quotas"),
    )
