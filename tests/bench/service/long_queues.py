"""Databases with queues of any length: a job of each tenant is made as the service makes it, and copied in the database."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sqlalchemy import ColumnElement, Connection, Integer, Text, cast, func, insert, literal, select, text
from tests.service.postgres import private_server

from primray_service import ids
from primray_service.api.models import Settings
from primray_service.jobs import Job, JobState, Scene, SceneState
from primray_service.limits import Quotas
from primray_service.store import SqlStore, open_store
from primray_service.store.database import schema

NO_QUOTAS = Quotas(queued_jobs=None, stored_bytes=None)
BODY_ID = "sha256:" + "5c" * 32
SETTINGS = Settings.model_validate({"stop": {"max_samples": 64}}).model_dump(mode="json")


@contextmanager
def database(kind: str) -> Iterator[str]:
    """The URL of an empty, migrated database of its own: "postgresql" or "sqlite"."""
    if kind == "sqlite":
        with TemporaryDirectory(prefix="primray-bench-") as folder:
            yield _migrated(f"sqlite:///{Path(folder) / 'primray.sqlite'}")
    else:
        with private_server() as server:
            yield _migrated(server.url_of(server.new_database()))


def _migrated(url: str) -> str:
    store = open_store(url)
    store.migrate()
    store.close()
    return url


def tenant_names(number: int) -> list[str]:
    return [f"tenant-{i:03}" for i in range(number)]


def put_scenes(store: SqlStore, tenants: list[str]) -> None:
    """The same bytes for each, checked."""
    now = time.time()
    for tenant in tenants:
        scene = Scene(BODY_ID, tenant, SceneState.READY, "usda", "scene.usda", 10, 10, now, now)
        store.put_scene(scene, NO_QUOTAS)


def new_job(tenant: str, now: float, **changes: Any) -> Job:
    made = {
        "id": ids.job_id(now),
        "state": JobState.QUEUED,
        "scene_id": BODY_ID,
        "entry": None,
        "settings": SETTINGS,
        "ttl_s": 30 * 86400.0,
        "created_at": now,
        "queued_at": now,
        "expires_at": now + 30 * 86400.0,
    }
    return Job(tenant=tenant, **{**made, **changes})


def lengthen(store: SqlStore, tenants: list[str], jobs: int) -> None:
    """Until so many wait, of one frame each, as many of one tenant as of another."""
    missing = jobs - store.counts()["queued"]
    for number, tenant in enumerate(tenants):
        add_jobs(store, tenant, missing * (number + 1) // len(tenants) - missing * number // len(tenants))
    analyze(store)


def add_jobs(store: SqlStore, tenant: str, jobs: int, frames: int = 1) -> None:
    if jobs > 0:
        codes = [None] if frames == 1 else [float(number) for number in range(frames)]
        job, _ = store.create_job(new_job(tenant, time.time()), codes, NO_QUOTAS)
        store._db.write_plainly(lambda db: _copy(db, job, jobs - 1))


def analyze(store: SqlStore) -> None:
    """As a server that runs for longer does by itself."""
    with store._db._reader.connect() as db:
        db.execute(text("ANALYZE"))


def _copy(db: Connection, job: Job, times: int) -> None:
    """Its row, its frame's and its event's; the tenant's count."""
    numbers = select(literal(1).label("i")).cte("numbers", recursive=True)
    numbers = numbers.union_all(select(numbers.c.i + 1).where(numbers.c.i < times))
    copy_id = literal(job.id[:22]) + func.substr(cast(numbers.c.i + 10**8, Text), 2)
    for table, own in ((schema.jobs, "id"), (schema.frames, "job_id"), (schema.events, "job_id")):
        new: dict[str, ColumnElement[Any]] = {own: copy_id}
        if table is schema.jobs:
            new["created_at"] = table.c.created_at + cast(numbers.c.i, Integer) * 1e-6
        names = [column.name for column in table.c if not (table is schema.events and column.name == "id")]
        rows = select(*(new.get(name, table.c[name]) for name in names)).join_from(table, numbers, numbers.c.i <= times)
        rows = rows.where(table.c[own] == job.id)
        if times > 0:
            db.execute(insert(table).from_select(names, rows))
    counts = schema.job_counts
    mine = (counts.c.tenant == job.tenant, counts.c.state == job.state.value)
    db.execute(counts.update().where(*mine).values(jobs=counts.c.jobs + times))
