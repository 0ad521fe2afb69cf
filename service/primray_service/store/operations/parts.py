"""Parts of frames that are rendered in several slots at a time. Reports that come too late are dropped, like those about
frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, delete, insert, select, update

from ...jobs import Frame, FrameState, Json, Part, PartState
from ..database import schema
from ..database.rows import part_of
from ..database.transaction import Transaction
from .leases import check_fence
from .open_job import open_job
from .operations import Operations

frames, parts = schema.frames, schema.parts


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
