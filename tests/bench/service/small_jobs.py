"""Small jobs by the thousand: clients that each upload a new stage, ask for 64 x 48 pixels at 4 samples and fetch the PNG; and
one 32 x 32 picture of an uploaded stage on an idle server.

python -m tests.bench.service.small_jobs [--clients 8 64] [--lead-in 8] [--seconds 20] [--rounds 9] [--slots N]

Clients, server and workers share the machine, so what matters beside jobs a second is CPU seconds a job: of the server's
process, of all its other processes (workers, and what starts them), of the clients. They come from a control group of the
server, which needs the right to make one (cgroup v1 or v2); without it those columns are missing.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.bench.results import write_results
from tests.bench.service.load import Connection, cpu_s, quantiles, serving
from tests.service.api_calls import SCENE, Json, upload
from tests.service.serving import RunningServer

SMALL: Json = {"resolution": [64, 48], "stop": {"max_samples": 4}}
TINY: Json = {"resolution": [32, 32], "stop": {"max_samples": 4}}
QUOTAS = {"requests_per_s": None, "queued_jobs": None}
USAGE = {Path("/sys/fs/cgroup/cpuacct"): "cpuacct.usage", Path("/sys/fs/cgroup"): "cpu.stat"}  # cgroup v1, v2

Row = dict[str, Any]


class Group:
    """A control group for a server and all processes that it starts."""

    def __init__(self, folder: Path, usage: str) -> None:
        self._folder = folder
        self._usage = folder / usage

    def add(self, pid: int) -> None:
        for process in tree(pid):
            (self._folder / "cgroup.procs").write_text(str(process))

    @property
    def cpu_s(self) -> float:
        text = self._usage.read_text()
        return int(text) / 1e9 if text.strip().isdigit() else int(text.split()[1]) / 1e6  # usage_usec comes first


@contextlib.contextmanager
def control_group() -> Iterator[Group | None]:
    """An empty group, which is removed once its processes have ended; None where none can be made."""
    for parent, usage in USAGE.items():
        folder = parent / f"primray-bench-{os.getpid()}-{time.monotonic_ns()}"
        with contextlib.suppress(OSError):
            folder.mkdir()
            if (folder / usage).exists():
                break
            folder.rmdir()
    else:
        yield None
        return
    try:
        yield Group(folder, usage)
    finally:
        until = time.monotonic() + 10
        while (folder / "cgroup.procs").read_text() and time.monotonic() < until:
            time.sleep(0.05)
        folder.rmdir()


def tree(pid: int) -> list[int]:
    found = [pid]
    for process in found:
        with contextlib.suppress(OSError):
            for task in os.listdir(f"/proc/{process}/task"):
                found += map(int, Path(f"/proc/{process}/task/{task}/children").read_text().split())
    return found


class Client(Connection):
    """A connection that makes jobs; the least of HTTP, as what is measured is the server."""

    async def ask(self, method: str, path: str, body: bytes = b"", prefer: str = "") -> tuple[int, bytes]:
        head = f"{method} {path} HTTP/1.1\r\nhost: {self._host}\r\ncontent-length: {len(body)}\r\n"
        head += f"content-type: {'application/json' if body.startswith(b'{') else 'application/octet-stream'}\r\n"
        head += f"prefer: {prefer}\r\n" if prefer else ""
        self._writer.write(head.encode() + b"\r\n" + body)
        status = await self.head()
        return status, await self.body()

    async def new_scene(self, text: bytes) -> str:
        status, answer = await self.ask("POST", "/v1/scenes", text)
        assert status == 201, answer
        return str(json.loads(answer)["id"])

    async def picture(self, scene: str, settings: Json) -> bytes:
        status, answer = await self.ask("POST", "/v1/jobs", json.dumps({"scene": {"id": scene}, "settings": settings}).encode())
        assert status == 202, answer
        job = json.loads(answer)
        while job["finished_at"] is None:
            _, answer = await self.ask("GET", job["urls"]["self"], prefer="wait=30")
            job = json.loads(answer)
        assert job["state"] == "succeeded", job["error"]
        _, answer = await self.ask("GET", job["urls"]["outputs"])
        (name,) = [row["name"] for row in json.loads(answer)["items"] if row["name"].endswith(".png")]
        status, png = await self.ask("GET", f"{job['urls']['outputs']}/{name}")
        assert (status, png[:4]) == (200, b"\x89PNG")
        return png


def new_stage(client: int, number: int) -> bytes:
    return SCENE.replace(b"radius = 1", b"radius = 1.%03d%05d" % (client, number))


async def keep_asking(url: str, number: int, until: float, took: list[float], errors: list[str]) -> None:
    client = Client(url)
    await client.open()
    made = 0
    while (began := time.perf_counter()) < until:
        made += 1
        try:
            await client.picture(await client.new_scene(new_stage(number, made)), SMALL)
        except (AssertionError, EOFError, KeyError, OSError, ValueError) as error:
            errors.append(repr(error)[:300])
            break
        took.append(time.perf_counter() - began)
    client.close()


async def all_asking(url: str, clients: int, lead_in_s: float, seconds: float, look: Callable[[], Row]) -> Row:
    """Let all ask; what is measured begins after a time in which the queue fills, and does not wait for what is under way."""
    took: list[float] = []
    errors: list[str] = []
    began = time.perf_counter()
    until = began + lead_in_s + seconds
    asking = [asyncio.create_task(keep_asking(url, number, until, took, errors)) for number in range(clients)]
    await asyncio.sleep(lead_in_s)
    took.clear()
    before, began = look(), time.perf_counter()
    await asyncio.wait(asking, timeout=until - began)
    used = {name: now - before[name] for name, now in look().items()}
    passed = time.perf_counter() - began
    for task in asking:
        if not task.cancel():
            task.result()
    await asyncio.wait(asking)
    jobs = len(took)
    return {
        "clients": clients,
        "seconds": round(passed, 2),
        "jobs": jobs,
        "jobs_a_second": round(jobs / passed, 2),
        "cpu_s_a_job": {name: round(spent / max(jobs, 1), 4) for name, spent in used.items()},
        "cores_busy": round(sum(used.values()) / passed, 2),
        "job": quantiles(took) if took else None,
        "errors": errors[:5],
        "load": round(os.getloadavg()[0], 2),
    }


def load(clients: int, lead_in_s: float, seconds: float, **settings: Any) -> Row:
    with control_group() as group, serving(quotas=QUOTAS, **settings) as server:
        if group is not None:
            group.add(server.process.pid)
        return asyncio.run(all_asking(server.url, clients, lead_in_s, seconds, lambda: usage(server, group)))


def usage(server: RunningServer, group: Group | None) -> dict[str, float]:
    """CPU seconds so far."""
    own, spent = cpu_s(server.process.pid), os.times()
    found = {"server": own, "clients": spent.user + spent.system}
    return found if group is None else {**found, "workers": group.cpu_s - own}


def idle(rounds: int, pause_s: float, **settings: Any) -> Row:
    """From the request that makes the job to its PNG; between jobs there is a pause, in which the server gets ready again."""
    with serving(quotas=QUOTAS, **settings) as server:
        seconds = []
        for number in range(rounds):
            scene = upload(server.client(), new_stage(0, number))
            time.sleep(pause_s)

            async def once(scene: str = scene) -> float:
                client = Client(server.url)
                await client.open()
                began = time.perf_counter()
                await client.picture(scene, TINY)
                passed = time.perf_counter() - began
                client.close()
                return passed

            seconds.append(round(asyncio.run(once()), 3))
    return {"what": "32 x 32 on an idle server", "median_s": statistics.median(seconds), "seconds": seconds, "pause_s": pause_s}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.service.small_jobs", description=__doc__)
    parser.add_argument("--clients", type=int, nargs="*", default=[8, 64])
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument(
        "--lead-in", type=float, default=8, metavar="S", help="until the queue is full, before what is measured"
    )
    parser.add_argument("--rounds", type=int, default=9, help="of the picture on an idle server; 0: none")
    parser.add_argument("--pause", type=float, default=2.0, metavar="S")
    parser.add_argument("--slots", type=int)
    parser.add_argument("--no-results", action="store_true", help="only print")
    options = parser.parse_args()
    settings = {} if options.slots is None else {"slots": options.slots}
    rows = [load(clients, options.lead_in, options.seconds, **settings) for clients in options.clients]
    if options.rounds:
        rows.append(idle(options.rounds, options.pause, **settings))
    for row in rows:
        print(json.dumps(row))
    if not options.no_results:
        print(write_results("small_jobs", rows).relative_to(Path.cwd()))


if __name__ == "__main__":
    main()
