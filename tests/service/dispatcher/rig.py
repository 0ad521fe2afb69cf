"""A dispatcher over a real store, in the test's own event loop; scenes and jobs for it."""

from __future__ import annotations

import asyncio
import hashlib
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from primray_service import ids
from primray_service.api.models import Settings
from primray_service.dispatcher import Dispatcher
from primray_service.executor.base import Executor
from primray_service.files import DataDirectory
from primray_service.jobs import TERMINAL, Event, Frame, Job, JobState, Json, Output, Scene, SceneState
from primray_service.limits import Limits, Quotas
from primray_service.scenes.preparing import locked
from primray_service.store import open_store
from primray_service.store.base import Store

NO_QUOTAS = Quotas(queued_jobs=None, stored_bytes=None)


@dataclass
class Rig:
    store: Store
    data: DataDirectory
    executor: Executor
    limits: Limits
    dispatcher: Dispatcher
    look_every_s: float = 0.01

    def job(self, job_id: str) -> Job:
        job = self.store.job(job_id)
        assert job is not None
        return job

    def frame(self, job_id: str, number: int = 0) -> Frame:
        frame = self.store.frame(job_id, number)
        assert frame is not None
        return frame

    def events(self, job_id: str, kind: str | None = None) -> list[Event]:
        return [event for event in self.store.events(job_id, 0, 10_000) if kind in (None, event.type)]

    def outputs(self, job_id: str) -> Sequence[Output]:
        """As the rows say; each file is there and has its digest."""
        rows = self.store.outputs(job_id)
        for row in rows:
            body = (self.data.outputs(job_id) / row.name).read_bytes()
            assert (len(body), hashlib.sha256(body).hexdigest()) == (row.bytes, row.sha256), row.name
        return rows

    async def until(self, holds: Callable[[], bool], timeout_s: float = 90.0) -> None:
        until = time.monotonic() + timeout_s
        while not await asyncio.to_thread(holds):
            assert time.monotonic() < until, "it did not come to that in time"
            await asyncio.sleep(self.look_every_s)

    async def ended(self, *job_ids: str, timeout_s: float = 90.0) -> list[Job]:
        await self.until(lambda: all(self.job(job_id).state in TERMINAL for job_id in job_ids), timeout_s)
        return [self.job(job_id) for job_id in job_ids]

    def scene(self, body: bytes = b"#usda 1.0\n", tenant: str = "studio", *, ready: bool = True) -> Scene:
        return put_scene(self.store, self.data, body, tenant, ready=ready)

    def submit(self, scene: Scene, **asked: object) -> Job:
        job = put_job(self.store, scene, **asked)  # type: ignore[arg-type]
        self.dispatcher.wake()
        return job


def put_scene(store: Store, data: DataDirectory, body: bytes, tenant: str, *, ready: bool) -> Scene:
    scene_id = f"sha256:{hashlib.sha256(body).hexdigest()}"
    now = time.time()
    state = SceneState.READY if ready else SceneState.CHECKING
    scene = Scene(scene_id, tenant, state, "usda", "scene.usda", len(body), len(body), now, now)
    with locked(data):  # or the sweep of a dispatcher that begins would take its files away
        folder = data.scene(scene_id)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "upload").write_bytes(body)
        return store.put_scene(scene, NO_QUOTAS)[0]


def put_job(
    store: Store,
    scene: Scene,
    *,
    settings: Json | None = None,
    time_codes: Sequence[float | None] = (None,),
    priority: int = 50,
    ttl_s: float = 3600.0,
    parallel: int | str | None = None,
) -> Job:
    now = time.time()
    asked = Settings.model_validate(settings or {}, strict=False).model_dump(mode="json")
    job = Job(
        id=ids.job_id(now),
        tenant=scene.tenant,
        state=JobState.QUEUED,
        scene_id=scene.id,
        entry=None,
        settings=asked,
        created_at=now,
        queued_at=now,
        expires_at=now + ttl_s,
        ttl_s=ttl_s,
        priority=priority,
        parallel=parallel,
    )
    return store.create_job(job, time_codes, NO_QUOTAS)[0]


MakeExecutor = Callable[[DataDirectory, Limits], Executor]


@asynccontextmanager
async def dispatching(
    root: Path, make_executor: MakeExecutor, *, url: str | None = None, limits: Limits | None = None, **changes: object
) -> AsyncIterator[Rig]:
    """A dispatcher at work over the data directory; stopped as a server would afterwards. `changes` are of limits."""
    data = DataDirectory(root / "data")
    data.create()
    store = open_store(url or f"sqlite:///{root / 'data' / 'primray.sqlite'}")
    store.migrate()
    chosen = replace(limits or Limits(free_disk_bytes=0), **changes)  # type: ignore[arg-type]
    executor = make_executor(data, chosen)
    await executor.start()
    dispatcher = Dispatcher(store, executor, data, chosen, lambda tenant: NO_QUOTAS)
    running = asyncio.create_task(dispatcher.run())
    try:
        yield Rig(store, data, executor, chosen, dispatcher)
    finally:
        await asyncio.wait_for(dispatcher.stop(), 60)
        await running
        await executor.close()
        store.close()
