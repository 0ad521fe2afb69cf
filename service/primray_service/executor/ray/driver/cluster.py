"""The cluster: connection to an existing one, its nodes, which of them take work and why others do not, and the chunks that all
drivers run there.
"""

from __future__ import annotations

import asyncio
import math
import os
import socket
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import ray
from ray.exceptions import AuthenticationError, RayError

from ....jobs import Json
from .. import protocol
from ..link import NotConnected
from ..node.tasks import ask_fitness, ask_running, owners
from ..node.transfer import Wanted

LOOK_EVERY_S = 1.0
ANSWER_WITHIN_S = 10.0  # from the head; without an answer no chunk is handed out
PROBE_WITHIN_S = 90.0  # from a node, whose first process has to start
ASK_AGAIN_AFTER_S = 60.0  # for a node that was refused


@dataclass
class Node:
    id: str
    host: str
    resources: Resources
    is_known: bool = False  # whether it was asked
    why: str = ""  # why it takes no work
    sandbox: dict[str, str] = field(default_factory=dict)
    asked_at: float = -math.inf
    objects: int = 0  # number of objects sent to it
    bytes: int = 0


class Cluster:
    """Nodes of the cluster; `tell` sends a line to the server."""

    def __init__(self, settings: Json, wanted: Wanted, tell: Callable[[Json], None]) -> None:
        self.wanted = wanted
        self._settings = settings
        self._tell = tell
        self._nodes: dict[str, Node] = {}
        self._excluded: dict[str, str] = {}  # nodes that the server excludes, and why
        self._asking: set[asyncio.Task[None]] = set()
        self._away = ""  # why its head does not answer
        self._reported: Json = {}
        self.room: Room = room({}, settings["cores"], settings["limits"]["memory_bytes"])

    async def watch(self) -> None:
        """Watch the cluster for ever. All nodes have been examined before the first report."""
        await self._look()
        while self._asking:
            await asyncio.wait(self._asking)
        self._say()
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            await self._look()
            self._say()

    async def _look(self) -> None:
        asked = asyncio.ensure_future(asyncio.to_thread(ray.nodes))
        done, _ = await asyncio.wait([asked], timeout=ANSWER_WITHIN_S)
        try:
            if not done:
                self._is_away("does not answer")
            rows = {row["NodeID"]: row for row in await asked if row["Alive"] and self._is_ours(row)}
        except (RayError, OSError, RuntimeError) as error:  # it may come back; if not, Ray ends this process
            self._is_away(f"cannot be asked: {type(error).__name__}")
            return
        self._away = ""
        self._nodes = {node_id: self._nodes.get(node_id) or _node(row) for node_id, row in rows.items()}
        now = asyncio.get_running_loop().time()
        for node in self._nodes.values():
            if node.id in self._excluded:
                node.is_known, node.why = True, self._excluded[node.id]
            elif (node.why or not node.is_known) and now - node.asked_at > ASK_AGAIN_AFTER_S:
                node.asked_at = now
                task = asyncio.ensure_future(self._ask(node))
                self._asking.add(task)
                task.add_done_callback(self._asking.discard)

    def _is_away(self, why: str) -> None:
        """Report that the head is away: no chunk is handed out, and running ones continue."""
        self._away = f"the head of the Ray cluster {why}"
        if self._reported:
            self._say()

    def _is_ours(self, row: Mapping[str, Any]) -> bool:
        labels: Mapping[str, str] = self._settings["labels"]
        has = row.get("Labels") or {}
        return row["Resources"].get("CPU", 0) >= 1 and all(has.get(name) == value for name, value in labels.items())

    async def _ask(self, node: Node) -> None:
        asked = ask_fitness(node.id, self.wanted)
        try:
            fitness = await asyncio.wait_for(asyncio.wrap_future(asked.future()), PROBE_WITHIN_S)
        except RayError as error:
            node.why = _why(error)
        except TimeoutError:
            node.why = f"it did not answer within {PROBE_WITHIN_S:g} s"
        except Exception as error:
            traceback.print_exc()
            node.why = f"it cannot be asked: {error!r}"
        else:
            node.why, node.sandbox = fitness.why, dict(fitness.sandbox)
        node.why = self._excluded.get(node.id, node.why)
        node.is_known = True

    def refuse(self, node_id: str, why: str) -> None:
        """Record that a task found the node unfit."""
        if node_id in self._nodes:
            node = self._nodes[node_id]
            node.is_known, node.why, node.asked_at = True, why, asyncio.get_running_loop().time()
            self._say()

    def exclude(self, node_id: str, why: str) -> None:
        """Give a node no more chunks, whatever it answers when it is asked whether it is fit."""
        self._excluded[node_id] = why
        self.refuse(node_id, why)

    def sent(self, node_id: str, objects: int, size: int) -> None:
        if objects and node_id in self._nodes:
            self._nodes[node_id].objects += objects
            self._nodes[node_id].bytes += size
            self._say()

    def selector(self) -> dict[str, str]:
        """Return the label selector. It admits nodes that were not examined yet: a task checks its node first, and new nodes
        join because work waits."""
        refused = [node.id for node in self._nodes.values() if node.why]
        return selector(self._settings["labels"], sorted(refused))

    def _say(self) -> None:
        """Report to the server if anything has changed."""
        working = {node.id: node.resources for node in self._nodes.values() if node.is_known and not node.why}
        self.room = room(working, self._settings["cores"], self._settings["limits"]["memory_bytes"])
        slots = 0 if self._away else self._settings["slots"] or self.room.total
        report = {
            "at": "cluster",
            "slots": slots,
            "cores": self.room.cores,
            "memory_bytes": self.room.memory_bytes,
            "why": f"{self._away}; jobs stay queued" if self._away else "",
            "nodes": [self._row(node) for node in self._nodes.values() if node.is_known],
        }
        if report != self._reported:
            self._reported = report
            self._tell(report)

    def _row(self, node: Node) -> Json:
        slots = 0 if node.why else self.room.slots.get(node.id, 0)
        received = {"objects": node.objects, "bytes": node.bytes}
        return {
            "id": node.id,
            "host": node.host,
            "slots": slots,
            "why": node.why,
            "sandbox": node.sandbox,
            "received": received,
        }


def _node(row: Mapping[str, Any]) -> Node:
    resources = row["Resources"]
    return Node(row["NodeID"], row["NodeManagerHostname"], Resources(int(resources["CPU"]), int(resources.get("memory", 0))))


def _why(error: RayError) -> str:
    text = str(error)
    if "ModuleNotFoundError" in text and "primray" in text:
        return "primray[server] is not installed there, or another version of it"
    return f"it cannot be asked: {(text.strip().splitlines() or [''])[-1][:300]}"


CORES = 8  # default for a chunk: as many as a slot has on one machine


@dataclass(frozen=True)
class Resources:
    """Resources of a node, as Ray reports them."""

    cores: int
    memory_bytes: int


@dataclass(frozen=True)
class Room:
    cores: int  # per chunk
    memory_bytes: int  # per chunk
    slots: Mapping[str, int]  # by node

    @property
    def total(self) -> int:
        return sum(self.slots.values())


def room(nodes: Mapping[str, Resources], cores: int | None, memory_bytes: int) -> Room:
    """Return the room on the nodes. `cores`: for each chunk (None: CORES, or all of the smallest node's if it has fewer);
    `memory_bytes`: the most for each chunk; less if a node could not give it to each of its chunks."""
    each = cores or min([CORES, *(node.cores for node in nodes.values() if node.cores)])
    slots = {name: node.cores // each for name, node in nodes.items()}
    shares = [nodes[name].memory_bytes // count for name, count in slots.items() if count]
    return Room(each, min([memory_bytes, *shares]), slots)


def selector(labels: Mapping[str, str], refused: Sequence[str]) -> dict[str, str]:
    """Return Ray's label selector for nodes that may get a chunk: those with these labels, except for refused ones."""
    ours = dict(labels)
    if refused:
        ours["ray.io/node-id"] = f"!in({', '.join(refused)})"
    return ours


LISTENER_ANSWERS_WITHIN_S = 5.0
NO_TOKEN = (
    "there is no token for the Ray cluster: put it into RAY_AUTH_TOKEN, a file that RAY_AUTH_TOKEN_PATH names, "
    "or ~/.ray/auth_token"
)


def connect(address: str) -> None:
    """Connect to a cluster; raises NotConnected with a code of protocol.py. "auto" is the cluster that this machine belongs
    to."""
    if address != "auto":
        _require_listener(*split(address))
    try:
        ray.init(address, log_to_driver=False, configure_logging=False, namespace="primray")
    except AuthenticationError as error:
        why = NO_TOKEN if "no authentication token" in str(error) else str(error)
        raise NotConnected(protocol.WRONG_TOKEN, why) from error
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        raise NotConnected(protocol.UNREACHABLE, f"no Ray cluster at {address}: {_first_line(error)}") from error
    if os.environ.get("RAY_AUTH_MODE") == "disabled":
        print("RAY_AUTH_MODE=disabled: anybody who can reach the Ray cluster can run code on its nodes", flush=True)


def split(address: str) -> tuple[str, int]:
    """Return host and port; raises NotConnected for a malformed address."""
    host, _, port = address.rpartition(":")
    if address.startswith("ray://") or not host or not port.isdigit():
        why = f"{address!r} is not the address of a Ray cluster: write HOST:PORT, or auto on one of its nodes"
        raise NotConnected(protocol.ADDRESS, why)
    return host.strip("[]"), int(port)


def _require_listener(host: str, port: int) -> None:
    """Raise NotConnected unless something listens at the address; Ray itself would retry for two minutes."""
    try:
        socket.create_connection((host, port), LISTENER_ANSWERS_WITHIN_S).close()
    except OSError as error:
        why = f"no Ray cluster at {host}:{port}: {error.strerror or error}"
        raise NotConnected(protocol.UNREACHABLE, why) from error


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:500]


OWNERS_WITHIN_S = 5.0


async def what_runs(asking: str) -> list[Json]:
    """Return the running chunks by owner, except those of the asking driver; an owner that does not answer is ending and is
    left out."""
    found = []
    for owner in await asyncio.to_thread(owners):
        if owner == asking:
            continue
        try:
            asked = await asyncio.to_thread(ask_running, owner)
            chunks = await asyncio.wait_for(asyncio.wrap_future(asked.future()), OWNERS_WITHIN_S)
        except (RayError, ValueError, TimeoutError):
            continue
        found.append({"owner": owner, "chunks": chunks})
    return found
