"""A dispatcher hears at once what servers that do not dispatch are asked for: previews, and that there is work."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import NO_QUOTAS, Rig, put_job
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker

from primray_service.dispatcher import Dispatcher, scheduler
from primray_service.jobs import JobState
from primray_service.limits import Limits
from primray_service.store import SqlStore, open_store

from ..postgres import postgres_databases, postgres_server, postgres_url

__all__ = ["postgres_databases", "postgres_server", "postgres_url"]


@pytest.fixture
def other(postgres_url: str) -> Iterator[SqlStore]:
    store = open_store(postgres_url)
    yield store
    store.close()


def only_answers(rig: Rig, executor: ScriptedExecutor, store: SqlStore) -> Dispatcher:
    """Another server's, over the same database, which does not get the lease."""
    found = Dispatcher(store, executor, rig.data, Limits(), lambda tenant: NO_QUOTAS)
    store.listen(found.on_notice)
    return found


async def both_listen(rig: Rig, other: SqlStore) -> None:
    rig.store.listen(rig.dispatcher.on_notice)
    for store in (rig.store, other):
        notices = store._db._notices  # type: ignore[attr-defined]
        assert notices is not None
        await rig.until(notices.is_listening.is_set)


def test_a_preview_that_another_server_is_asked_for(tmp_path: Path, postgres_url: str, other: SqlStore) -> None:
    workers: list[Worker] = []

    async def looks(worker: Worker) -> None:
        workers.append(worker)
        worker.sampling()
        while "preview" not in worker.told:
            await asyncio.sleep(0.01)
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        elsewhere = only_answers(rig, executor, other)
        await both_listen(rig, other)
        job = rig.submit(rig.scene())
        await rig.until(lambda: bool(workers))
        elsewhere.ask_preview(job.id, 0)
        [ended] = await rig.ended(job.id, timeout_s=20)
        assert ended.state is JobState.SUCCEEDED

    play(tmp_path, looks, act, url=postgres_url)


def test_work_that_another_server_takes_begins_at_once(
    tmp_path: Path, postgres_url: str, other: SqlStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scheduler, "LOOK_EVERY_S", 60.0)

    async def renders(worker: Worker) -> None:
        worker.sampling()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        elsewhere = only_answers(rig, executor, other)
        await both_listen(rig, other)
        scene = rig.scene()
        for _ in range(3):
            await asyncio.sleep(1.0)  # until nothing else has it look
            began = time.monotonic()
            job = put_job(other, scene)
            elsewhere.wake()
            await rig.ended(job.id, timeout_s=20)
            print("ended after", time.monotonic() - began)

    play(tmp_path, renders, act, url=postgres_url)
