"""What the service takes while it renders: 200 clients that poll GET /v1/jobs/{id} once a second, 50 event streams; then what
10,000 queued jobs do to submitting, listing and claiming. `python -m tests.bench.service.load [--seconds N] [--jobs N]`.

Clients and server share the machine's cores, as does the renderer, whose workers are nice. `loop_delay`: how late the
clients' own event loop is, which is in what they measure.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import re
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx2
from tests.bench.results import write_results
from tests.service.api_calls import ENDLESS, stored, submit, upload
from tests.service.serving import RunningServer, start

from primray_service.limits import Quotas
from primray_service.store import open_store

POLLERS, STREAMS = 200, 50
BURST = 20  # requests timed at each number of queued jobs
BUSY = {**ENDLESS, "resolution": [1024, 768]}

Row = dict[str, Any]


@contextmanager
def serving(**settings: Any) -> Iterator[RunningServer]:
    with tempfile.TemporaryDirectory() as folder:
        server = start(Path(folder) / "data", **settings)
        try:
            yield server
        finally:
            server.stop()


def quantiles(seconds: list[float]) -> Row:
    ordered = sorted(seconds)

    def at(part: float) -> float:
        return round(1000 * ordered[min(len(ordered) - 1, int(part * len(ordered)))], 2)

    return {"count": len(ordered), "p50_ms": at(0.5), "p90_ms": at(0.9), "p99_ms": at(0.99), "max_ms": at(1.0)}


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Connection:
    """Just enough of HTTP/1.1 for a few hundred of them to cost little: what is measured is to be the server."""

    def __init__(self, url: str) -> None:
        self._host, _, port = url.removeprefix("http://").partition(":")
        self._port = int(port)

    async def open(self) -> None:
        self._reader, self._writer = await asyncio.open_connection(self._host, self._port)

    async def send(self, path: str, accept: str = "*/*") -> int:
        """The answer's status."""
        self._writer.write(f"GET {path} HTTP/1.1\r\nhost: {self._host}\r\naccept: {accept}\r\n\r\n".encode())
        return await self.head()

    async def head(self) -> int:
        head = await self._reader.readuntil(b"\r\n\r\n")
        self._length = int(found[1]) if (found := re.search(rb"content-length: (\d+)", head)) else 0
        return int(head[9:12])

    async def body(self) -> bytes:
        return await self._reader.readexactly(self._length)

    async def lines(self) -> AsyncIterator[bytes]:
        while line := await self._reader.readline():
            yield line

    def close(self) -> None:
        self._writer.close()


async def poll(url: str, path: str, until: float, took: list[float], errors: list[str]) -> None:
    connection = Connection(url)
    await asyncio.sleep(random.random())
    await connection.open()
    while (now := time.perf_counter()) < until:
        status = await connection.send(path)
        body = await connection.body()
        took.append(time.perf_counter() - now)
        if status != 200 or b'"object":"job"' not in body:
            errors.append(f"{status} {body[:200]!r}")
        await asyncio.sleep(max(0.0, now + 1 - time.perf_counter()))
    connection.close()


async def listen(url: str, path: str, until: float, heard: list[str], errors: list[str]) -> None:
    connection = Connection(url)
    await connection.open()
    with suppress(TimeoutError):
        async with asyncio.timeout(max(0.1, until - time.perf_counter())):
            status = await connection.send(path, "text/event-stream")
            async for line in connection.lines():
                if line.startswith(b"event: "):
                    heard.append(line.decode())
            errors.append(f"a stream ended, {status}")
    connection.close()


async def loop_delay(until: float, late: list[float]) -> None:
    while time.perf_counter() < until:
        asked = time.perf_counter()
        await asyncio.sleep(0.01)
        late.append(time.perf_counter() - asked - 0.01)


async def load(url: str, paths: list[str], seconds: float) -> Row:
    """Of paths[0], which renders, everybody wants to know; the rest are asked for by some."""
    took: list[float] = []
    heard: list[str] = []
    errors: list[str] = []
    late: list[float] = []
    until = time.perf_counter() + seconds
    tasks = [poll(url, paths[number % len(paths)], until, took, errors) for number in range(POLLERS)]
    tasks += [listen(url, f"{paths[number % len(paths)]}/events", until, heard, errors) for number in range(STREAMS)]
    for ended in await asyncio.gather(*tasks, loop_delay(until, late), return_exceptions=True):
        if ended is not None:
            errors.append(repr(ended))
    return {
        "pollers": POLLERS,
        "streams": STREAMS,
        "seconds": seconds,
        "GET job": quantiles(took),
        "client loop_delay": quantiles(late),
        "events": len(heard),
        "errors": errors[:5],
        "error_count": len(errors),
    }


def under_load(seconds: float, several: bool) -> Row:
    with serving() as server:
        client = server.client()
        scene = upload(client)
        jobs = [submit(client, scene, BUSY)["id"] for _ in range(20 if several else 1)]
        while client.get(f"/v1/jobs/{jobs[0]}").json()["state"] != "running":
            time.sleep(0.05)
        before = cpu_s(server.process.pid)
        row = asyncio.run(load(server.url, [f"/v1/jobs/{job}" for job in jobs], seconds))
        row["server_cpu_share"] = round((cpu_s(server.process.pid) - before) / seconds, 3)
        row["rendered_samples"] = client.get(f"/v1/jobs/{jobs[0]}").json()["progress"].get("samples_done")
        return {"what": f"polls and streams of {len(jobs)} job(s) while one renders", **row}


def timed(client: httpx2.Client, method: str, path: str, **options: Any) -> float:
    began = time.perf_counter()
    answer = client.request(method, path, **options)
    assert answer.status_code < 300, answer.text
    return time.perf_counter() - began


def with_many_jobs(most: int) -> list[Row]:
    """Queued only: nothing renders. Claims are timed on the store itself, as the dispatcher makes them."""
    rows = []
    with serving(dispatch=False, warm=False) as server:
        client = server.client()
        scene = stored(client)
        body = {"scene": {"id": scene}, "settings": {"frames": "1:3"}, "labels": {"shot": "1"}}
        made = 0
        for count in (step for step in (100, 1_000, 10_000) if step <= most):
            while made < count - BURST:
                timed(client, "POST", "/v1/jobs", json={**body, "labels": {"shot": str(made % 100)}})
                made += 1
            posts = [timed(client, "POST", "/v1/jobs", json=body) for _ in range(BURST)]
            made += BURST
            page = client.get("/v1/jobs?limit=50&order=asc").json()
            for _ in range(min(5, count // 100)):
                page = client.get(f"/v1/jobs?limit=50&order=asc&cursor={page['next_cursor']}").json()
            deep = f"/v1/jobs?limit=50&order=asc&cursor={page['next_cursor']}" if page["next_cursor"] else "/v1/jobs"
            job = page["items"][0]["id"]
            rows.append(
                {
                    "what": f"{count} queued jobs",
                    "POST job": quantiles(posts),
                    "GET 50 newest": quantiles([timed(client, "GET", "/v1/jobs?limit=50") for _ in range(BURST)]),
                    "GET 50 of a later page": quantiles([timed(client, "GET", deep) for _ in range(BURST)]),
                    "GET 50 by label": quantiles(
                        [timed(client, "GET", "/v1/jobs?limit=50&label=shot:7") for _ in range(BURST)]
                    ),
                    "GET 50 canceled (none)": quantiles(
                        [timed(client, "GET", "/v1/jobs?limit=50&state=canceled") for _ in range(BURST)]
                    ),
                    "GET job": quantiles([timed(client, "GET", f"/v1/jobs/{job}") for _ in range(BURST)]),
                    "claim": quantiles(list(claims(server, scene))),
                }
            )
    return rows


def claims(server: RunningServer, scene: str) -> Iterator[float]:
    """Each is given back, so that the number of queued jobs stays."""
    store = open_store(f"sqlite:///{server.data / 'primray.sqlite'}")
    now = time.time()
    fence = store.acquire_lease("bench", now, 60)
    assert fence is not None
    store.scene_checked(fence, scene, now, facts={}, warnings=[], problem=None)
    for _ in range(BURST):
        began = time.perf_counter()
        claim = store.claim_frame(fence, time.time(), lambda tenant: Quotas())
        yield time.perf_counter() - began
        assert claim is not None
        store.requeue_frame(fence, claim.frame, time.time())
    store.release_lease(fence)
    store.close()


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.service.load", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--jobs", type=int, default=10_000, help="0: only the load")
    options = parser.parse_args()
    rows = [under_load(options.seconds, several) for several in (False, True)] + with_many_jobs(options.jobs)
    for row in rows:
        print(json.dumps(row, indent=1))
    machine = {"load_average": os.getloadavg(), "cores": os.cpu_count(), "nice": os.nice(0)}
    path = write_results("service_load", [machine, *rows])
    print(f"written: {path.relative_to(Path.cwd())}")
    print(f"worst p99 of GET job: {max(row['GET job']['p99_ms'] for row in rows)} ms")


if __name__ == "__main__":
    main()
