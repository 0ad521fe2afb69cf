"""Scenes: a row for each tenant, the bytes once for all; and files of packages by their digests.

Rows of files are a tenant's own: files of other tenants are invisible.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from sqlalchemy import Connection, delete, exists, insert, literal, select, tuple_, update
from sqlalchemy.sql.elements import ColumnElement

from ...jobs import TERMINAL, JobState, Json, Scene, SceneState
from ...limits import Quotas
from ..base import Conflict, QuotaExceeded
from ..database import schema
from ..database.engine import Operations, Transaction
from ..database.rows import read_cursor, scene_of, values_of_scene, write_cursor
from .leases import check_fence, look_at_fence
from .open_job import open_job
from .tenants import count_bytes, lock_tenant

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


contents, scene_contents = schema.contents, schema.scene_contents

AT_ONCE = 500  # digests in one statement


class Contents(Operations):
    def contents(self, tenant: str, digests: Collection[str], now: float) -> Mapping[str, int]:
        def work(transaction: Transaction[dict[str, int]]) -> dict[str, int]:
            found: dict[str, int] = {}
            lock_tenant(transaction, tenant)
            for some in _parts(sorted(digests)):
                mine = (contents.c.tenant == tenant, contents.c.sha256.in_(some))
                transaction.execute(update(contents).where(*mine, contents.c.used_at < now).values(used_at=now))
                rows = transaction.execute(select(contents.c.sha256, contents.c.bytes).where(*mine))
                found |= {row.sha256: int(row.bytes) for row in rows}
            return found

        return self._db.write(work, durable=False)

    def has_content(self, tenant: str, sha256: str) -> bool:
        mine = select(contents.c.bytes).where(contents.c.tenant == tenant, contents.c.sha256 == sha256)
        return self._db.read(lambda db: db.execute(mine).first()) is not None

    def put_content(self, tenant: str, sha256: str, size: int, now: float, quotas: Quotas) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            stored_bytes = lock_tenant(transaction, tenant)
            mine = (contents.c.tenant == tenant, contents.c.sha256 == sha256)
            if transaction.execute(select(contents.c.bytes).where(*mine)).first() is not None:
                transaction.execute(update(contents).where(*mine, contents.c.used_at < now).values(used_at=now))
                return transaction.previous is True
            if quotas.stored_bytes is not None and stored_bytes + size > quotas.stored_bytes:
                raise QuotaExceeded("stored_bytes")
            row = {"tenant": tenant, "sha256": sha256, "bytes": size, "used_at": now}
            transaction.execute(insert(contents).values(**row))
            count_bytes(transaction, tenant, size)
            return True

        return self._db.write(work)

    def unused_contents(self, fence: int, before: float, limit: int) -> Sequence[tuple[str, str]]:
        def work(db: Connection) -> list[tuple[str, str]]:
            look_at_fence(db, fence)
            unused = select(contents.c.tenant, contents.c.sha256).where(contents.c.used_at < before, ~_IS_USED)
            return [(row.tenant, row.sha256) for row in db.execute(unused.order_by(contents.c.used_at).limit(limit))]

        return self._db.read(work)

    def forget_content(self, tenant: str, sha256: str, before: float) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            lock_tenant(transaction, tenant)
            mine = (contents.c.tenant == tenant, contents.c.sha256 == sha256)
            unused = select(contents.c.bytes).where(*mine, contents.c.used_at < before, ~_IS_USED)
            size = transaction.execute(unused).scalar()
            if size is None:
                return transaction.previous is True
            transaction.execute(delete(contents).where(*mine))
            count_bytes(transaction, tenant, -int(size))
            return True

        return self._db.write(work)

    def contents_of_scene(self, tenant: str, scene_id: str) -> Sequence[str]:
        mine = select(scene_contents.c.sha256).where(scene_contents.c.tenant == tenant, scene_contents.c.scene_id == scene_id)
        return list(self._db.read(lambda db: db.execute(mine).scalars().all()))


_IS_USED = exists().where(scene_contents.c.tenant == contents.c.tenant, scene_contents.c.sha256 == contents.c.sha256)


def note_contents(transaction: Transaction[Any], tenant: str, scene_id: str, digests: Collection[str]) -> bool:
    """Record that a scene uses these contents; return False, without a change, if the tenant lacks one. Requires the tenant's
    lock."""
    wanted = set(digests)
    found: set[str] = set()
    for some in _parts(sorted(wanted)):
        mine = (contents.c.tenant == tenant, contents.c.sha256.in_(some))
        found |= set(transaction.execute(select(contents.c.sha256).where(*mine)).scalars())
    if found != wanted:
        return False
    for sha256 in sorted(wanted):
        transaction.insert_new(scene_contents, {"tenant": tenant, "sha256": sha256, "scene_id": scene_id})
    return True


def release_contents(transaction: Transaction[Any], tenant: str, scene_id: str) -> None:
    """Release the contents of a deleted scene: those that no other scene of the tenant uses are no longer counted, and their
    rows are deleted."""
    of_scene = (scene_contents.c.tenant == tenant, scene_contents.c.scene_id == scene_id)
    digests = sorted(transaction.execute(select(scene_contents.c.sha256).where(*of_scene)).scalars())
    if not digests:
        return
    lock_tenant(transaction, tenant)
    transaction.execute(delete(scene_contents).where(*of_scene))
    freed = 0
    for some in _parts(digests):
        unused = (contents.c.tenant == tenant, contents.c.sha256.in_(some), ~_IS_USED)
        freed += sum(transaction.execute(select(contents.c.bytes).where(*unused)).scalars())
        transaction.execute(delete(contents).where(*unused))
    count_bytes(transaction, tenant, -freed)


def _parts(digests: Sequence[str]) -> Iterator[list[str]]:
    left = iter(digests)
    while some := list(islice(left, AT_ONCE)):
        yield some
