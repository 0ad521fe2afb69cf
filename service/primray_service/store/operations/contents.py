"""Files of packages by their digests: those that a tenant has, the scenes that use them, and unused ones.

Rows are a tenant's own: files of other tenants are invisible.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from sqlalchemy import Connection, delete, exists, insert, select, update

from ...limits import Quotas
from ..base import QuotaExceeded
from ..database import schema
from ..database.transaction import Transaction
from .leases import look_at_fence
from .operations import Operations
from .usage import count_bytes, lock_tenant

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
