"""LocalExecutor: each chunk is a process on this machine, in a sandbox and a folder of its own, under a watchdog.

One idle worker of each kind waits with its slow imports done; it serves one chunk, or several of one group one after another,
and its successor is started at a quieter moment. All methods must be called in the event loop of the main thread.
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress

from ..config import ServeConfig
from ..files import DataDirectory
from ..ids import ulid
from ..jobs import Json
from ..limits import Limits
from ..problems import Problem
from ..sandbox import layers
from ..sandbox.spawn import WORKER
from .base import Capacity, Chunk, Handle, OnMessage
from .fork_server import ForkServer, ForkServers
from .local_worker import KINDS, Run, SandboxLayers, Worker
from .slots import Slots

LOG = logging.getLogger(__name__)

CORES_A_SLOT = 8
READY_WITHIN_S = 120.0  # on a machine under load
# Starting a worker as a program takes half a CPU second, which a render would miss: the next one is started when the chunk has
# ended, or while it runs, sooner if more could come at any time. A forked one is started at once.
WARM_AGAIN_AFTER_S, WARM_AGAIN_IF_FREE_AFTER_S = 8.0, 1.0
WARM_AGAIN_AFTER_DEATH_S = 10.0
# Time for which a worker waits for the next chunk of its group, which the dispatcher gives it after claiming it.
STAYS_S = 2.0
# A worker that keeps its scene longer is monitored: if it was compromised it must not use the machine.
LOOK_AT_IDLE_EVERY_S, IDLE_CPU_S = 1.0, 1.0


def local_executor(config: ServeConfig, data: DataDirectory) -> LocalExecutor:
    return LocalExecutor(data, config.limits, slots=config.slots, cores=config.usable_cores, warm=config.warm)


class LocalExecutor:
    """Executor on this machine. `slots`: concurrent renders (None: one for every eight cores); `sandbox_layers`: fewer layers
    than are available, or another program, for tests and machines without them."""

    def __init__(
        self,
        data: DataDirectory,
        limits: Limits,
        *,
        slots: int | None = None,
        cores: int,
        sandbox_layers: SandboxLayers = SandboxLayers(),  # noqa: B008 - immutable
        warm: bool = True,
    ) -> None:
        self._limits = limits
        self._capacity = Capacity(slots or max(1, cores // CORES_A_SLOT), cores, limits.memory_bytes)
        self._sandbox_layers = sandbox_layers
        self._keeps_warm = warm
        self._slots = Slots(data.slots, ulid(time.time()))
        self._fork_servers: ForkServers | None = None
        if warm and sandbox_layers.program == WORKER:
            self._fork_servers = ForkServers(self._slots, sandbox_layers.layers)
        self._warm: dict[str, Worker] = {}
        self._staying: list[Worker] = []  # idle, for chunks of their groups; the last is the newest
        self._runs: set[Run] = set()
        self._closing = False
        self._why_not = "it was not started"

    def capacity(self) -> Capacity:
        return self._capacity

    def open(self) -> None:
        """Get ready without testing whether workers can be started: for an executor that is created when there is work."""
        self._slots.open()
        self._why_not = ""

    async def start(self) -> None:
        try:
            self._slots.open()
            if self._fork_servers is not None:
                await self._fork_servers.start()
            workers = {kind: self._start_worker(kind) for kind in KINDS}
        except OSError as error:
            raise Problem("unavailable", f"No worker could be started: {error.strerror}.") from error
        ready = await asyncio.gather(*(worker.is_ready_within(READY_WITHIN_S) for worker in workers.values()))
        why = [worker.process.log.tail().strip().splitlines() for worker in workers.values()]
        for kind, worker in workers.items():
            if all(ready) and self._keeps_warm:
                self._keep(kind, worker)
            else:
                await self._end(worker)
        if not all(ready):
            last = [lines[-1] for lines, is_ready in zip(why, ready, strict=True) if lines and not is_ready]
            raise Problem("unavailable", f"No worker could be started: {last[0] if last else 'it printed nothing'}.")
        self._why_not = ""

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        if self._closing:
            raise Problem("unavailable", "The server is stopping.")
        worker, is_new = self._worker_for(chunk)
        run = Run(chunk, worker, on_message, self._limits, self._capacity.threads, self._stay)
        self._runs.add(run)
        run.ended.add_done_callback(lambda _: self._on_end(run))
        if is_new:
            is_full = chunk.kind == "render" and self._renders() >= self._capacity.slots
            after_s = WARM_AGAIN_AFTER_S if is_full else WARM_AGAIN_IF_FREE_AFTER_S
            self._warm_later(chunk.kind, after_s if self._fork_server() is None else 0.0)
        return run

    def _fork_server(self) -> ForkServer | None:
        return None if self._fork_servers is None else self._fork_servers.current

    def _worker_for(self, chunk: Chunk) -> tuple[Worker, bool]:
        """Return a worker for the chunk, and whether it is a new one."""
        memory = chunk.memory_bytes or self._limits.memory_bytes
        for worker in reversed(self._staying):
            if worker.may_have(chunk) and worker.roots == chunk.roots and memory <= worker.memory_bytes:
                self._staying.remove(worker)
                return worker, False
        waiting = self._warm.get(chunk.kind)
        if waiting is not None and memory <= waiting.memory_bytes and not chunk.roots:
            return self._warm.pop(chunk.kind), True
        return self._start_worker(chunk.kind, memory, chunk.roots), True

    def _stay(self, worker: Worker) -> None:
        """Keep a worker that has ended a chunk for another of its group or its scene; beyond the limit the oldest is
        dismissed."""
        self._staying.append(worker)
        worker.process.on_line = lambda _: self._dismiss(worker)  # an idle worker has nothing to say
        worker.process.exit.add_done_callback(lambda _: self._dismiss(worker))
        self._watch_idle(worker, worker.chunks, time.monotonic() + max(STAYS_S, worker.keep_s), None)
        if self._closing or len(self._staying) > self._capacity.slots:
            self._dismiss(self._staying[0])

    def _watch_idle(self, worker: Worker, chunks: int, until: float, cpu_s: float | None) -> None:
        """Dismiss an idle worker when its time is over, or if it uses the CPU: it has nothing to do."""
        if worker.chunks != chunks or worker not in self._staying:
            return
        used = worker.process.used()
        is_busy = cpu_s is not None and used.cpu_s - cpu_s > IDLE_CPU_S
        left_s = until - time.monotonic()
        if left_s <= 0 or is_busy or used.rss_bytes > worker.memory_bytes:
            self._dismiss(worker)
            return
        later = (worker, chunks, until, used.cpu_s if cpu_s is None else cpu_s)
        asyncio.get_running_loop().call_later(min(left_s, LOOK_AT_IDLE_EVERY_S), self._watch_idle, *later)

    def _dismiss(self, worker: Worker) -> None:
        if worker in self._staying:
            self._staying.remove(worker)
            worker.process.kill()
            worker.process.exit.add_done_callback(lambda _: worker.remove_if_over())

    def _renders(self) -> int:
        return sum(run.chunk.kind == "render" for run in self._runs)

    def _on_end(self, run: Run) -> None:
        self._runs.discard(run)
        if not run.ended.result().lives:  # otherwise more chunks follow, which a start at the same time would slow down
            self._warm_later(run.chunk.kind, 0.0)

    def health(self) -> Json:
        """Return the health of the executor; the server runs the sandbox's self-test, which takes a moment."""
        found: Json = {"ok": not self._why_not and not self._closing, "sandbox": self._layers()}
        found |= {"warm": sorted(self._warm), "staying": len(self._staying)}
        found |= {"running": len(self._runs), "slots": self._capacity.slots}
        if self._fork_servers is not None:
            found["fork_server"] = f"off: {why}" if (why := self._fork_servers.why_not) else "on"
        return found | ({"why": self._why_not} if self._why_not else {})

    def _layers(self) -> dict[str, str]:
        wanted = self._sandbox_layers.layers
        return {name: state if wanted is None or name in wanted else "off: by choice" for name, state in layers().items()}

    async def close(self) -> None:
        self._closing = True
        for run in list(self._runs):
            run.kill()
        for worker in list(self._staying):
            self._staying.remove(worker)
            await self._end(worker)
        for kind in list(self._warm):
            await self._end(self._warm.pop(kind))
        await asyncio.gather(*(run.result() for run in list(self._runs)))
        if self._fork_servers is not None:
            await self._fork_servers.close()
        await asyncio.to_thread(self._slots.close)

    def _start_worker(self, kind: str, memory_bytes: int | None = None, roots: tuple[str, ...] = ()) -> Worker:
        memory, slot, threads = memory_bytes or self._limits.memory_bytes, self._slots.make(), self._capacity.threads
        try:
            if (fork_server := self._fork_server()) is not None:
                with suppress(OSError):  # it dies, or is behind with forks
                    return Worker(kind, slot, memory, threads, self._limits, self._sandbox_layers, roots, fork_server)
            return Worker(kind, slot, memory, threads, self._limits, self._sandbox_layers, roots)
        except BaseException:
            slot.remove()
            raise

    def _keep(self, kind: str, worker: Worker) -> None:
        self._warm[kind] = worker

        def died(_: object) -> None:
            if self._warm.get(kind) is worker:
                del self._warm[kind]
                LOG.warning("a waiting worker died: %s", worker.process.log.tail()[-500:])
                worker.slot.remove()
                self._warm_later(kind, WARM_AGAIN_AFTER_DEATH_S)

        worker.process.exit.add_done_callback(died)

    def _warm_later(self, kind: str, delay_s: float) -> None:
        if self._keeps_warm:
            asyncio.get_running_loop().call_later(delay_s, self._warm_up, kind)

    def _warm_up(self, kind: str) -> None:
        if not self._closing and kind not in self._warm:
            try:
                self._keep(kind, self._start_worker(kind))
            except OSError as error:  # no processes or no space: chunks will report it
                LOG.warning("no worker could be started: %s", error)

    async def _end(self, worker: Worker) -> None:
        worker.process.kill()
        with suppress(asyncio.CancelledError):
            await asyncio.shield(worker.process.exit)
        await asyncio.to_thread(worker.slot.remove)
