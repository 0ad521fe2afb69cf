"""Scenes, jobs and frames for the store's tests, and what must hold of a database at any time."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import func, select

from primray_service.ids import ulid
from primray_service.jobs import TERMINAL, Frame, FrameState, Job, JobState, Output, Scene, SceneState
from primray_service.limits import Quotas
from primray_service.store import SqlStore
from primray_service.store.base import Claim
from primray_service.store.database import schema

T0 = 1_800_000_000.0
ANY = Quotas(queued_jobs=None, stored_bytes=None)
_numbers = itertools.count(1)


def any_quotas(tenant: str) -> Quotas:
    return ANY


def scene_id(name: str = "a") -> str:
    return f"sha256:{name * 64}"


def new_scene(tenant: str = "t", name: str = "a", at: float = T0, stored_bytes: int = 10, **values: Any) -> Scene:
    made = Scene(scene_id(name), tenant, SceneState.CHECKING, "usda", "shot.usda", stored_bytes, stored_bytes, at, at)
    return replace(made, **values)


def new_job(tenant: str = "t", at: float = T0, scene: str = "a", ttl_s: float = 1000.0, **values: Any) -> Job:
    job_id = f"job_{ulid(at, next(_numbers).to_bytes(10))}"
    settings = {"stop": {"max_samples": 64}}
    made = Job(job_id, tenant, JobState.QUEUED, scene_id(scene), None, settings, at, at, at + ttl_s, ttl_s)
    return replace(made, **values)


@dataclass
class World:
    """A store, a dispatcher's fence, and shorthand for what tests do all the time. Time goes on by itself."""

    store: SqlStore
    fence: int = 0
    now: float = T0
    scenes: set[tuple[str, str]] = field(default_factory=set)

    def tick(self, seconds: float = 1.0) -> float:
        self.now += seconds
        return self.now

    def lead(self, holder: str = "d1", ttl_s: float = 1e6) -> int:
        fence = self.store.acquire_lease(holder, self.tick(), ttl_s)
        assert fence is not None
        self.fence = fence
        return fence

    def ready_scene(self, tenant: str = "t", name: str = "a") -> None:
        if (tenant, name) not in self.scenes:
            self.scenes.add((tenant, name))
            self.store.put_scene(new_scene(tenant, name, self.tick()), ANY)
            self.store.scene_checked(self.fence, scene_id(name), self.tick(), facts={}, warnings=[], problem=None)

    def job(self, tenant: str = "t", frames: int = 1, scene: str = "a", **values: Any) -> Job:
        """A queued job of a scene that is ready."""
        self.ready_scene(tenant, scene)
        times = [float(number) for number in range(frames)]
        job, is_new = self.store.create_job(new_job(tenant, self.tick(), scene, **values), times, ANY)
        assert is_new
        return job

    def claim(self) -> Claim:
        claim = self.store.claim_frame(self.fence, self.tick(), any_quotas)
        assert claim is not None
        return claim

    def claims_nothing(self) -> bool:
        return self.store.claim_frame(self.fence, self.tick(), any_quotas) is None

    def begin(self, frame: Frame, **job_changes: Any) -> Job:
        return self.store.report(self.fence, frame, self.tick(), job_changes={"state": JobState.RUNNING, **job_changes})

    def end(self, frame: Frame, state: FrameState = FrameState.SUCCEEDED, **job_changes: Any) -> Job:
        outputs = [Output(frame.job_id, f"frame.{frame.number}.exr", frame.number, 100, "ab" * 32, "image/x-exr", self.now)]
        ended = replace(frame, state=state)
        made = outputs if state == FrameState.SUCCEEDED else []
        return self.store.end_frame(self.fence, ended, self.tick(), outputs=made, job_changes=job_changes)

    def finished(self, tenant: str = "t", **values: Any) -> Job:
        self.job(tenant, **values)
        return self.end(self.claim().frame)

    def get(self, job: Job) -> Job:
        found = self.store.job(job.id)
        assert found is not None
        return found

    def scene(self, tenant: str = "t", name: str = "a") -> Scene:
        found = self.store.scene(tenant, scene_id(name))
        assert found is not None
        return found

    def claim_within(self, quotas_of: Any) -> Claim:
        claim = self.store.claim_frame(self.fence, self.tick(), quotas_of)
        assert claim is not None
        return claim

    def states(self, job: Job) -> list[str]:
        return [event.data["state"] for event in self.store.events(job.id, 0, 10_000) if event.type == "state"]


def broken_rules(store: SqlStore) -> list[str]:
    """What does not hold, of all that always must: sums are what they sum up, states of jobs and frames fit."""
    with store._db._reader.connect() as db:
        return [*_wrong_jobs(db), *_wrong_sums(db), *_wrong_events(db)]


def _wrong_jobs(db: Any) -> list[str]:
    jobs, frames = schema.jobs, schema.frames
    wrong = []
    counted: dict[str, dict[str, int]] = {}
    for job_id, state, number in db.execute(
        select(frames.c.job_id, frames.c.state, func.count()).group_by(frames.c.job_id, frames.c.state)
    ):
        counted.setdefault(job_id, {})[state] = number
    ready = {(row.tenant, row.id) for row in db.execute(select(schema.scenes)) if row.state == SceneState.READY}
    for row in db.execute(select(jobs)):
        states = counted[row.id]
        stored = {state.value: row._mapping[f"frames_{state}"] for state in FrameState}
        if {state: number for state, number in stored.items() if number} != states:
            wrong.append(f"{row.id} counts {stored}, has {states}")
        running, queued = states.get("running", 0), states.get("queued", 0)
        may = row.state in ("preparing", "running", "canceling", "pausing")
        must = row.state in ("canceling", "pausing")
        if (running and not may) or (must and not running):
            wrong.append(f"{row.id} is {row.state} with {running} frames that run")
        if row.state in TERMINAL and (queued or row.finished_at is None):
            wrong.append(f"{row.id} is {row.state} with {queued} frames queued, ended {row.finished_at}")
        if row.state not in TERMINAL and not queued + running:
            wrong.append(f"{row.id} is {row.state}, and no frame of it is left")
        may_run = row.state in ("queued", "preparing", "running") and queued and row.scene_ready
        if row.queue_rank != (-row.priority if may_run else None):
            wrong.append(f"{row.id} ({row.state}, {queued} queued) has rank {row.queue_rank}")
        if row.scene_ready and row.state not in TERMINAL and (row.tenant, row.scene_id) not in ready:
            wrong.append(f"{row.id} thinks that its scene is ready")
    return wrong


def _wrong_sums(db: Any) -> list[str]:
    jobs = schema.jobs
    real = {
        (tenant, state): number
        for tenant, state, number in db.execute(
            select(jobs.c.tenant, jobs.c.state, func.count()).group_by(jobs.c.tenant, jobs.c.state)
        )
    }
    kept = {(row.tenant, row.state): row.jobs for row in db.execute(select(schema.job_counts)) if row.jobs}
    stored: dict[str, int] = {}
    for tenant, number in db.execute(select(schema.scenes.c.tenant, schema.scenes.c.stored_bytes)):
        stored[tenant] = stored.get(tenant, 0) + number
    for tenant, number in db.execute(select(jobs.c.tenant, schema.outputs.c.bytes).join(jobs)):
        stored[tenant] = stored.get(tenant, 0) + number
    for tenant, number in db.execute(select(schema.contents.c.tenant, schema.contents.c.bytes)):
        stored[tenant] = stored.get(tenant, 0) + number
    said = {row.tenant: row.stored_bytes for row in db.execute(select(schema.tenants)) if row.stored_bytes}
    days: dict[str, float] = {}
    for row in db.execute(select(schema.usage_days)):
        days[row.tenant] = days.get(row.tenant, 0.0) + row.cpu_s
    totals = {row.tenant: row.cpu_s for row in db.execute(select(schema.tenants)) if row.cpu_s}
    return [
        *([f"job counts {kept}, really {real}"] if kept != real else []),
        *([f"stored bytes {said}, really {stored}"] if said != {k: v for k, v in stored.items() if v} else []),
        *([f"CPU by day {days}, in all {totals}"] if {k: round(v, 6) for k, v in days.items()} != totals else []),
    ]


def _wrong_events(db: Any) -> list[str]:
    """The states told are legal moves and lead to the job's state; a job that ended says so once an attempt."""
    from primray_service.jobs import is_legal

    wrong = []
    events, jobs = schema.events, schema.jobs
    told: dict[str, list[Any]] = {}
    for row in db.execute(select(events).order_by(events.c.id)):
        told.setdefault(row.job_id, []).append(row)
    for job_id, state in db.execute(select(jobs.c.id, jobs.c.state)):
        states = [JobState(row.data["state"]) for row in told.get(job_id, []) if row.type == "state"]
        if not states or states[0] != JobState.QUEUED or states[-1] != state:
            wrong.append(f"{job_id} is {state}, told {states}")
        wrong += [f"{job_id}: {a} -> {b}" for a, b in itertools.pairwise(states) if not is_legal(a, b)]
        ends = [row.data["state"] for row in told.get(job_id, []) if row.type == "end"]
        if ends != [s for s in states if s in TERMINAL]:
            wrong.append(f"{job_id} ended {ends}, was {states}")
    return wrong
