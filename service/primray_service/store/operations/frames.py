"""Frames and their parts, and the dispatcher's reports about running ones.

Reports that come too late (the frame no longer runs, or is in another attempt) are dropped; the returned job shows why.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, delete, insert, select, update

from ...jobs import FRAME_TERMINAL, Frame, FrameState, Job, JobState, Json, Output, Part, PartState
from ..database import schema
from ..database.engine import Operations, Transaction
from ..database.rows import FRAME_COLUMNS, frame_of, part_of
from .leases import check_fence
from .open_job import OpenJob, open_job
from .tenants import count_bytes, count_cpu

jobs, frames, outputs, events = schema.jobs, schema.frames, schema.outputs, schema.events

REPORTED = ("phase", "progress", "effective_settings", "convergence", "cpu_s", "peak_rss_bytes")
OF_JOB = frozenset({"progress", "effective_settings", "warnings", "usage", "result", "error"})
AT_END_ONLY = frozenset({"result", "error"})


class Frames(Operations):
    def frames(self, job_id: str, limit: int = 1000, after: int = -1) -> Sequence[Frame]:
        after = max(-1, min(after, 2**31 - 1))
        found = select(*FRAME_COLUMNS).where(frames.c.job_id == job_id, frames.c.number > after)
        found = found.order_by(frames.c.number).limit(limit)
        return [frame_of(row) for row in self._db.read(lambda db: db.execute(found).all())]

    def frame(self, job_id: str, number: int) -> Frame | None:
        if not 0 <= number < 2**31:
            return None
        found = select(*FRAME_COLUMNS).where(frames.c.job_id == job_id, frames.c.number == number)
        row = self._db.read(lambda db: db.execute(found).first())
        return frame_of(row) if row else None

    def frame_counts(self, job_id: str) -> Mapping[str, int]:
        columns = [jobs.c[f"frames_{state}"].label(state.value) for state in FrameState]
        row = self._db.read(lambda db: db.execute(select(*columns).where(jobs.c.id == job_id)).first())
        return {state.value: int(row._mapping[state.value]) if row else 0 for state in FrameState}

    def report(
        self,
        fence: int,
        frame: Frame,
        now: float,
        *,
        job_changes: Json | None = None,
        events: Sequence[tuple[str, Json]] = (),
    ) -> Job:
        changes = dict(job_changes or {})
        state = changes.pop("state", JobState.RUNNING)
        if state != JobState.RUNNING or changes.keys() - OF_JOB | changes.keys() & AT_END_ONLY:
            raise ValueError(f"{sorted(job_changes or {})} cannot be reported")
        begins = job_changes is not None and "state" in job_changes

        def work(transaction: Transaction[Job]) -> Job:
            opened, stored = _running(transaction, fence, frame)
            # An earlier try that arrived has left all of the events, or none.
            if stored is None or (events and transaction.previous and _is_there(transaction, frame.job_id, now, events[-1])):
                return opened.job
            _store(transaction, opened, stored, now, {name: getattr(frame, name) for name in REPORTED})
            opened.change(changes)
            if begins and opened.job.state == JobState.PREPARING:  # canceling: the request to cancel came first
                started = now if opened.job.started_at is None else opened.job.started_at
                first = opened.job.started_at is None
                opened.move(JobState.RUNNING, now, {"started_at": started})
                if first:
                    opened.send("started", now)
            for kind, data in events:
                opened.event(kind, now, data)
            return opened.save()

        return self._db.write(work, durable=False)

    def accept_checkpoint(
        self,
        fence: int,
        chunk_id: str,
        job_id: str,
        number: int,
        *,
        attempt: int,
        follows: int,
        file: str,
        now: float,
        merged: int = 0,
    ) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            check_fence(transaction, fence)
            opened = open_job(transaction, job_id)
            stored = _frame(transaction, job_id, number)
            if opened is None or stored is None or stored.attempt != attempt:
                return False
            if stored.checkpoint == follows + 1 and stored.checkpoint_file == file:
                return self._made_by(transaction, stored) == chunk_id  # this very call, repeated
            if stored.checkpoint != follows or stored.state != FrameState.RUNNING:
                return False
            values = {"checkpoint": follows + 1, "checkpoint_file": file, "checkpoint_chunk": chunk_id, "merged": merged}
            forget_merged(transaction, stored, merged)
            _update(transaction, stored, {**values, "crashes": 0, "kills": 0})
            opened.touch()
            return True

        return self._db.write(work)

    @staticmethod
    def _made_by(transaction: Transaction[Any], frame: Frame) -> str:
        mine = (frames.c.job_id == frame.job_id, frames.c.number == frame.number)
        return str(transaction.execute(select(frames.c.checkpoint_chunk).where(*mine)).scalar_one())

    def end_frame(
        self,
        fence: int,
        frame: Frame,
        now: float,
        *,
        outputs: Sequence[Output],
        job_changes: Json,
        webhook_events: Sequence[str] = (),
    ) -> Job:
        if frame.state not in FRAME_TERMINAL or job_changes.keys() - OF_JOB:
            raise ValueError(f"{frame.state} is not a terminal state, or {sorted(job_changes)} cannot be changed")

        def work(transaction: Transaction[Job]) -> Job:
            opened, stored = _running(transaction, fence, frame)
            if stored is None:
                return opened.job
            ended = {name: getattr(frame, name) for name in (*REPORTED, "result", "error", "crashes", "kills")}
            _store(transaction, opened, stored, now, {**ended, "state": frame.state.value, "claim": "", "finished_at": now})
            _replace_outputs(transaction, opened, frame.number, outputs)
            opened.move_frames(FrameState.RUNNING, frame.state)
            said = {"frame": frame.number, "state": frame.state.value, "attempt": frame.attempt}
            error = {"error": frame.error} if frame.error else {}
            opened.event("frame", now, {**said, **error, "outputs": [output.name for output in outputs]})
            opened.change({name: value for name, value in job_changes.items() if name not in AT_END_ONLY})
            for event in dict.fromkeys((*webhook_events, "frame.completed")):
                if event != "completed":  # which the job's end sends
                    names = [output.name for output in outputs]
                    opened.send(event, now, {**said, **error, "time_code": frame.time_code, "outputs": names})
            failed = {"error": _first_error(transaction, frame.job_id)} if opened.frames[FrameState.FAILED] else {}
            if not opened.end_if_done(now, {**failed, **job_changes}):
                opened.pause_if_idle(now)
            return opened.save()

        return self._db.write(work)

    def requeue_frame(self, fence: int, frame: Frame, now: float) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            opened, stored = _running(transaction, fence, frame)
            if stored is None:
                return opened.job
            to = FrameState.CANCELED if opened.job.state == JobState.CANCELING else FrameState.QUEUED
            values = {name: getattr(frame, name) for name in (*REPORTED, "crashes", "kills")}
            ended = {"finished_at": now} if to == FrameState.CANCELED else {}
            _store(transaction, opened, stored, now, {**values, **ended, "state": to.value, "claim": ""})
            opened.move_frames(FrameState.RUNNING, to)
            opened.event("frame", now, {"frame": frame.number, "state": to.value, "attempt": frame.attempt})
            if opened.job.state == JobState.PAUSING:
                opened.pause_if_idle(now)
            elif not opened.end_if_done(now, {}) and not opened.frames[FrameState.RUNNING]:
                opened.move(JobState.QUEUED, now)
            return opened.save()

        return self._db.write(work)


def _running(transaction: Transaction[Any], fence: int, frame: Frame) -> tuple[OpenJob, Frame | None]:
    """Return the frame's job, locked, and the stored frame if it runs in that attempt. Lost, KeyError."""
    check_fence(transaction, fence)
    opened = open_job(transaction, frame.job_id)
    stored = _frame(transaction, frame.job_id, frame.number)
    if opened is None or stored is None:
        raise KeyError(frame.job_id)
    runs = stored.state == FrameState.RUNNING and stored.attempt == frame.attempt
    return opened, stored if runs else None


def _frame(transaction: Transaction[Any], job_id: str, number: int) -> Frame | None:
    """Return the stored frame; requires its job's lock."""
    found = select(*FRAME_COLUMNS).where(frames.c.job_id == job_id, frames.c.number == number)
    row = transaction.execute(found).first()
    return frame_of(row) if row else None


def _store(transaction: Transaction[Any], opened: OpenJob, stored: Frame, now: float, values: Json) -> None:
    """Store values of a frame. `cpu_s` is the frame's total: its increase counts towards the tenant's day."""
    count_cpu(transaction, opened.job.tenant, now, values["cpu_s"] - stored.cpu_s)
    _update(transaction, stored, values)
    opened.touch()


def _update(transaction: Transaction[Any], frame: Frame, values: Json) -> None:
    mine = (frames.c.job_id == frame.job_id, frames.c.number == frame.number)
    transaction.execute(update(frames).where(*mine).values(**values))


def _replace_outputs(transaction: Transaction[Any], opened: OpenJob, number: int, new: Sequence[Output]) -> None:
    of_job = outputs.c.job_id == opened.job.id
    replaced = of_job & ((outputs.c.frame == number) | outputs.c.name.in_([output.name for output in new]))
    old = sum(transaction.execute(select(outputs.c.bytes).where(replaced)).scalars())
    transaction.execute(delete(outputs).where(replaced))
    rows = [
        {
            "job_id": opened.job.id,
            "name": output.name,
            "frame": output.frame,
            "bytes": output.bytes,
            "sha256": output.sha256,
            "media_type": output.media_type,
            "created_at": output.created_at,
        }
        for output in new
    ]
    if rows:
        transaction.execute(insert(outputs), rows)
    count_bytes(transaction, opened.job.tenant, sum(output.bytes for output in new) - old)


def _first_error(transaction: Transaction[Any], job_id: str) -> Json | None:
    failed = select(frames.c.error).where(frames.c.job_id == job_id, frames.c.state == FrameState.FAILED.value)
    found: Json | None = transaction.execute(failed.order_by(frames.c.number).limit(1)).scalar()
    return found


def _is_there(transaction: Transaction[Any], job_id: str, now: float, event: tuple[str, Json]) -> bool:
    """Return whether an earlier try of the same call stored its event."""
    mine = (events.c.job_id == job_id, events.c.created_at == now, events.c.type == event[0])
    last = select(events.c.data).where(*mine).order_by(events.c.id.desc()).limit(20)
    return event[1] in list(transaction.execute(last).scalars())


parts = schema.parts


class Parts(Operations):
    def parts(self, job_id: str, frame: int) -> Sequence[Part]:
        found = select(parts).where(parts.c.job_id == job_id, parts.c.frame == frame).order_by(parts.c.first)
        return [part_of(row) for row in self._db.read(lambda db: db.execute(found).all())]

    def give_out_part(self, fence: int, frame: Frame, part: Part) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            if not _runs(transaction, fence, frame):
                return False
            stored = _stored(transaction, part)
            if stored is None:
                transaction.execute(insert(parts).values(**_values(part)))
                return True
            transaction.execute(update(parts).where(*_mine(part)).values(**_values(part)))
            return True

        return self._db.write(work, durable=False)

    def accept_part(self, fence: int, frame: Frame, part: Part) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            if not _runs(transaction, fence, frame):
                return False
            stored = _stored(transaction, part)
            if stored is None or stored.claim != part.claim:
                return False
            if stored.state is not PartState.RUNNING:
                return stored == part  # this very call, repeated
            transaction.execute(update(parts).where(*_mine(part)).values(**_values(part)))
            return True

        return self._db.write(work)

    def drop_parts(self, fence: int, frame: Frame) -> None:
        def work(transaction: Transaction[None]) -> None:
            if not _runs(transaction, fence, frame):
                return
            transaction.execute(delete(parts).where(parts.c.job_id == frame.job_id, parts.c.frame == frame.number))
            mine = (frames.c.job_id == frame.job_id, frames.c.number == frame.number)
            transaction.execute(update(frames).where(*mine).values(merged=0, checkpoint_file=""))

        self._db.write(work)


def forget_merged(transaction: Transaction[Any], frame: Frame, merged: int) -> None:
    """Delete parts whose samples are among the first `merged`, which the frame's checkpoint has; all parts if it is not made of
    parts."""
    mine = (parts.c.job_id == frame.job_id, parts.c.frame == frame.number)
    transaction.execute(delete(parts).where(*mine, parts.c.end <= merged) if merged else delete(parts).where(*mine))


def _runs(transaction: Transaction[Any], fence: int, frame: Frame) -> bool:
    """Return whether the frame runs; requires its job's lock. Lost."""
    check_fence(transaction, fence)
    if open_job(transaction, frame.job_id) is None:
        return False
    mine = (frames.c.job_id == frame.job_id, frames.c.number == frame.number, frames.c.attempt == frame.attempt)
    return transaction.execute(select(frames.c.state).where(*mine)).scalar() == FrameState.RUNNING.value


def _stored(transaction: Transaction[Any], part: Part) -> Part | None:
    row = transaction.execute(select(parts).where(*_mine(part))).first()
    return part_of(row) if row else None


def _mine(part: Part) -> tuple[ColumnElement[bool], ...]:
    return parts.c.job_id == part.job_id, parts.c.frame == part.frame, parts.c.first == part.first


def _values(part: Part) -> Json:
    return dataclasses.asdict(part) | {"state": part.state.value}
