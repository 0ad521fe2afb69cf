"""The connection breaks while a commit is under way: it arrived, or it did not, and nobody knows. Every operation then does
what it would have done, once, and answers as it would have."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import psycopg
import pytest

from primray_service.jobs import Frame, FrameState, Job, JobState
from primray_service.limits import Quotas
from primray_service.store import SqlStore
from primray_service.store.database import schema

from ..operations.test_tenants import KEY, WEBHOOK
from ..world import ANY, T0, World, any_quotas, new_job, new_scene, scene_id


class Broken:
    """The next commits of a store fail, after they arrived or before."""

    def __init__(self, store: SqlStore) -> None:
        self.commits: list[str] = []
        self._dialect = store._db._writer.dialect
        self._real = self._dialect.do_commit
        self._dialect.do_commit = self._commit  # type: ignore

    def _commit(self, connection: Any) -> None:
        how = self.commits.pop(0) if self.commits else "arrives"
        if how == "never arrives":
            raise self._error(connection)
        self._real(connection)
        if how == "arrives unseen":
            raise self._error(connection)

    def _error(self, connection: Any) -> Exception:
        if self._dialect.name == "postgresql":
            connection.driver_connection.close()
            return psycopg.OperationalError("server closed the connection unexpectedly")
        error = sqlite3.OperationalError("database is locked")
        error.sqlite_errorcode = sqlite3.SQLITE_BUSY
        return error


Step = Callable[[World], Any]


def job_of(world: World) -> Job:
    (job,) = world.store.jobs("t", any_job(), 1, None).items
    return job


def any_job():
    from primray_service.store.base import JobFilter

    return JobFilter()


def frame_of(world: World) -> Frame:
    frame = world.store.frame(job_of(world).id, 0)
    assert frame is not None
    return frame


def checkpoint(world: World) -> bool:
    job_id = job_of(world).id
    return world.store.accept_checkpoint(world.fence, "c", job_id, 0, attempt=1, follows=0, file="f", now=world.now)


def due(world: World) -> str:
    return world.store.due_webhooks(world.fence, world.now, 1)[0].id


FIXED = new_job(ttl_s=100.0, labels={"a": "b"}, webhook=WEBHOOK)


def ready(world: World) -> None:
    world.ready_scene()


def made(world: World) -> None:
    ready(world)
    world.store.create_job(FIXED, [None, 1.0], ANY)


def claimed(world: World) -> None:
    made(world)
    world.claim()


def canceling(world: World) -> None:
    claimed(world)
    world.store.request_cancel(FIXED.id, world.tick())


def ended(world: World) -> None:
    claimed(world)
    world.end(world.claim().frame)
    world.end(frame_of(world))


def checking(world: World) -> None:
    world.store.put_scene(new_scene(), ANY)
    world.store.create_job(FIXED, [None], ANY)


def rejected(world: World) -> None:
    world.store.put_scene(new_scene(), ANY)
    world.store.scene_checked(world.fence, scene_id(), world.now, facts={}, warnings=[], problem={"type": "x"})


def half_ended(world: World) -> None:
    claimed(world)
    world.end(world.claim().frame)


OPERATIONS: dict[str, tuple[Step, Step]] = {
    "create_job": (ready, lambda w: w.store.create_job(FIXED, [None, 2.0], Quotas(queued_jobs=1))),
    "create_job with a key": (ready, lambda w: w.store.create_job(FIXED, [None], Quotas(queued_jobs=1), ("k", "r"))),
    "create_job of a rejected scene": (
        rejected,
        lambda w: w.store.create_job(FIXED, [None], ANY),
    ),
    "update_job": (made, lambda w: w.store.update_job(FIXED.id, w.now, version=1, changes={"priority": 9, "labels": {}})),
    "cancel a queued job": (made, lambda w: w.store.request_cancel(FIXED.id, w.now)),
    "cancel a running job": (claimed, lambda w: w.store.request_cancel(FIXED.id, w.now)),
    "continue_job": (ended, lambda w: w.store.continue_job(FIXED.id, {"max_samples": 9}, w.now, Quotas(queued_jobs=1))),
    "delete_job": (ended, lambda w: w.store.delete_job(FIXED.id)),
    "put_scene": (lambda w: None, lambda w: w.store.put_scene(new_scene(), Quotas(stored_bytes=10))),
    "delete_scene": (ready, lambda w: w.store.delete_scene("t", scene_id())),
    "scene_checked": (
        checking,
        lambda w: w.store.scene_checked(w.fence, scene_id(), w.now, facts={"a": 1}, warnings=[], problem=None),
    ),
    "scene_checked, rejected": (
        checking,
        lambda w: w.store.scene_checked(w.fence, scene_id(), w.now, facts={}, warnings=[], problem={"type": "x"}),
    ),
    "acquire_lease": (claimed, lambda w: w.store.acquire_lease("d2", T0 + 1e7, 10)),
    "renew_lease": (ready, lambda w: w.store.renew_lease(w.fence, w.now, 10)),
    "release_lease": (ready, lambda w: w.store.release_lease(w.fence)),
    "claim_frame": (made, lambda w: w.claim()),
    "claim_frames": (made, lambda w: w.store.claim_frames(w.fence, w.now, any_quotas, 9)),
    "report": (
        claimed,
        lambda w: w.store.report(
            w.fence,
            replace(frame_of(w), cpu_s=2.0),
            w.now,
            job_changes={"state": JobState.RUNNING, "progress": {"fraction": 0.5}},
            events=[("progress", {"fraction": 0.5})],
        ),
    ),
    "accept_checkpoint": (claimed, checkpoint),
    "end_frame": (claimed, lambda w: w.end(replace(frame_of(w), cpu_s=2.0))),
    "end_frame, the last": (
        half_ended,
        lambda w: w.end(replace(frame_of(w), cpu_s=2.0), FrameState.FAILED, error={"type": "x"}),
    ),
    "end_frame of a canceled job": (canceling, lambda w: w.end(frame_of(w), FrameState.CANCELED)),
    "requeue_frame": (claimed, lambda w: w.store.requeue_frame(w.fence, replace(frame_of(w), kills=1, cpu_s=2.0), w.now)),
    "requeue_frame of a canceled job": (canceling, lambda w: w.store.requeue_frame(w.fence, frame_of(w), w.now)),
    "expire": (claimed, lambda w: w.store.expire(w.fence, T0 + 1e6, 10)),
    "create_key": (ready, lambda w: w.store.create_key(KEY)),
    "revoke_key": (lambda w: w.store.create_key(KEY), lambda w: w.store.revoke_key(KEY.id, w.now)),
    "note_work": (
        lambda w: w.store.note_work(w.fence, "a", 1.0, T0, 2),
        lambda w: w.store.note_work(w.fence, "a", 2.0, w.now, 2),
    ),
    "end_session": (ready, lambda w: w.store.end_session("s", w.now + 10, w.now)),
    "webhook_tried": (
        ended,
        lambda w: w.store.webhook_tried(w.fence, due(w), state="due", next_at=w.now + 60, error="503"),
    ),
}

RANDOM = {("webhooks", "id"), ("frames", "claim")}  # made by chance each time


def contents(store: SqlStore) -> dict[str, list[dict[str, Any]]]:
    with store._db._reader.connect() as db:
        found = {}
        for table in schema.metadata.sorted_tables:
            rows = [dict(row._mapping) for row in db.execute(table.select())]
            for row in rows:
                for name in list(row):
                    if (table.name, name) in RANDOM:
                        row[name] = bool(row[name])
                if table.name == "events":
                    row.pop("id")  # a sequence does not go back
            found[table.name] = sorted(rows, key=repr)
    return found


@pytest.mark.parametrize("commits", [["arrives unseen"], ["never arrives"], ["never arrives", "arrives unseen"]], ids=" ".join)
@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_whose_commit_is_unsure(name: str, commits: list[str], store: SqlStore):
    prepare, operate = OPERATIONS[name]
    world = World(store)
    world.lead()
    prepare(world)
    world.now = T0 + 500.0
    broken = Broken(store)
    heard: list[str] = []
    store.subscribe(heard.append)
    broken.commits = list(commits)
    answer = operate(world)
    assert not broken.commits
    found = contents(store)
    expected_answer, expected, expected_heard = _undisturbed(name)
    assert answer == expected_answer
    assert found == expected
    assert set(heard) == set(expected_heard)


_known: dict[str, Any] = {}


def _undisturbed(name: str) -> Any:
    """What it answers, and leaves, when nothing breaks (over SQLite)."""
    if name not in _known:
        import tempfile

        from primray_service.store import open_store

        prepare, operate = OPERATIONS[name]
        with tempfile.TemporaryDirectory() as folder:
            store = open_store(f"sqlite:///{folder}/plain.sqlite")
            store.migrate()
            world = World(store)
            world.lead()
            prepare(world)
            world.now = T0 + 500.0
            heard: list[str] = []
            store.subscribe(heard.append)
            _known[name] = operate(world), contents(store), heard
            store.close()
    return _known[name]
