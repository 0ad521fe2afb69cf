"""Packages are uploaded by content: files by their digests, each tenant's own."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    op.create_table(
        "contents",
        sa.Column("tenant", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("used_at", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("tenant", "sha256", name="pk_contents"),
    )
    op.create_index("ix_contents_used_at", "contents", ["used_at"])
    op.create_table(
        "scene_contents",
        sa.Column("tenant", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("scene_id", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("tenant", "sha256", "scene_id", name="pk_scene_contents"),
    )
    op.create_index("ix_scene_contents_of_scene", "scene_contents", ["tenant", "scene_id"])
