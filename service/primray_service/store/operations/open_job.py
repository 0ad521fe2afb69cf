"""A job under its row's lock: every change of a job and of its frames' states goes through here, and is saved once."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Row, select, text, update

from ...ids import ulid
from ...jobs import TERMINAL, FrameState, IllegalMove, Job, JobState, Json, is_legal, state_of_all
from ..database import schema
from ..database.engine import Transaction
from ..database.rows import job_of

jobs, frames = schema.jobs, schema.frames

WAITING = frozenset({JobState.QUEUED, JobState.PREPARING, JobState.RUNNING})  # their queued frames may be claimed
OF_VERSION = frozenset({"state", "attempt", "priority", "labels", "ttl_s"})  # see jobs.Job
# Must match the index's condition literally: SQLite uses a partial index for no other. It selects jobs that have begun and not
# ended: some of their frames run, or the next is about to be claimed.
IS_ACTIVE = text("jobs.state IN ('preparing', 'running', 'canceling', 'pausing')")


class OpenJob:
    """A job in one transaction. `job` is the future row; nothing is stored before `save`, which the transaction's end calls."""

    def __init__(self, transaction: Transaction[Any], row: Row[Any]) -> None:
        self.job = job_of(row)
        self.frames = Counter({state: int(row._mapping[jobs.c[f"frames_{state}"]]) for state in FrameState})
        self.scene_ready = bool(row._mapping[jobs.c.scene_ready])
        self._transaction = transaction
        self._stored_state = self.job.state
        self._changed: set[str] = set()
        self.is_touched = False
        transaction.to_save.append(self.save)

    def change(self, values: Mapping[str, Any]) -> None:
        different = {name: value for name, value in values.items() if getattr(self.job, name) != value}
        self.job = replace(self.job, **different)
        self._changed |= different.keys()
        self.touch()

    def touch(self) -> None:
        """Record a change of something that belongs to the job."""
        self.is_touched = True

    def event(self, type_: str, now: float, data: Json) -> None:
        self._transaction.event(self.job.id, type_, now, data)
        self.touch()

    def move(self, to: JobState, now: float, values: Mapping[str, Any] | None = None) -> None:
        """Move to another state, with its event; IllegalMove if that is not a legal move."""
        if not is_legal(self.job.state, to):
            raise IllegalMove(f"{self.job.id} is {self.job.state}, and cannot be {to}")
        self.change({**(values or {}), "state": to})
        self.event("state", now, {"state": to.value, "attempt": self.job.attempt})

    def move_frames(self, of: FrameState, to: FrameState, number: int = 1) -> None:
        """Count frames whose rows went from one state to another."""
        self.frames[of] -= number
        self.frames[to] += number
        self.touch()

    def cancel_frames(self, of: FrameState, now: float) -> None:
        """Cancel all of its frames in this state."""
        if self.frames[of] == 0:
            return
        canceled = update(frames).where(frames.c.job_id == self.job.id, frames.c.state == of.value)
        moved = self._transaction.execute(canceled.values(state=FrameState.CANCELED.value, finished_at=now)).rowcount
        self.move_frames(of, FrameState.CANCELED, moved)
        self.change({"progress": {**self.job.progress, "frames": self.counts}})

    @property
    def counts(self) -> Json:
        """Return its frames by state, in the form of progress documents."""
        return {"total": sum(self.frames.values())} | {state.value: self.frames[state] for state in FrameState}

    def end(self, to: JobState, now: float, values: Mapping[str, Any] | None = None) -> None:
        """Move to a terminal state: kept for its time to live from now on, with an end event and a webhook."""
        assert to in TERMINAL
        self.move(to, now, {**(values or {}), "finished_at": now, "expires_at": now + self.job.ttl_s})
        error = {"error": self.job.error} if self.job.error else {}
        self.event("end", now, {"state": to.value, "attempt": self.job.attempt, **error})
        self.send("completed", now)

    def reject(self, problem: Json | None, now: float) -> None:
        """End a queued job whose scene cannot be rendered."""
        self.cancel_frames(FrameState.QUEUED, now)
        self.end(JobState.FAILED, now, {"error": problem and {**problem, "attempt": self.job.attempt}})

    def end_if_done(self, now: float, values: Mapping[str, Any]) -> bool:
        """End a job all of whose frames have ended, in the state that follows from theirs; a canceling job: canceled."""
        to = state_of_all(state for state, number in self.frames.items() if number > 0)
        if to is None:
            return False
        self.end(JobState.CANCELED if self.job.state == JobState.CANCELING else to, now, values)
        return True

    def pause_if_idle(self, now: float) -> None:
        """End pausing once the last running frame has stopped."""
        if self.job.state == JobState.PAUSING and not self.frames[FrameState.RUNNING]:
            self.move(JobState.PAUSED, now)

    def send(self, event: str, now: float, frame: Json | None = None) -> None:
        """Queue a webhook, if the job asks for this event."""
        message = job_message(self.job, event, now, self._transaction.next_message(), frame)
        if message:
            self._transaction.insert_new(schema.webhooks, message)

    def save(self) -> Job:
        if self.is_touched:
            values = self.new_values()
            self._transaction.execute(update(jobs).where(jobs.c.id == self.job.id).values(**values))
        return self.job

    def new_values(self) -> Json:
        """Return the values to store, and treat them as stored from now on."""
        job = self.job
        self.job = replace(job, revision=job.revision + 1, version=job.version + bool(self._changed & OF_VERSION))
        if job.state != self._stored_state:
            self._transaction.count_job(job.tenant, self._stored_state.value, -1)
            self._transaction.count_job(job.tenant, job.state.value, 1)
        changed, self._changed = self._changed, set()
        self._stored_state = job.state
        self.is_touched = False
        self._transaction.changed.append(job.id)
        kept = {name: getattr(self.job, name) for name in (*changed, "revision", "version")}
        counts = {f"frames_{state}": number for state, number in self.frames.items()}
        return {**kept, **counts, "scene_ready": self.scene_ready, "queue_rank": self.queue_rank}

    @property
    def queue_rank(self) -> int | None:
        may_run = self.scene_ready and self.job.state in WAITING and self.frames[FrameState.QUEUED] > 0
        return -self.job.priority if may_run else None


def open_job(transaction: Transaction[Any], job_id: str) -> OpenJob | None:
    """Open a job, locking its row."""
    row = transaction.execute(select(jobs).where(jobs.c.id == job_id).with_for_update()).first()
    return OpenJob(transaction, row) if row else None


def open_known_job(transaction: Transaction[Any], job_id: str) -> OpenJob:
    """Open a job, locking its row; KeyError where there is none."""
    opened = open_job(transaction, job_id)
    if opened is None:
        raise KeyError(job_id)
    return opened


def open_jobs(transaction: Transaction[Any], job_ids: Collection[str]) -> Mapping[str, OpenJob]:
    """Open those jobs that exist, locking their rows in one order."""
    found = select(jobs).where(jobs.c.id.in_(job_ids)).order_by(jobs.c.id).with_for_update()
    return {row.id: OpenJob(transaction, row) for row in transaction.execute(found)}


def save_all(transaction: Transaction[Any], opened: Iterable[OpenJob]) -> None:
    """Save several jobs; those with the same changes in one statement."""
    alike: defaultdict[str, list[str]] = defaultdict(list)
    values: dict[str, Json] = {}
    for job in opened:
        if job.is_touched:
            new = job.new_values()
            key = repr(sorted(new.items()))
            values[key] = new
            alike[key].append(job.job.id)
    for key, job_ids in alike.items():
        transaction.execute(update(jobs).where(jobs.c.id.in_(job_ids)).values(**values[key]))


def time_text(at: float) -> str:
    """Return the time as RFC 3339 text, UTC, milliseconds."""
    return datetime.fromtimestamp(at, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def job_message(job: Job, event: str, now: float, order: int, frame: Json | None = None) -> Json | None:
    """Return a row of the webhooks table that is due now, before those of the same time whose `order` is larger; None if the
    job asks for no such message."""
    webhook = job.webhook
    if webhook is None or event not in webhook.get("events", ()):
        return None
    data = {
        "id": job.id,
        "object": "job",
        "state": job.state.value,
        "attempt": job.attempt,
        "scene": {"id": job.scene_id, "entry": job.entry},
        "labels": dict(job.labels),
        "created_at": time_text(job.created_at),
        "started_at": None if job.started_at is None else time_text(job.started_at),
        "finished_at": None if job.finished_at is None else time_text(job.finished_at),
        "result": job.result,
        "error": job.error,
        "usage": job.usage,
    }
    if frame is not None:
        data["frame"] = frame
    return {
        "id": f"msg_{ulid(now, order.to_bytes(4) + os.urandom(6))}",
        "job_id": job.id,
        "url": str(webhook.get("url", "")),
        "secret": str(webhook.get("secret") or ""),
        "event": event,
        "payload": {"type": f"job.{event}", "timestamp": time_text(now), "data": data},
        "tries": 0,
        "next_at": now,
        "state": "due",
        "last_error": "",
    }
