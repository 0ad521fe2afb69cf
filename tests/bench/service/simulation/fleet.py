"""An executor of many nodes that render nothing: each frame takes a time by chance, and some fail as renders do."""

from __future__ import annotations

import asyncio
import hashlib
import random
import shutil
import signal
import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from primray_service.executor.base import Capacity, Chunk, Ended, OnMessage
from primray_service.files import DataDirectory
from primray_service.jobs import Json
from primray_service.problems import Problem

BODY = b"{}"
SHA256 = hashlib.sha256(BODY).hexdigest()
REPORT: Json = {
    "stop": {"reason": "samples", "target_met": None},
    "samples": 64,
    "rays": 1000,
    "error": {"relmse": {"estimate": 0.02, "ci95": [0.01, 0.03]}},
    "pixels_sha256": "0" * 64,
    "stages_s": {"render": 1.0},
}


@dataclass(frozen=True)
class Chances:
    """Of one try. A frame that is lost or crashes is tried again; one that cannot be rendered cannot be at any try."""

    frame_s: float = 30.0  # mean
    progress_s: float = 10.0
    lost: float = 0.01  # with its node
    crashed: float = 0.005
    impossible: float = 0.002


@dataclass
class Seen:
    """What the fleet was given, by job and frame. `twice`: tries that began while another of the same frame ran."""

    tries: Counter[tuple[str, str]] = field(default_factory=Counter)
    done: Counter[tuple[str, str]] = field(default_factory=Counter)
    refused: set[tuple[str, str]] = field(default_factory=set)
    ends: Counter[str] = field(default_factory=Counter)
    running: Counter[tuple[str, str]] = field(default_factory=Counter)
    left_s: dict[tuple[str, str], float] = field(default_factory=dict)  # of those that gave way
    twice: int = 0
    of_tenant: Counter[str] = field(default_factory=Counter)  # nodes, now
    most: int = 0


class Play:
    """One chunk: the handle that the dispatcher has, and the worker behind it."""

    def __init__(self, fleet: Fleet, chunk: Chunk, folder: Path, on_message: OnMessage) -> None:
        self.folder = folder
        self._fleet = fleet
        self._chunk = chunk
        self._say = on_message
        self._ended: asyncio.Future[tuple[str, int | None]] = asyncio.get_running_loop().create_future()
        self._timers: list[asyncio.TimerHandle] = []
        job_id = chunk.group.partition("/")[0]
        self.key = (job_id, chunk.command["outputs"][-1])  # jobs of several frames have a name for each
        self._tenant = fleet.tenants[job_id]
        self._begin()

    def _begin(self) -> None:
        fleet, seen, loop = self._fleet, self._fleet.seen, asyncio.get_running_loop()
        seen.tries[self.key] += 1
        seen.twice += seen.running[self.key] > 0
        seen.running[self.key] += 1
        seen.of_tenant[self._tenant] += 1
        seen.most = max(seen.most, seen.of_tenant.total())
        chances, draw = fleet.chances, fleet.random
        new = min(draw.expovariate(1 / chances.frame_s), 10 * chances.frame_s) + 0.5
        seconds = seen.left_s.pop(self.key, new)
        self._ends_at = loop.time() + seconds
        fate = self._fate(draw.random())
        self._timers.append(loop.call_later(0.2, self._say, {"at": "phase", "phase": "sampling"}))
        at = chances.progress_s
        while at < seconds:
            self._timers.append(loop.call_later(at, self._progress, at / seconds, at))
            at += chances.progress_s
        self._timers.append(loop.call_later(seconds, fate))

    def _fate(self, drawn: float) -> Callable[[], None]:
        chances = self._fleet.chances
        if zlib.crc32(repr(self.key).encode()) % 100_000 < chances.impossible * 100_000:
            return self._fails
        if drawn < chances.lost:
            return lambda: self._end("lost", None)
        if drawn < chances.lost + chances.crashed and self._fleet.seen.tries[self.key] == 1:
            return lambda: self._end("signal", signal.SIGSEGV)
        return self._done

    def _progress(self, fraction: float, elapsed_s: float) -> None:
        self._say({"at": "progress", "fraction": fraction, "samples_done": 64 * fraction, "rays": 1000, "elapsed_s": elapsed_s})

    def _fails(self) -> None:
        self._fleet.seen.refused.add(self.key)
        self._say({"at": "failed", "problem": Problem("render-failed", "It cannot be rendered.").as_json()})
        self._end("exited", None)

    def _done(self) -> None:
        self._fleet.seen.done[self.key] += 1
        name = next(name for name in self._chunk.command["outputs"] if name.endswith("json"))
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / "report").write_bytes(BODY)
        made = {"name": name, "file": "report", "bytes": len(BODY), "sha256": SHA256, "media_type": "application/json"}
        self._say({"at": "done", "outputs": [made], "report": REPORT})
        self._end("exited", None)

    def _end(self, reason: str, number: int | None) -> None:
        if self._ended.done():
            return
        for timer in self._timers:
            timer.cancel()
        seen = self._fleet.seen
        seen.ends[reason] += 1
        seen.running[self.key] -= 1
        seen.of_tenant[self._tenant] -= 1
        self._ended.set_result((reason, number))

    async def result(self) -> Ended:
        reason, number = await asyncio.shield(self._ended)
        return Ended(reason, 0 if reason == "exited" else None, number, self.folder, 1.0, 2**20, "")

    def tell(self, command: Json) -> None:
        if command["do"] == "yield" and not self._ended.done():
            self._fleet.seen.left_s[self.key] = max(self._ends_at - asyncio.get_running_loop().time(), 0.5)
            self._say({"at": "yielded"})
            self._end("exited", None)

    def kill(self) -> None:
        self._end("killed", signal.SIGKILL)

    def release(self) -> None:
        if self.folder.exists():
            shutil.rmtree(self.folder.parent, ignore_errors=True)


class Fleet:
    """`tenants`: whose each job is."""

    def __init__(self, data: DataDirectory, nodes: int, chances: Chances, tenants: Mapping[str, str], seed: int) -> None:
        self.chances = chances
        self.seen = Seen()
        self.random = random.Random(seed)
        self._data = data
        self._nodes = nodes
        self.tenants = tenants

    def capacity(self) -> Capacity:
        return Capacity(self._nodes, 8 * self._nodes, 2**33, self._nodes)

    async def start(self) -> None:
        return

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Play:
        return Play(self, chunk, self._data.slots / chunk.id / "out", on_message)

    def health(self) -> Json:
        return {"ok": True}

    async def close(self) -> None:
        return
