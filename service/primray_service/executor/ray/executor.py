"""RayExecutor: chunks run as tasks of a Ray cluster, on any of its nodes that has primray and a working sandbox.

The cluster may die at any time, and this server's driver with it: every running chunk is then lost, capacity is zero, so that
jobs wait, and the connection is retried until the cluster is back. Jobs stay in the database. Of a chunk that runs, files
arrive in a local folder before the messages that name them.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...config import ServeConfig
from ...files import DataDirectory
from ...ids import ulid
from ...jobs import Json
from ...limits import Limits
from ...problems import Problem
from ...worker.protocol import LAST
from ..base import Capacity, Chunk, Ended, Handle, OnMessage, end_tasks
from ..slots import Slot, Slots
from . import protocol
from .link import Link, NotConnected

LOG = logging.getLogger(__name__)


class RayRun:
    """Handle of a chunk on a cluster. `send` sends a line to the driver."""

    def __init__(self, chunk: Chunk, run_id: str, slot: Slot, on_message: OnMessage, send: Callable[[Json], None]) -> None:
        self.chunk = chunk
        self.id = run_id
        self.ended: asyncio.Future[Ended] = asyncio.get_running_loop().create_future()
        self._slot = slot
        self._on_message = on_message
        self._send = send
        self._said_last = False
        self._released = False
        self.worker = ""  # the node that runs it, once that is known

    def begin(self) -> None:
        chunk = {
            "name": self.chunk.id,
            "kind": self.chunk.kind,
            "command": self.chunk.command,
            "inputs": {name: str(path.absolute()) for name, path in self.chunk.inputs.items()},
            "folders": {name: str(path.absolute()) for name, path in self.chunk.folders.items()},
            "load_cpu_s": self.chunk.load_cpu_s,
            "memory_bytes": self.chunk.memory_bytes,
            "group": self.chunk.group,
            "more_follow": self.chunk.more_follow,
            "scene": self.chunk.scene,
            "keep_s": self.chunk.keep_s,
        }
        self._send({"do": "run", "id": self.id, "chunk": chunk, "folder": str(self._slot.root.absolute())})

    @property
    def folder(self) -> Path:
        return self._slot.out

    async def result(self) -> Ended:
        return await asyncio.shield(self.ended)

    def tell(self, command: Json) -> None:
        if not self._said_last and not self.ended.done():
            self._send({"do": "tell", "id": self.id, "command": command})

    def kill(self) -> None:
        if not self.ended.done():
            self._send({"do": "kill", "id": self.id})

    def release(self) -> None:
        if not self._released:
            self._released = True
            if self.ended.done():
                self._remove()

    def heard(self, message: Mapping[str, Any]) -> None:
        self._said_last = self._said_last or message.get("at") in LAST
        try:
            self._on_message(message)
        except Exception:
            LOG.exception("a message %r of %s could not be processed", message.get("at"), self.chunk.id)

    def has_ended(self, report: Mapping[str, Any]) -> None:
        log_file = self._slot.log if report.get("log_file") else None
        about = {name: report[name] for name in ("reason", "exit_code", "signal", "cpu_s", "peak_rss_bytes", "log")}
        self._end(Ended(folder=self.folder, log_file=log_file, protocol_error=str(report.get("protocol_error", "")), **about))

    def is_lost(self, why: str) -> None:
        """End the chunk as lost: nothing more will come from it."""
        self._end(Ended(reason="lost", exit_code=None, signal=None, folder=self.folder, cpu_s=0.0, peak_rss_bytes=0, log=why))

    def _end(self, ended: Ended) -> None:
        if not self.ended.done():
            self.ended.set_result(ended)
            if self._released:
                self._remove()

    def _remove(self) -> None:
        asyncio.get_running_loop().run_in_executor(None, self._slot.remove)


NOT_ASKED = "it cannot be asked"  # prefix of a node's reason if asking it failed
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 15.0  # between attempts to connect


def ray_executor(config: ServeConfig, data: DataDirectory) -> RayExecutor:
    return RayExecutor(
        data,
        config.limits,
        address=config.ray_address,
        slots=config.slots,
        cores=config.ray_cores,
        labels=dict(label.split("=", 1) for label in config.ray_labels),
        allow_unsandboxed=config.allow_unsandboxed,
        waits=True,
    )


class RayExecutor:
    """Executor on a Ray cluster. `slots`: concurrent chunks (None: as many as the nodes have room for); `cores`: for each chunk
    (None: 8, or all of the smallest node's); `labels`: of nodes that take work ({}: all of them); `waits`: it starts without a
    cluster, or without a fit node, and has no slots until there is one."""

    def __init__(
        self,
        data: DataDirectory,
        limits: Limits,
        *,
        address: str,
        slots: int | None = None,
        cores: int | None = None,
        labels: Mapping[str, str] | None = None,
        allow_unsandboxed: bool = False,
        waits: bool = False,
    ) -> None:
        self._settings: Json = {
            "address": address,
            "slots": slots,
            "cores": cores,
            "labels": dict(labels or {}),
            "limits": asdict(limits),
            "allow_unsandboxed": allow_unsandboxed,
        }
        self._address = address
        self._waits = waits
        self._slots = Slots(data.slots, ulid(time.time()))
        self._cluster: Json = {"slots": 0, "cores": cores or 1, "memory_bytes": limits.memory_bytes, "nodes": []}
        self._link: Link | None = None
        self._runs: dict[str, RayRun] = {}
        self._made = 0
        self._excluded: dict[str, str] = {}  # nodes, and why
        self._keeping: asyncio.Task[None] | None = None
        self._closing = False
        self._why_not = "it was not started"

    def capacity(self) -> Capacity:
        """Return the capacity, which is zero while the cluster is away."""
        slots = int(self._cluster["slots"]) if self._link is not None else 0
        cores, memory = int(self._cluster["cores"]), int(self._cluster["memory_bytes"])
        return Capacity(slots, cores * max(slots, 1), memory, len(self._working_nodes()))

    def _working_nodes(self) -> list[Json]:
        return [node for node in self._cluster["nodes"] if not node["why"]] if self._link is not None else []

    async def start(self) -> None:
        try:
            await asyncio.to_thread(self._slots.open)
            self._link = await Link.connect(self._settings, self._on_line)
        except OSError as error:
            raise Problem("unavailable", f"The Ray driver cannot be started: {error.strerror}.") from error
        except NotConnected as error:
            # A wrong address, a wrong token and a missing package do not go away by waiting.
            if not self._waits or error.code != protocol.UNREACHABLE:
                raise Problem("unavailable", f"{error.why}.", code=error.code) from error
            self._why_not = (
                "the Ray cluster is not available yet; jobs stay queued"  # clients do not learn the cluster's address
            )
            LOG.warning("%s; the server starts, and jobs stay queued until the cluster is available", error.why)
        else:
            self._why_not = ""
            await self._require_node(self._link)
        self._keeping = asyncio.create_task(self._keep_connected())

    async def _require_node(self, link: Link) -> None:
        """Raise Problem if no node takes work, or warn if the server may wait for one."""
        if self._settings["slots"] or self._working_nodes():
            return
        why = self._why_no_node()
        if self._waits:
            LOG.warning("%s; the server starts, and jobs stay queued until a node is", why)
            return
        await link.close()
        raise Problem("unavailable", f"{why}.", code=protocol.NO_NODE)

    async def _keep_connected(self) -> None:
        """Keep the connection until the server stops: connect when the cluster is there, and notice when it is gone."""
        while True:
            link = self._link or await self._connected()
            last = await link.ended()
            self._lost(f"the Ray cluster at {self._address} is gone: {last or 'its driver ended'}")

    async def _connected(self) -> Link:
        """Retry until the cluster answers. Errors are logged when they change, not at each attempt."""
        pause_s, logged = FIRST_PAUSE_S, ""
        while True:
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
            try:
                self._link = link = await Link.connect(self._settings, self._on_line)
            except (NotConnected, OSError) as error:
                if str(error) != logged:
                    LOG.warning("the Ray cluster at %s is not available; retrying: %s", self._address, error)
                logged = str(error)
                continue
            self._exclude_all(link)
            self._why_not = ""
            LOG.warning("connected to the Ray cluster at %s: %d slots", self._address, self.capacity().slots)
            return link

    def _lost(self, why: str) -> None:
        self._link, self._why_not = (
            None,
            "the Ray cluster is gone; jobs stay queued",
        )  # clients do not learn the cluster's address
        if not self._closing:
            LOG.error("%s; %d chunks are lost", why, len(self._runs))
        for run in list(self._runs.values()):
            run.is_lost(why)

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        if self._closing:
            raise Problem("unavailable", "The server is stopping.")
        if self._link is None:
            raise Problem("unavailable", f"The Ray cluster at {self._address} is not available.")
        self._made += 1
        run = RayRun(chunk, str(self._made), self._slots.make(), on_message, self._link.send)
        self._runs[run.id] = run
        run.ended.add_done_callback(lambda _: self._runs.pop(run.id, None))
        run.begin()
        return run

    def exclude(self, worker: str, why: str) -> None:
        """Give a node no more chunks, also after a new connection to the cluster."""
        self._excluded[worker] = why
        if self._link is not None:
            self._link.send({"do": "exclude", "id": "", "node": worker, "why": why})

    def _exclude_all(self, link: Link) -> None:
        for node, why in self._excluded.items():
            link.send({"do": "exclude", "id": "", "node": node, "why": why})

    def _on_line(self, line: Mapping[str, Any]) -> None:
        if line["at"] == "cluster":
            self._cluster_is(line)
            return
        run = self._runs.get(str(line["id"]))
        if run is None:
            return
        if line["at"] == "began":
            run.worker = str(line["node"])
        elif line["at"] == "message":
            run.heard(line["message"])
        elif line["at"] == "ended":
            run.has_ended(line)

    def _cluster_is(self, found: Mapping[str, Any]) -> None:
        before = {node["id"]: node["why"] for node in self._cluster["nodes"]}
        self._cluster = dict(found)
        for node in found["nodes"]:
            if node["why"] and before.get(node["id"]) != node["why"]:
                LOG.warning("the Ray node %s (%s) takes no work: %s", node["id"][:8], node["host"], node["why"])

    def health(self) -> Json:
        why = self._why_not or str(self._cluster.get("why", "")) or ("" if self.capacity().slots else self._why_no_node())
        nodes = [_public(node) for node in self._cluster["nodes"]] if self._link is not None else []
        found: Json = {"ok": not why and not self._closing, "sandbox": self._layers(), "nodes": nodes}
        found |= {"running": len(self._runs), "slots": self.capacity().slots}
        return found | ({"why": why} if why else {})

    def _why_no_node(self) -> str:
        refused = [f"{node['id']}: {node['why']}" for node in map(_public, self._cluster["nodes"]) if node["why"]]
        return f"no node of the Ray cluster takes work ({'; '.join(refused) or 'none has the labels and the cores'})"

    def _layers(self) -> dict[str, str]:
        """Return the sandbox layers of the first node; those of each node are in `nodes`."""
        nodes = self._working_nodes()
        return dict(nodes[0]["sandbox"]) if nodes else {}

    async def close(self) -> None:
        self._closing = True
        for run in list(self._runs.values()):
            run.kill()
        if self._runs:
            await asyncio.wait([run.ended for run in self._runs.values()], timeout=2.0)
        if self._keeping is not None:
            await end_tasks([self._keeping])
        if self._link is not None:
            await self._link.close()
            self._lost("the server is stopping")
        await asyncio.to_thread(self._slots.close)


def _public(node: Json) -> Json:
    """Return a node for /readyz, which needs no key: without host names, and without error texts, which may contain such."""
    why = NOT_ASKED if node["why"].startswith(NOT_ASKED) else node["why"]
    return {"id": node["id"][:8], "slots": node["slots"], "why": why, "received": node["received"]}
