"""Scenes: a row for each tenant, the bytes once for all."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from sqlalchemy import Connection, delete, exists, insert, literal, select, tuple_, update
from sqlalchemy.sql.elements import ColumnElement

from ...jobs import TERMINAL, JobState, Json, Scene, SceneState
from ...limits import Quotas
from ..base import Conflict, QuotaExceeded
from ..database import schema
from ..database.rows import read_cursor, scene_of, values_of_scene, write_cursor
from ..database.transaction import Transaction
from .contents import note_contents, release_contents
from .leases import check_fence, look_at_fence
from .open_job import open_job
from .operations import Operations
from .usage import count_bytes, lock_tenant

scenes, jobs = schema.scenes, schema.jobs

# Must match the index's condition literally: SQLite uses a partial index for no other.
_TO_CHECK: ColumnElement[bool] = scenes.c.state == literal(SceneState.CHECKING.value, literal_execute=True)
AWAITING_SCENE = (JobState.QUEUED, JobState.PAUSED)
NOT_TERMINAL = [state.value for state in JobState if state not in TERMINAL]


def lock_scene(transaction: Transaction[Any], tenant: str, scene_id: str, *, used_at: float) -> Scene | None:
    """Return the tenant's scene, marked as used, which nobody can delete for the rest of the transaction."""
    mine = (scenes.c.id == scene_id, scenes.c.tenant == tenant)
    row = transaction.execute(select(scenes).where(*mine).with_for_update()).first()
    if row is None:
        return None
    if row.used_at < used_at:
        transaction.execute(update(scenes).where(*mine).values(used_at=used_at))
    return scene_of(row)


class Scenes(Operations):
    def put_scene(self, scene: Scene, quotas: Quotas, contents: Collection[str] = ()) -> tuple[Scene, bool]:
        def work(transaction: Transaction[tuple[Scene, bool]]) -> tuple[Scene, bool]:
            # A check of this scene writes all of its rows: wait for that, and find it checked.
            same = select(scenes).where(scenes.c.id == scene.id).order_by(scenes.c.tenant).with_for_update()
            rows = {row.tenant: row for row in transaction.execute(same)}
            stored_bytes = lock_tenant(transaction, scene.tenant)
            mine = lock_scene(transaction, scene.tenant, scene.id, used_at=scene.used_at)
            if mine is not None:
                return mine, mine.created_at == scene.created_at
            if quotas.stored_bytes is not None and stored_bytes + scene.stored_bytes > quotas.stored_bytes:
                raise QuotaExceeded("stored_bytes")
            values = values_of_scene(scene)
            checked = [row for row in rows.values() if row.state != SceneState.CHECKING]
            for row in checked[:1]:
                values |= {"state": row.state, "facts": row.facts, "warnings": row.warnings, "problem": row.problem}
            if not note_contents(transaction, scene.tenant, scene.id, contents):
                raise Conflict(f"{scene.tenant} lacks contents of {scene.id}")
            transaction.execute(insert(scenes).values(**values))
            count_bytes(transaction, scene.tenant, scene.stored_bytes)
            return scene_of(transaction.execute(same.where(scenes.c.tenant == scene.tenant)).one()), True

        return self._db.write(work)

    def scene(self, tenant: str, scene_id: str) -> Scene | None:
        mine = select(scenes).where(scenes.c.id == scene_id, scenes.c.tenant == tenant)
        row = self._db.read(lambda db: db.execute(mine).first())
        return scene_of(row) if row else None

    def scenes(self, tenant: str, limit: int, cursor: str | None) -> tuple[Sequence[Scene], str | None]:
        found = select(scenes).where(scenes.c.tenant == tenant)
        if cursor is not None:
            found = found.where(tuple_(scenes.c.created_at, scenes.c.id) < tuple_(*read_cursor(cursor, "scenes")))
        found = found.order_by(scenes.c.created_at.desc(), scenes.c.id.desc()).limit(limit + 1)
        items = [scene_of(row) for row in self._db.read(lambda db: db.execute(found).all())]
        more = len(items) > limit
        items = items[:limit]
        return items, write_cursor(items[-1].created_at, items[-1].id, "scenes") if more and items else None

    def delete_scene(self, tenant: str, scene_id: str) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            same = select(scenes).where(scenes.c.id == scene_id).order_by(scenes.c.tenant).with_for_update()
            transaction.execute(same).all()
            # including those that came while it waited for the first
            rows = {row.tenant: row for row in transaction.execute(same)}
            if tenant not in rows:
                if transaction.previous is not None:
                    return transaction.previous
                raise KeyError(scene_id)
            using = select(jobs.c.id).where(jobs.c.tenant == tenant, jobs.c.scene_id == scene_id)
            if transaction.execute(using.where(jobs.c.state.in_(NOT_TERMINAL)).limit(1)).first() is not None:
                raise Conflict(f"jobs use {scene_id}")
            transaction.execute(delete(scenes).where(scenes.c.id == scene_id, scenes.c.tenant == tenant))
            count_bytes(transaction, tenant, -rows[tenant].stored_bytes)
            release_contents(transaction, tenant, scene_id)
            return len(rows) == 1

        return self._db.write(work)

    def has_scene(self, scene_id: str) -> bool:
        any_of_them = select(scenes.c.id).where(scenes.c.id == scene_id).limit(1)
        return self._db.read(lambda db: db.execute(any_of_them).first()) is not None

    def next_check(self, fence: int) -> Scene | None:
        def work(db: Connection) -> Scene | None:
            look_at_fence(db, fence)
            waiting = select(scenes).where(_TO_CHECK)
            row = db.execute(waiting.order_by(scenes.c.created_at, scenes.c.id).limit(1)).first()
            return scene_of(row) if row else None

        return self._db.read(work)

    def scene_checked(
        self, fence: int, scene_id: str, now: float, *, facts: Json, warnings: list[Json], problem: Json | None
    ) -> None:
        def work(transaction: Transaction[None]) -> None:
            check_fence(transaction, fence)
            same = select(scenes.c.tenant).where(scenes.c.id == scene_id, scenes.c.state == SceneState.CHECKING.value)
            checked = transaction.execute(same.order_by(scenes.c.tenant).with_for_update()).scalars().all()
            state = SceneState.READY if problem is None else SceneState.REJECTED
            values = {"state": state.value, "facts": facts, "warnings": warnings, "problem": problem}
            mine = (scenes.c.id == scene_id, scenes.c.tenant.in_(checked))
            transaction.execute(update(scenes).where(*mine).values(**values))
            waits = jobs.c.state.in_([state.value for state in AWAITING_SCENE])
            waiting = select(jobs.c.id).where(jobs.c.scene_id == scene_id, waits)
            of_them = waiting.where(jobs.c.tenant.in_(checked)).order_by(jobs.c.id)
            for job_id in transaction.execute(of_them).scalars().all():
                opened = open_job(transaction, job_id)
                if opened is None or opened.job.state not in AWAITING_SCENE:
                    continue
                if problem is not None:
                    opened.reject(problem, now)
                opened.scene_ready = problem is None
                opened.touch()

        self._db.write(work)

    def unused_scenes(self, fence: int, before: float, limit: int) -> Sequence[Scene]:
        def work(db: Connection) -> list[Scene]:
            look_at_fence(db, fence)
            using = exists().where(jobs.c.tenant == scenes.c.tenant, jobs.c.scene_id == scenes.c.id)
            unused = select(scenes).where(scenes.c.used_at < before, scenes.c.state != SceneState.CHECKING.value, ~using)
            return [scene_of(row) for row in db.execute(unused.order_by(scenes.c.used_at).limit(limit))]

        return self._db.read(work)
