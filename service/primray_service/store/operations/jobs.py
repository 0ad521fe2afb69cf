"""Jobs as clients see and change them: create, read, list, change, cancel, continue, delete, expire; and their webhooks.

Each page of jobs begins by an index where the last one ended, and reads only rows that it returns. Rows of webhooks were
written together with the change that they report.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection, Select, delete, exists, insert, literal, select, text, tuple_, union_all, update
from sqlalchemy.sql.elements import ColumnElement

from ...jobs import TERMINAL, Event, FrameState, Job, JobState, Json, Output
from ...limits import Quotas
from ...problems import Problem
from ..base import Conflict, JobFilter, KeyReused, Page, WebhookDelivery
from ..database import schema
from ..database.engine import Operations, Transaction
from ..database.rows import JOB_COLUMNS, delivery_of, event_of, job_of, output_of, read_cursor, values_of_job, write_cursor
from .leases import check_fence, look_at_fence
from .open_job import OpenJob, open_job, open_known_job
from .scenes import lock_scene
from .tenants import check_room_for_job, count_bytes

jobs, frames, keys = schema.jobs, schema.frames, schema.idempotency_keys

CHANGEABLE = frozenset({"priority", "name", "labels", "ttl_s"})
MAY_EXPIRE = (JobState.QUEUED, JobState.PREPARING, JobState.RUNNING, JobState.PAUSING, JobState.PAUSED)
KEYS_KEPT_S = 25 * 3600.0
PASSING_EVENTS_KEPT_S = 3600.0
# Must match the index's condition literally: SQLite uses a partial index for no other.
_PASSING = text("type IN ('progress', 'preview')")


class Jobs(Operations):
    def create_job(
        self, job: Job, time_codes: Sequence[float | None], quotas: Quotas, idempotency: tuple[str, str] | None = None
    ) -> tuple[Job, bool]:
        if not time_codes:
            raise ValueError("a job has at least one frame")

        def work(transaction: Transaction[tuple[Job, bool]]) -> tuple[Job, bool]:
            earlier = _earlier(transaction, job, idempotency)
            if earlier is not None:
                return earlier, earlier.id == job.id
            scene = lock_scene(transaction, job.tenant, job.scene_id, used_at=job.created_at)
            if scene is None:
                raise Conflict(f"there is no scene {job.scene_id}")
            check_room_for_job(transaction, job.tenant, quotas)
            earlier = _earlier(transaction, job, idempotency)  # again, now that no other request of this tenant creates one
            if earlier is not None:
                return earlier, earlier.id == job.id
            opened = _insert_job(transaction, job, time_codes, scene_ready=scene.state == "ready")
            if idempotency is not None:
                key, request = idempotency
                values = {"key": key, "request_sha256": request, "job_id": job.id, "created_at": job.created_at}
                transaction.execute(insert(keys).values(tenant=job.tenant, **values))
            if scene.state == "rejected":
                opened.reject(scene.problem, job.created_at)
            return opened.save(), True

        return self._db.write(work)

    def job(self, job_id: str, tenant: str | None = None) -> Job | None:
        found = select(*JOB_COLUMNS).where(jobs.c.id == job_id)
        if tenant is not None:
            found = found.where(jobs.c.tenant == tenant)
        row = self._db.read(lambda db: db.execute(found).first())
        return job_of(row) if row else None

    def job_versions(self, job_ids: Collection[str]) -> Mapping[str, int]:
        found = select(jobs.c.id, jobs.c.version).where(jobs.c.id.in_(job_ids))
        return {row.id: row.version for row in self._db.read(lambda db: db.execute(found).all())}

    def outputs(self, job_id: str) -> Sequence[Output]:
        outputs = schema.outputs
        found = select(outputs).where(outputs.c.job_id == job_id).order_by(outputs.c.frame, outputs.c.name)
        return [output_of(row) for row in self._db.read(lambda db: db.execute(found).all())]

    def events(self, job_id: str, after: int, limit: int) -> Sequence[Event]:
        events = schema.events
        after = max(0, min(after, 2**63 - 1))
        found = select(events).where(events.c.job_id == job_id, events.c.id > after).order_by(events.c.id).limit(limit)
        return [event_of(row) for row in self._db.read(lambda db: db.execute(found).all())]

    def update_job(self, job_id: str, now: float, *, version: int | None, changes: Json) -> Job:
        if changes.keys() - CHANGEABLE:
            raise ValueError(f"{sorted(changes.keys() - CHANGEABLE)} cannot be changed")

        def work(transaction: Transaction[Job]) -> Job:
            opened = open_known_job(transaction, job_id)
            job = opened.job
            done = all(getattr(job, name) == value for name, value in changes.items())
            if version is not None and job.version != version and not (done and job.version == version + 1):
                raise Conflict(f"{job_id} has version {job.version}, not {version}")
            if done:
                return job
            opened.change(changes)
            if "ttl_s" in changes:
                since = job.queued_at if job.finished_at is None else job.finished_at
                opened.change({"expires_at": since + changes["ttl_s"]})
            if "labels" in changes:
                transaction.execute(delete(schema.job_labels).where(schema.job_labels.c.job_id == job_id))
                _insert_labels(transaction, opened.job)
            return opened.save()

        return self._db.write(work)

    def request_cancel(self, job_id: str, now: float) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            opened = open_known_job(transaction, job_id)
            if opened.job.state in (JobState.CANCELING, JobState.CANCELED):
                return opened.job
            if opened.job.state in TERMINAL:
                raise Conflict(f"{job_id} is {opened.job.state}")
            opened.cancel_frames(FrameState.QUEUED, now)
            if opened.frames[FrameState.RUNNING]:
                opened.move(JobState.CANCELING, now)
            else:
                opened.end(JobState.CANCELED, now)
            return opened.save()

        return self._db.write(work)

    def continue_job(self, job_id: str, stop: Json, now: float, quotas: Quotas) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            found = transaction.execute(select(*JOB_COLUMNS).where(jobs.c.id == job_id)).first()
            if found is None:
                raise KeyError(job_id)
            scene = lock_scene(transaction, found.tenant, found.scene_id, used_at=now)
            opened = open_known_job(transaction, job_id)
            job = opened.job
            settings = {**job.settings, "stop": stop}
            if job.state == JobState.QUEUED and job.queued_at == now and job.settings == settings and job.attempt > 1:
                return job  # this very call, repeated
            if job.state not in TERMINAL:
                raise Conflict(f"{job_id} is {job.state}")
            if scene is None or scene.state == "rejected":
                raise Conflict(f"the scene of {job_id} was deleted, or cannot be rendered")
            check_room_for_job(transaction, job.tenant, quotas)
            _begin_attempt(transaction, opened, settings, now)
            opened.scene_ready = scene.state == "ready"
            return opened.save()

        return self._db.write(work)

    def delete_job(self, job_id: str) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            opened = open_job(transaction, job_id)
            if opened is None:
                return bool(transaction.previous)
            if opened.frames[FrameState.RUNNING]:
                raise Conflict(f"{job_id} has running frames")
            outputs = schema.outputs
            sizes = transaction.execute(select(outputs.c.bytes).where(outputs.c.job_id == job_id)).scalars()
            count_bytes(transaction, opened.job.tenant, -sum(sizes))
            transaction.execute(delete(jobs).where(jobs.c.id == job_id))
            transaction.count_job(opened.job.tenant, opened.job.state.value, -1)
            transaction.changed.append(job_id)
            return True

        return self._db.write(work)

    def expire(self, fence: int, now: float, limit: int) -> tuple[Sequence[Job], Sequence[str]]:
        def work(transaction: Transaction[tuple[list[Job], list[str]]]) -> tuple[list[Job], list[str]]:
            check_fence(transaction, fence)
            transaction.execute(delete(keys).where(keys.c.created_at < now - KEYS_KEPT_S))
            _forget_passing_events(transaction, now - PASSING_EVENTS_KEPT_S)
            past = select(jobs.c.id).where(jobs.c.expires_at <= now).order_by(jobs.c.expires_at).limit(limit)
            may_expire = [state.value for state in MAY_EXPIRE]
            expired = _expired_before(transaction, now)
            for job_id in transaction.execute(past.where(jobs.c.state.in_(may_expire))).scalars().all():
                opened = open_job(transaction, job_id)
                if opened is not None and opened.job.state in may_expire and opened.job.expires_at <= now:
                    expired.append(_expire_job(opened, now))
            ended = past.where(jobs.c.state.in_([state.value for state in TERMINAL]))
            return expired, list(transaction.execute(ended).scalars())

        return self._db.write(work)


def _earlier(transaction: Transaction[Any], job: Job, idempotency: tuple[str, str] | None) -> Job | None:
    """Return the job that this call, or another with its idempotency key, created before. KeyReused."""
    if idempotency is not None:
        key, request = idempotency
        found = transaction.execute(select(keys).where(keys.c.tenant == job.tenant, keys.c.key == key)).first()
        if found is not None and found.request_sha256 != request:
            raise KeyReused(key)
        if found is not None:
            return job_of(transaction.execute(select(*JOB_COLUMNS).where(jobs.c.id == found.job_id)).one())
    row = transaction.execute(select(*JOB_COLUMNS).where(jobs.c.id == job.id)).first()
    return job_of(row) if row else None


def _insert_job(transaction: Transaction[Any], job: Job, time_codes: Sequence[float | None], *, scene_ready: bool) -> OpenJob:
    job = replace(job, state=JobState.QUEUED, attempt=1, version=1, revision=1, started_at=None, finished_at=None)
    none = {f"frames_{state}": 0 for state in FrameState} | {"frames_queued": len(time_codes)}
    rank = -job.priority if scene_ready else None
    transaction.execute(insert(jobs).values(**values_of_job(job), **none, scene_ready=scene_ready, queue_rank=rank))
    new = {
        "job_id": job.id,
        "state": FrameState.QUEUED.value,
        "attempt": 1,
        "checkpoint": 0,
        "checkpoint_file": "",
        "merged": 0,
        "checkpoint_chunk": "",
        "claim": "",
        "crashes": 0,
        "kills": 0,
        "phase": "",
        "progress": {},
        "convergence": [],
        "cpu_s": 0.0,
        "peak_rss_bytes": 0,
    }
    rows = [{**new, "number": number, "time_code": time_code} for number, time_code in enumerate(time_codes)]
    transaction.execute(insert(frames), rows)
    _insert_labels(transaction, job)
    transaction.event(job.id, "state", job.created_at, {"state": job.state.value, "attempt": 1})
    transaction.count_job(job.tenant, job.state.value, 1)
    transaction.changed.append(job.id)
    opened = open_job(transaction, job.id)
    assert opened is not None
    return opened


def _insert_labels(transaction: Transaction[Any], job: Job) -> None:
    of_job = {"job_id": job.id, "tenant": job.tenant, "created_at": job.created_at}
    if job.labels:
        rows = [{**of_job, "name": name, "value": value} for name, value in job.labels.items()]
        transaction.execute(insert(schema.job_labels), rows)


def _begin_attempt(transaction: Transaction[Any], opened: OpenJob, settings: Json, now: float) -> None:
    """Queue every frame again, from its checkpoint; results of the last attempt are cleared, except for its files and
    events."""
    begun: Mapping[str, Any] = {
        "state": FrameState.QUEUED.value,
        "attempt": frames.c.attempt + 1,  # not the job's: a retried frame has had more
        "crashes": 0,
        "kills": 0,
        "phase": "",
        "progress": {},
        "result": None,
        "error": None,
        "claim": "",
        "started_at": None,
        "finished_at": None,
    }
    transaction.execute(update(frames).where(frames.c.job_id == opened.job.id).values(**begun))
    total = sum(opened.frames.values())
    for state in FrameState:
        opened.frames[state] = total if state == FrameState.QUEUED else 0
    again = {"settings": settings, "attempt": opened.job.attempt + 1, "queued_at": now, "expires_at": now + opened.job.ttl_s}
    progress = {"fraction": 0.0, "phase": "queued", "frames": opened.counts}
    gone: Json = {"started_at": None, "finished_at": None, "progress": progress, "result": None, "error": None}
    opened.move(JobState.QUEUED, now, {**again, **gone})


def _forget_passing_events(transaction: Transaction[Any], before: float) -> None:
    """Delete transient events that later ones supersede: a day's render would leave a hundred thousand."""
    events = schema.events
    old = select(events.c.id).where(_PASSING, events.c.created_at < before).order_by(events.c.created_at).limit(10_000)
    transaction.execute(delete(events).where(events.c.id.in_(old)))


def _expired_before(transaction: Transaction[tuple[list[Job], list[str]]], now: float) -> list[Job]:
    """Return the jobs that an earlier try of the same call expired, if its commit arrived."""
    if transaction.previous is None:
        return []
    mine = jobs.c.id.in_([job.id for job in transaction.previous[0]])
    found = select(*JOB_COLUMNS).where(mine, jobs.c.state == JobState.EXPIRED.value, jobs.c.finished_at == now)
    return [job_of(row) for row in transaction.execute(found)]


def _expire_job(opened: OpenJob, now: float) -> Job:
    opened.cancel_frames(FrameState.QUEUED, now)
    opened.cancel_frames(FrameState.RUNNING, now)
    problem = Problem("job-expired", f"The job had not finished {opened.job.ttl_s:g} s after it was queued.")
    opened.end(JobState.EXPIRED, now, {"error": {**problem.as_json(), "attempt": opened.job.attempt}})
    return opened.save()


labels = schema.job_labels


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


webhooks = schema.webhooks

# Must match the index's condition literally: SQLite uses a partial index for no other.
_DUE: ColumnElement[bool] = webhooks.c.state == literal("due", literal_execute=True)


class Webhooks(Operations):
    def due_webhooks(self, fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]:
        def work(db: Connection) -> list[WebhookDelivery]:
            look_at_fence(db, fence)
            due = select(webhooks).where(_DUE, webhooks.c.next_at <= now)
            return [delivery_of(row) for row in db.execute(due.order_by(webhooks.c.next_at, webhooks.c.id).limit(limit))]

        return self._db.read(work)

    def webhook_tried(self, fence: int, delivery_id: str, *, state: str, next_at: float, error: str) -> None:
        def work(transaction: Transaction[None]) -> None:
            check_fence(transaction, fence)
            mine = webhooks.c.id == delivery_id
            row = transaction.execute(select(webhooks).where(mine).with_for_update()).first()
            if row is None or row.state != "due" or (row.tries > 0 and row.next_at == next_at):
                return  # deleted with its job, or this very call, repeated
            tried = {"tries": row.tries + 1, "state": state, "next_at": next_at, "last_error": error}
            transaction.execute(update(webhooks).where(mine).values(**tried))

        self._db.write(work, durable=False)

    def webhooks(self, job_id: str) -> Sequence[WebhookDelivery]:
        found = select(webhooks).where(webhooks.c.job_id == job_id).order_by(webhooks.c.id)
        return [delivery_of(row) for row in self._db.read(lambda db: db.execute(found).all())]
