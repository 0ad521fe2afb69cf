"""A run: jobs of many tenants, a dispatcher that dies half way, another that goes on, and what must hold of the rows then."""

from __future__ import annotations

import asyncio
import shutil
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sqlalchemy import func, select
from tests.bench.service.long_queues import NO_QUOTAS, add_jobs, analyze, put_scenes, tenant_names
from tests.bench.service.simulation.fleet import Chances, Fleet
from tests.bench.service.simulation.simulated_time import simulated_time

from primray_service.dispatcher import Dispatcher
from primray_service.files import DataDirectory
from primray_service.limits import Limits
from primray_service.store import SqlStore, open_store
from primray_service.store.database import schema

LOOK_S = 5.0  # of the simulated clock
LARGE = 0.1  # of the tenants: they bring half of the frames

Row = dict[str, Any]


@dataclass(frozen=True)
class Farm:
    nodes: int
    tenants: int
    frames: int
    frames_a_job: int = 200
    chances: Chances = field(default_factory=Chances)
    seed: int = 1


def fill(store: SqlStore, farm: Farm) -> Mapping[str, str]:
    """Whose each job is. Some tenants bring many more frames than others."""
    tenants = tenant_names(farm.tenants)
    put_scenes(store, tenants)
    large = max(int(LARGE * len(tenants)), 1)
    jobs = farm.frames // farm.frames_a_job
    for number, tenant in enumerate(tenants):
        group, of = (jobs // 2, large) if number < large else (jobs - jobs // 2, len(tenants) - large)
        at = number if number < large else number - large
        add_jobs(store, tenant, group * (at + 1) // of - group * at // of, farm.frames_a_job)
    analyze(store)
    with store._db._reader.connect() as db:
        return {row.id: row.tenant for row in db.execute(select(schema.jobs.c.id, schema.jobs.c.tenant))}


@dataclass
class Watch:
    """What is seen while it runs. `spread`: of tenants for whom frames wait, the most nodes less the fewest."""

    fleet: Fleet
    spread: Counter[int] = field(default_factory=Counter)
    busy: list[float] = field(default_factory=list)

    def look(self, waiting: Mapping[str, int]) -> None:
        """`waiting`: frames, by tenant."""
        names = [name for name, frames in waiting.items() if frames > 0]
        nodes = self.fleet.seen.of_tenant
        if names:
            self.busy.append(nodes.total() / self.fleet.capacity().slots)
        slots = self.fleet.capacity().slots
        if len(names) > 1 and sum(waiting.values()) > slots == nodes.total():  # not while they are being filled
            held = [nodes[name] for name in names]
            self.spread[max(held) - min(held)] += 1


def simulate(url: str, root: Path, farm: Farm, *, most_s: float = 1e9, takeovers: int = 1) -> Row:
    """At most so many real seconds. The figures, and under "wrong" what does not hold."""
    store = open_store(url)
    data = DataDirectory(root)
    data.create()
    tenants = fill(store, farm)
    _write_scene(data, store)
    with simulated_time() as loop:
        fleet = Fleet(data, farm.nodes, farm.chances, tenants, farm.seed)
        watch = Watch(fleet)
        began, cpu = time.perf_counter(), time.process_time()
        figures = loop.run_until_complete(_run(store, data, fleet, watch, most_s, takeovers, farm.frames))
        took = time.perf_counter() - began
        figures |= {"real_s": round(took, 1), "simulated_s": round(loop.time()), "cpu_s": round(time.process_time() - cpu, 1)}
    found = {"frames_a_second": round(fleet.seen.ends.total() / took, 1), **figures}
    ends = {"ends": dict(fleet.seen.ends), "most_running": fleet.seen.most, "spread": dict(sorted(watch.spread.items()))}
    used = round(sum(watch.busy) / max(len(watch.busy), 1), 4)
    wrong = broken(store, fleet, farm)
    store.close()
    return asdict(farm) | found | ends | {"nodes_used": used, "frames_by_state": figures["states"], "wrong": wrong}


def _write_scene(data: DataDirectory, store: SqlStore) -> None:
    with store._db._reader.connect() as db:
        scene_id = db.execute(select(schema.scenes.c.id)).scalars().first()
    assert scene_id is not None
    folder = data.scene(scene_id)
    folder.mkdir(parents=True)
    (folder / "upload").write_bytes(b"#usda 1.0\n")


async def _run(
    store: SqlStore, data: DataDirectory, fleet: Fleet, watch: Watch, most_s: float, takeovers: int, frames: int
) -> Row:
    limits = Limits(free_disk_bytes=0)
    began, deaths = time.perf_counter(), takeovers
    until = began + most_s
    states: Counter[str] = Counter()
    metrics = []
    while True:
        dispatcher = Dispatcher(store, fleet, data, limits, lambda tenant: NO_QUOTAS)
        metrics.append(dispatcher.metrics)
        running = asyncio.create_task(dispatcher.run())
        part = (takeovers - deaths + 1) / (takeovers + 1) if deaths else 1.0  # of the frames, or of the time
        while time.perf_counter() < until and not running.done():
            await asyncio.sleep(LOOK_S)
            states, waiting = await asyncio.to_thread(frames_by_state, store)
            watch.look(waiting)
            await asyncio.to_thread(_forget_files, data, store)
            ended = states["succeeded"] + states["failed"]
            if ended >= frames * part or time.perf_counter() >= began + most_s * part:
                break
        if states["queued"] + states["running"] == 0 or time.perf_counter() >= until or running.done():
            break
        deaths -= 1
        running.cancel()  # as if it was killed: nothing more is written, and the next one waits for its lease to run out
        await asyncio.wait([running])
    await dispatcher.stop()
    await running
    started = sum(one.frames_started for one in metrics)
    states, _ = await asyncio.to_thread(frames_by_state, store)
    restarts = sum((one.restarts for one in metrics), Counter[str]())
    return {"claims": started, "restarts": dict(restarts), "dispatchers": len(metrics), "states": dict(states)}


def frames_by_state(store: SqlStore) -> tuple[Counter[str], Mapping[str, int]]:
    """All, and those that wait by tenant; by the sums that are kept."""
    jobs = schema.jobs
    names = ("queued", "running", "succeeded", "failed", "canceled")
    sums = [func.sum(jobs.c[f"frames_{name}"]).label(name) for name in names]
    with store._db._reader.connect() as db:
        rows = list(db.execute(select(jobs.c.tenant, *sums).group_by(jobs.c.tenant)))
    states = Counter({name: int(sum(getattr(row, name) for row in rows)) for name in names})
    return states, {row.tenant: int(row.queued) for row in rows}


def _forget_files(data: DataDirectory, store: SqlStore) -> None:
    """Of jobs that ended: a farm's clients fetch them, and a bench has no room for a million pictures."""
    for folder in data.jobs.iterdir():
        job = store.job(folder.name)
        if job is not None and job.finished_at is not None:
            shutil.rmtree(folder, ignore_errors=True)


def broken(store: SqlStore, fleet: Fleet, farm: Farm) -> list[str]:
    """What does not hold, of frames that are to be rendered once, all, and by one node at a time."""
    frames, outputs, events, jobs = schema.frames, schema.outputs, schema.events, schema.jobs
    wrong = []
    with store._db._reader.connect() as db:
        by_state = select(frames.c.state, func.count().label("number")).group_by(frames.c.state)
        states: dict[str, int] = {row.state: row.number for row in db.execute(by_state)}
        told, _ = frames_by_state(store)
        if sum(states.values()) != told.total() or any(states.get(name, 0) != told[name] for name in told):
            wrong.append(f"jobs say {dict(told)}, frames {states}")
        if told.total() != (farm.frames // farm.frames_a_job) * farm.frames_a_job:
            wrong.append(f"{told.total()} frames are there")
        pictures = db.execute(select(func.count()).select_from(outputs)).scalar_one()
        if pictures != states.get("succeeded", 0):
            wrong.append(f"{pictures} pictures of {states.get('succeeded', 0)} frames")
        ends = select(events.c.job_id, events.c.data).where(
            events.c.type == "frame", events.c.data.contains('"succeeded"', autoescape=True)
        )
        twice = db.execute(
            select(func.count()).select_from(ends.group_by(events.c.job_id, events.c.data).having(func.count() > 1).subquery())
        )
        if number := twice.scalar_one():
            wrong.append(f"{number} frames succeeded twice")
        running = select(func.count()).select_from(jobs).where(jobs.c.frames_running > 0)
        if number := db.execute(running).scalar_one():
            wrong.append(f"{number} jobs have frames that run still")
    if states.get("succeeded", 0) > len(fleet.seen.done):
        wrong.append(f"{states['succeeded']} frames succeeded, and {len(fleet.seen.done)} were rendered")
    if states.get("failed", 0) != len(fleet.seen.refused):
        wrong.append(f"{states.get('failed', 0)} frames failed, and {len(fleet.seen.refused)} cannot be rendered")
    if fleet.seen.twice:
        wrong.append(f"{fleet.seen.twice} frames ran on two nodes at once")
    return wrong
