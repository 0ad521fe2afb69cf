"""Pages of the jobs of a tenant, or of all tenants. Each begins by an index where the last one ended, and reads only rows that
it returns."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Select, exists, select, tuple_, union_all

from ...jobs import JobState
from ..base import JobFilter, Page
from ..database import schema
from ..database.rows import JOB_COLUMNS, job_of, read_cursor, write_cursor
from .operations import Operations

jobs, labels = schema.jobs, schema.job_labels


class Listing(Operations):
    def jobs(self, tenant: str | None, where: JobFilter, limit: int, cursor: str | None, newest_first: bool = True) -> Page:
        if tenant is None and where.labels:
            raise ValueError("labels are indexed by tenant")
        order = "newest" if newest_first else "oldest"
        after = None if cursor is None else read_cursor(cursor, order)
        states = where.states if 0 < len(where.states) < len(JobState) else frozenset[JobState]()
        if len(states) <= 1 or where.labels:
            found = _ids(tenant, where, states, after, newest_first, limit)
        else:  # by state, each from its own part of the index, then merged
            parts = [_ids(tenant, where, frozenset({state}), after, newest_first, limit) for state in sorted(states)]
            both = union_all(*(select(part.subquery()) for part in parts)).subquery()
            found = _ordered(select(both), both.c.created_at, both.c.id, newest_first).limit(limit + 1)
        page = found.subquery()
        rows = select(*JOB_COLUMNS).join(page, page.c.id == jobs.c.id)
        rows = _ordered(rows, jobs.c.created_at, jobs.c.id, newest_first)
        items = [job_of(row) for row in self._db.read(lambda db: db.execute(rows).all())]
        more = len(items) > limit
        items = items[:limit]
        return Page(items, write_cursor(items[-1].created_at, items[-1].id, order) if more and items else None)


def _ids(
    tenant: str | None,
    where: JobFilter,
    states: frozenset[JobState],
    after: tuple[float, str] | None,
    newest_first: bool,
    limit: int,
) -> Select[Any]:
    """Return a query for (created_at, id) of a page and one more row; by the first label's index if labels are given."""
    wanted = sorted(where.labels.items())
    if wanted:
        name, value = wanted[0]
        created_at, job_id = labels.c.created_at, labels.c.job_id
        found = select(created_at.label("created_at"), job_id.label("id")).join(jobs, jobs.c.id == labels.c.job_id)
        found = found.where(labels.c.tenant == tenant, labels.c.name == name, labels.c.value == value)
    else:
        created_at, job_id = jobs.c.created_at, jobs.c.id
        found = select(created_at, job_id)
        found = found if tenant is None else found.where(jobs.c.tenant == tenant)
    for name, value in wanted[1:]:
        other = labels.alias()
        found = found.where(exists().where(other.c.job_id == jobs.c.id, other.c.name == name, other.c.value == value))
    if states:
        found = found.where(jobs.c.state.in_([state.value for state in sorted(states)]))
    if where.scene_id is not None:
        found = found.where(jobs.c.scene_id == where.scene_id)
    if after is not None:
        here = tuple_(created_at, job_id)
        found = found.where(here < tuple_(*after) if newest_first else here > tuple_(*after))
    return _ordered(found, created_at, job_id, newest_first).limit(limit + 1)


def _ordered(found: Select[Any], created_at: Any, job_id: Any, newest_first: bool) -> Select[Any]:
    if newest_first:
        return found.order_by(created_at.desc(), job_id.desc())
    return found.order_by(created_at, job_id)
