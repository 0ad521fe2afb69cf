"""Claims a second against the length of the queue, and how long GET /v1/jobs/{id} of a waiting job takes meanwhile.

python -m tests.bench.service.claims [--database postgresql|sqlite] [--jobs 1e3 1e4 1e5 1e6] [--seconds 10]

One process claims as fast as it can, as the dispatcher does; a server in another, over the same database, answers clients.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import os
import random
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sqlalchemy import func, select, update
from tests.bench.results import write_results
from tests.bench.service.load import Connection, loop_delay, quantiles
from tests.bench.service.long_queues import NO_QUOTAS, database, lengthen, put_scenes, tenant_names
from tests.service.serving import start

from primray_service.auth import LOCAL_TENANT
from primray_service.store import SqlStore, open_store
from primray_service.store.database import schema

TENANTS = [LOCAL_TENANT, *tenant_names(99)]
AT_ONCE = (1, 10, 100)  # frames of one transaction: nodes that became free at a time
POLLERS, A_SECOND = 20, 2.0
Row = dict[str, Any]


def claim(url: str, seconds: float, most: int, at_once: int) -> Row:
    """Claims a second, until the time is over or so many are made; they wait again afterwards."""
    store = open_store(url)
    fence = store.acquire_lease("bench", time.time(), 3600.0)
    assert fence is not None
    made, took, cpu = 0, [], time.process_time()
    began = time.perf_counter()
    while (now := time.perf_counter()) < began + seconds and made < most:
        made += len(store.claim_frames(fence, time.time(), lambda tenant: NO_QUOTAS, at_once))
        took.append(time.perf_counter() - now)
    passed, cpu = time.perf_counter() - began, time.process_time() - cpu
    store.release_lease(fence)
    _give_back(store)
    store.close()
    rate = {"claims": made, "claims_a_second": round(made / passed, 1), "cpu_ms_a_claim": round(1000 * cpu / max(made, 1), 2)}
    return {"at_once": at_once, **rate, "transaction": quantiles(took)}


def _give_back(store: SqlStore) -> None:
    """All at once: by the store's own operation it would take longer than what is measured."""
    jobs, frames, counts = schema.jobs, schema.frames, schema.job_counts
    waiting = {"frames_queued": 1, "frames_running": 0, "queue_rank": -jobs.c.priority}
    number = select(func.count()).where(jobs.c.tenant == counts.c.tenant, jobs.c.state == counts.c.state).scalar_subquery()

    def work(db: Any) -> None:
        db.execute(update(frames).where(frames.c.state == "running").values(state="queued", claim=""))
        db.execute(update(jobs).where(jobs.c.state == "preparing").values(state="queued", **waiting))
        db.execute(update(counts).values(jobs=number))

    store._db.write_plainly(work)


async def _poll(url: str, job_ids: Sequence[str], until: float, took: list[float], errors: list[str]) -> None:
    connection = Connection(url)
    await asyncio.sleep(random.random() / A_SECOND)
    await connection.open()
    while (now := time.perf_counter()) < until:
        status = await connection.send(f"/v1/jobs/{random.choice(job_ids)}")
        body = await connection.body()
        took.append(time.perf_counter() - now)
        if status != 200 or b'"object":"job"' not in body:
            errors.append(f"{status} {body[:100]!r}")
        await asyncio.sleep(max(0.0, now + 1 / A_SECOND - time.perf_counter()))
    connection.close()


async def _gets(url: str, job_ids: Sequence[str], seconds: float) -> Row:
    took: list[float] = []
    errors: list[str] = []
    late: list[float] = []
    until = time.perf_counter() + seconds
    await asyncio.gather(*(_poll(url, job_ids, until, took, errors) for _ in range(POLLERS)), loop_delay(until, late))
    return {**quantiles(took), "errors": errors[:3], "client loop_delay p99_ms": quantiles(late)["p99_ms"]}


def measure(url: str, server: str, store: SqlStore, jobs: int, seconds: float) -> Row:
    lengthen(store, TENANTS, jobs)
    with store._db._reader.connect() as db:
        job_ids = db.execute(select(schema.jobs.c.id).where(schema.jobs.c.tenant == LOCAL_TENANT).limit(5000)).scalars().all()
    asyncio.run(_gets(server, job_ids, 1.0))  # what is read first is read once
    row: Row = {"waiting": store.counts()["queued"], "GET job, nobody claims": asyncio.run(_gets(server, job_ids, seconds))}
    began = time.perf_counter()
    store.queue(10_000)
    row["places_s"] = round(time.perf_counter() - began, 3)
    row["alone"] = [claim(url, seconds, jobs // 2, at_once) for at_once in AT_ONCE]
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        claiming = pool.apply_async(claim, (url, seconds, jobs // 2, AT_ONCE[-1]))
        row["GET job meanwhile"] = asyncio.run(_gets(server, job_ids, seconds))
        row["asked meanwhile"] = claiming.get()
    return row | {"load_average": os.getloadavg()}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.service.claims", description=__doc__)
    parser.add_argument("--database", choices=["postgresql", "sqlite"], default="postgresql")
    parser.add_argument("--jobs", type=float, nargs="+", default=[1e3, 1e4, 1e5, 1e6])
    parser.add_argument("--seconds", type=float, default=10)
    options = parser.parse_args()
    rows = []
    with database(options.database) as url, TemporaryDirectory() as folder:
        store = open_store(url)
        put_scenes(store, TENANTS)
        server = start(Path(folder) / "data", database=url, dispatch=False, warm=False)
        try:
            for jobs in map(int, options.jobs):
                row = measure(url, server.url, store, jobs, options.seconds)
                print(json.dumps(row), flush=True)
                rows.append(row)
        finally:
            server.stop()
            store.close()
    print(f"written: {write_results(f'service_claims_{options.database}', rows).name}")


if __name__ == "__main__":
    main()
