"""Small jobs by the thousand: clients that each upload a new stage, ask for 64 x 48 pixels at 4 samples and fetch the PNG; and
one 32 x 32 picture of an uploaded stage on an idle server.

python -m tests.bench.service.small_jobs [--clients 8 64] [--seconds 20] [--rounds 9] [--slots N]

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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.bench.results import write_results
from tests.bench.service.load import Connection, cpu_s, quantiles, serving
from tests.service.api_calls import SCENE, Json, upload
from tests.service.serving import RunningServer

SMALL: Json = {"resolution": [64, 48], "stop": {"max_samples": 4}}
TINY: Json = {"resolution": [32, 32], "stop": {"max_samples": 4}}
QUOTAS = {"requests_per_s": None, "queued_jobs": None}
GROUPS = (Path("/sys/fs/cgroup/cpuacct"), Path("/sys/fs/cgroup"))

Row = dict[str, Any]


class Group:
    """A control group with a server and all processes that it starts from now on."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def cpu_s(self) -> float:
        with contextlib.suppress(FileNotFoundError):
            return int((self._folder / "cpuacct.usage").read_text()) / 1e9
        lines = dict(line.split() for line in (self._folder / "cpu.stat").read_text().splitlines())
        return int(lines["usage_usec"]) / 1e6


@contextlib.contextmanager
def group_of(pid: int) -> Iterator[Group | None]:
    for parent in GROUPS:
        folder = parent / f"primray-bench-{os.getpid()}"
        try:
            folder.mkdir()
        except OSError:
            continue
        break
    else:
        yield None
        return
    home = folder.parent / "cgroup.procs"
    try:
        for process in tree(pid):
            (folder / "cgroup.procs").write_text(str(process))
        yield Group(folder)
    finally:
        for left in (folder / "cgroup.procs").read_text().split():
            with contextlib.suppress(OSError):
                home.write_text(left)
        with contextlib.suppress(OSError):
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


async def all_asking(url: str, clients: int, until: float, took: list[float], errors: list[str]) -> None:
    asking = [asyncio.create_task(keep_asking(url, number, until, took, errors)) for number in range(clients)]
    await asyncio.wait(asking, timeout=until - time.perf_counter())
    for task in asking:
        if not task.cancel():
            task.result()
    await asyncio.wait(asking)


def load(clients: int, seconds: float, **settings: Any) -> Row:
    """Jobs that ended within the time; what is under way at its end has cost CPU seconds and does not count."""
    with serving(quotas=QUOTAS, **settings) as server, group_of(server.process.pid) as group:
        took: list[float] = []
        errors: list[str] = []
        before = usage(server, group)
        began = time.perf_counter()
        asyncio.run(all_asking(server.url, clients, began + seconds, took, errors))
        passed = time.perf_counter() - began
        used = {name: now - before[name] for name, now in usage(server, group).items()}
        jobs = len(took)
    each = {name: round(spent / max(jobs, 1), 4) for name, spent in used.items()}
    return {
        "clients": clients,
        "seconds": round(passed, 2),
        "jobs": jobs,
        "jobs_a_second": round(jobs / passed, 2),
        "cpu_s_a_job": each,
        "cores_busy": round(sum(used.values()) / passed, 2),
        "job": quantiles(took) if took else None,
        "errors": errors[:5],
        "load": round(os.getloadavg()[0], 2),
    }


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
    parser.add_argument("--rounds", type=int, default=9, help="of the picture on an idle server; 0: none")
    parser.add_argument("--pause", type=float, default=2.0, metavar="S")
    parser.add_argument("--slots", type=int)
    parser.add_argument("--no-results", action="store_true", help="only print")
    options = parser.parse_args()
    settings = {} if options.slots is None else {"slots": options.slots}
    rows = [load(clients, options.seconds, **settings) for clients in options.clients]
    if options.rounds:
        rows.append(idle(options.rounds, options.pause, **settings))
    for row in rows:
        print(json.dumps(row))
    if not options.no_results:
        print(write_results("small_jobs", rows).relative_to(Path.cwd()))


if __name__ == "__main__":
    main()
