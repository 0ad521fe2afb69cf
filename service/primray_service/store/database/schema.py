"""The tables, for SQLite and PostgreSQL alike. A change here needs a migration; tests/service/store compares the two.

Text from clients is stored in a form that both databases accept, and JSON as text: no query looks inside.
"""

from __future__ import annotations

import json
import re
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Dialect,
    Double,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    PrimaryKeyConstraint,
    Table,
    Text,
    TypeDecorator,
    text,
)


class Words(TypeDecorator[str]):
    """Text; characters that PostgreSQL (NUL) or UTF-8 (lone surrogates) cannot hold become U+FFFD, so that searches never match
    them."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        return None if value is None else re.sub("[\0\ud800-\udfff]", "\ufffd", value)


class Document(TypeDecorator[Any]):
    """JSON; None is NULL. ASCII with escapes, so that any string can be stored."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else json.dumps(value, separators=(",", ":"))

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:
        return None if value is None else json.loads(value)


metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

# Room for updates in place: a running job's row is written twice a second (PostgreSQL, "Heap-Only Tuples").
_ROOMY = {"fillfactor": "70"}


def _of_job(**kwargs: Any) -> Column[str]:
    return Column("job_id", Words, ForeignKey("jobs.id", ondelete="CASCADE"), nullable=False, **kwargs)


jobs = Table(
    "jobs",
    metadata,
    Column("id", Words, primary_key=True),
    Column("tenant", Words, nullable=False),
    Column("state", Words, nullable=False),
    Column("scene_id", Words, nullable=False),
    Column("entry", Words),
    Column("settings", Document, nullable=False),
    Column("created_at", Double, nullable=False),
    Column("queued_at", Double, nullable=False),
    Column("expires_at", Double, nullable=False),
    Column("ttl_s", Double, nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("version", BigInteger, nullable=False),
    Column("revision", BigInteger, nullable=False),
    Column("priority", Integer, nullable=False),
    Column("labels", Document, nullable=False),
    Column("name", Document),  # NULL: created before jobs had names
    Column("webhook", Document),
    Column("parallel", Document),  # NULL: frames are rendered in one slot each
    Column("started_at", Double),
    Column("finished_at", Double),
    Column("effective_settings", Document),
    Column("progress", Document, nullable=False),
    Column("result", Document),
    Column("warnings", Document, nullable=False),
    Column("error", Document),
    Column("usage", Document, nullable=False),
    Column("request_id", Words, nullable=False),
    Column("traceparent", Words, nullable=False),
    # Counters of the frames by state, so that no query about a job counts its frames.
    Column("frames_queued", Integer, nullable=False),
    Column("frames_running", Integer, nullable=False),
    Column("frames_succeeded", Integer, nullable=False),
    Column("frames_failed", Integer, nullable=False),
    Column("frames_canceled", Integer, nullable=False),
    Column("scene_ready", Boolean, nullable=False),
    # -priority while one of its frames could be claimed, else NULL: the index below is the queue.
    Column("queue_rank", Integer),
    postgresql_with=_ROOMY,
)
Index(
    "ix_jobs_queue",
    jobs.c.queue_rank,
    jobs.c.tenant,
    jobs.c.created_at,
    jobs.c.id,
    sqlite_where=text("queue_rank IS NOT NULL"),
    postgresql_where=text("queue_rank IS NOT NULL"),
)
Index(
    "ix_jobs_queue_by_age",
    jobs.c.queue_rank,
    jobs.c.created_at,
    jobs.c.id,
    sqlite_where=text("queue_rank IS NOT NULL"),
    postgresql_where=text("queue_rank IS NOT NULL"),
)
Index(
    "ix_jobs_active",
    jobs.c.tenant,
    sqlite_where=text("state IN ('preparing', 'running', 'canceling', 'pausing')"),
    postgresql_where=text("state IN ('preparing', 'running', 'canceling', 'pausing')"),
)
# For administrators, who see the jobs of all tenants.
Index("ix_jobs_of_all", jobs.c.created_at, jobs.c.id)
Index("ix_jobs_of_all_by_state", jobs.c.state, jobs.c.created_at, jobs.c.id)
Index("ix_jobs_listed", jobs.c.tenant, jobs.c.created_at, jobs.c.id)
Index("ix_jobs_listed_by_state", jobs.c.tenant, jobs.c.state, jobs.c.created_at, jobs.c.id)
Index("ix_jobs_listed_by_scene", jobs.c.tenant, jobs.c.scene_id, jobs.c.created_at, jobs.c.id)
Index("ix_jobs_waiting_for_scene", jobs.c.scene_id, jobs.c.state)
Index("ix_jobs_expires_at", jobs.c.expires_at)

frames = Table(
    "frames",
    metadata,
    _of_job(),
    Column("number", Integer, nullable=False),
    Column("time_code", Double),
    Column("state", Words, nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("checkpoint", Integer, nullable=False),
    Column("checkpoint_file", Words, nullable=False),
    Column("merged", Integer, nullable=False, server_default="0"),
    Column("checkpoint_chunk", Words, nullable=False),  # the chunk that made it, to recognise a repeated call
    Column("claim", Words, nullable=False),  # the call that claimed it, for the same purpose
    Column("crashes", Integer, nullable=False),
    Column("kills", Integer, nullable=False),
    Column("phase", Words, nullable=False),
    Column("progress", Document, nullable=False),
    Column("effective_settings", Document),
    Column("convergence", Document, nullable=False),
    Column("result", Document),
    Column("error", Document),
    Column("cpu_s", Double, nullable=False),
    Column("peak_rss_bytes", BigInteger, nullable=False),
    Column("started_at", Double),
    Column("finished_at", Double),
    PrimaryKeyConstraint("job_id", "number"),
    postgresql_with=_ROOMY,
)
Index("ix_frames_by_state", frames.c.job_id, frames.c.state, frames.c.number)

# Parts (ranges of samples) of frames that are rendered in several slots; deleted once they are in the frame's checkpoint.
parts = Table(
    "parts",
    metadata,
    _of_job(),
    Column("frame", Integer, nullable=False),
    Column("first", Integer, nullable=False),
    Column("end", Integer, nullable=False),
    Column("state", Words, nullable=False),
    Column("claim", Words, nullable=False),  # the chunk that it was handed to
    Column("checkpoint", Integer, nullable=False),
    Column("checkpoint_file", Words, nullable=False),
    Column("crashes", Integer, nullable=False),
    Column("kills", Integer, nullable=False),
    PrimaryKeyConstraint("job_id", "frame", "first"),
)

job_labels = Table(
    "job_labels",
    metadata,
    _of_job(),
    Column("tenant", Words, nullable=False),
    Column("name", Document, nullable=False),
    Column("value", Document, nullable=False),
    Column("created_at", Double, nullable=False),  # the job's
    PrimaryKeyConstraint("job_id", "name"),
)
Index(
    "ix_job_labels_listed",
    job_labels.c.tenant,
    job_labels.c.name,
    job_labels.c.value,
    job_labels.c.created_at,
    job_labels.c.job_id,
)

events = Table(
    "events",
    metadata,
    Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True, autoincrement=True),
    _of_job(),
    Column("type", Words, nullable=False),
    Column("created_at", Double, nullable=False),
    Column("data", Document, nullable=False),
    sqlite_autoincrement=True,  # a number is never reused, not even after its row was deleted
)
Index("ix_events_of_job", events.c.job_id, events.c.id)
Index(
    "ix_events_passing",
    events.c.created_at,
    sqlite_where=text("type IN ('progress', 'preview')"),
    postgresql_where=text("type IN ('progress', 'preview')"),
)

outputs = Table(
    "outputs",
    metadata,
    _of_job(),
    Column("name", Words, nullable=False),
    Column("frame", Integer),
    Column("bytes", BigInteger, nullable=False),
    Column("sha256", Words, nullable=False),
    Column("media_type", Words, nullable=False),
    Column("created_at", Double, nullable=False),
    PrimaryKeyConstraint("job_id", "name"),
)

scenes = Table(
    "scenes",
    metadata,
    Column("id", Words, nullable=False),
    Column("tenant", Words, nullable=False),
    Column("state", Words, nullable=False),
    Column("kind", Words, nullable=False),
    Column("name", Words, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("stored_bytes", BigInteger, nullable=False),
    Column("created_at", Double, nullable=False),
    Column("used_at", Double, nullable=False),
    Column("facts", Document, nullable=False),
    Column("warnings", Document, nullable=False),
    Column("problem", Document),
    PrimaryKeyConstraint("id", "tenant"),
)
Index("ix_scenes_listed", scenes.c.tenant, scenes.c.created_at, scenes.c.id)
Index("ix_scenes_used_at", scenes.c.used_at)
Index(
    "ix_scenes_to_check",
    scenes.c.created_at,
    scenes.c.id,
    sqlite_where=text("state = 'checking'"),
    postgresql_where=text("state = 'checking'"),
)

# Files of packages by their digests: a tenant's own, independent of other tenants'; counted once, however many scenes have
# them.
contents = Table(
    "contents",
    metadata,
    Column("tenant", Words, nullable=False),
    Column("sha256", Words, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("used_at", Double, nullable=False),
    PrimaryKeyConstraint("tenant", "sha256"),
)
Index("ix_contents_used_at", contents.c.used_at)
scene_contents = Table(
    "scene_contents",
    metadata,
    Column("tenant", Words, nullable=False),
    Column("sha256", Words, nullable=False),
    Column("scene_id", Words, nullable=False),
    PrimaryKeyConstraint("tenant", "sha256", "scene_id"),
)
Index("ix_scene_contents_of_scene", scene_contents.c.tenant, scene_contents.c.scene_id)

idempotency_keys = Table(
    "idempotency_keys",
    metadata,
    Column("tenant", Words, nullable=False),
    Column("key", Words, nullable=False),
    Column("request_sha256", Words, nullable=False),
    _of_job(index=True),
    Column("created_at", Double, nullable=False, index=True),
    PrimaryKeyConstraint("tenant", "key"),
)

webhooks = Table(
    "webhooks",
    metadata,
    Column("id", Words, primary_key=True),
    _of_job(index=True),
    Column("url", Words, nullable=False),
    Column("secret", Words, nullable=False),
    Column("event", Words, nullable=False),
    Column("payload", Document, nullable=False),
    Column("tries", Integer, nullable=False),
    Column("next_at", Double, nullable=False),
    Column("state", Words, nullable=False),
    Column("last_error", Words, nullable=False),
)
Index(
    "ix_webhooks_due",
    webhooks.c.next_at,
    sqlite_where=text("state = 'due'"),
    postgresql_where=text("state = 'due'"),
)

api_keys = Table(
    "api_keys",
    metadata,
    Column("id", Words, primary_key=True),
    Column("tenant", Words, nullable=False, index=True),
    Column("name", Words, nullable=False),
    Column("prefix", Words, nullable=False),
    Column("sha256", Words, nullable=False),
    Column("scopes", Document, nullable=False),
    Column("quotas", Document, nullable=False),
    Column("created_at", Double, nullable=False),
    Column("expires_at", Double),
    Column("revoked_at", Double),
)
Index("ix_api_keys_sha256", api_keys.c.sha256, unique=True)

# Sums that would be slow to count: updated in the transaction that changes what they count.
tenants = Table(
    "tenants",
    metadata,
    Column("tenant", Words, primary_key=True),
    Column("stored_bytes", BigInteger, nullable=False),
    Column("cpu_s", Double, nullable=False),
)
# Quotas that an administrator has set for a tenant, which override those of its keys and the server's.
tenant_quotas = Table(
    "tenant_quotas",
    metadata,
    Column("tenant", Words, primary_key=True),
    Column("quotas", Document, nullable=False),
    Column("changed_at", Double, nullable=False),
)
job_counts = Table(
    "job_counts",
    metadata,
    Column("tenant", Words, nullable=False),
    Column("state", Words, nullable=False),
    Column("jobs", BigInteger, nullable=False),
    PrimaryKeyConstraint("tenant", "state"),
)
usage_days = Table(
    "usage_days",
    metadata,
    Column("tenant", Words, nullable=False),
    Column("day", Words, nullable=False),  # UTC, 2026-01-31
    Column("cpu_s", Double, nullable=False),
    PrimaryKeyConstraint("tenant", "day"),
)

# One row: the server that dispatches.
leader = Table(
    "leader",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("fence", BigInteger, nullable=False),
    Column("holder", Words),  # NULL: released
    Column("acquired_at", Double, nullable=False),
    Column("expires_at", Double, nullable=False),
    Column("about", Document),  # capabilities of its executor, for the servers that only answer
)

# Recent durations of frames by work (queue/estimates.py), for a bounded number of works.
work_seconds = Table(
    "work_seconds",
    metadata,
    Column("work", Words, primary_key=True),
    Column("seconds", Double, nullable=False),
    Column("noted_at", Double, nullable=False),
)

# Sessions that were logged out, kept until their natural end.
ended_sessions = Table(
    "ended_sessions",
    metadata,
    Column("session", Words, primary_key=True),
    Column("until", Double, nullable=False),
)
