"""A chunk that was given to the cluster: its Ray task, its messages and the commands sent to it. Belongs to the event loop."""

from __future__ import annotations

import asyncio
import hashlib
import os
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import RayError

from ....jobs import Json
from ..node.tasks import give_chunk
from ..node.transfer import Begun, End, FileEnd, Item, Message, Order, Part, Refused
from .cluster import Cluster
from .contents import Contents

KILL_WITHIN_S = 3.0  # for a node to end its worker; then its task is ended, with all processes it started
CANCEL_WITHIN_S = 5.0  # for a task; then it counts as lost
IN_LOOP_BYTES = 2**18  # a larger block is written in a thread
GIVES = 3  # attempts on different nodes, if nodes refuse it


class GivenChunk:
    """A chunk on the cluster; `tell` sends a line to the server."""

    def __init__(
        self,
        line: Mapping[str, Any],
        cluster: Cluster,
        contents: Contents,
        mailbox: Any,
        settings: Json,
        tell: Callable[[Json], None],
    ) -> None:
        self.id = str(line["id"])
        self._chunk: Json = line["chunk"]
        self._folder = Path(line["folder"])
        self._cluster = cluster
        self._contents = contents
        self._mailbox = mailbox
        self._settings = settings
        self._tell = tell
        self._received = Received(self._folder / "out")
        self._task: Any = None
        self._node = ""
        self._kill_asked = False
        self.living = asyncio.ensure_future(self._live())

    def say(self, command: Json) -> None:
        """Send a command to its worker, which may not have started yet."""
        self._mailbox.put.remote(self._key, command)

    def kill(self) -> None:
        if self._kill_asked:
            return
        self._kill_asked = True
        if self._node:
            self._mailbox.put.remote(self._key, {"do": "kill"})
            asyncio.get_running_loop().call_later(KILL_WITHIN_S, self._cancel)
        else:
            self._cancel()

    @property
    def _key(self) -> str:
        return f"{self.id}/{self._chunk['kind']}"

    def _cancel(self) -> None:
        if self.living.done():
            return
        if self._task is not None:
            ray.cancel(self._task, force=True)
        asyncio.get_running_loop().call_later(CANCEL_WITHIN_S if self._task is not None else 0.0, self.living.cancel)

    async def _live(self) -> None:
        try:
            ended = await self._given()
        except (RayError, ValueError, OSError) as error:
            ended = _lost(error)
        except Exception as error:
            traceback.print_exc()
            ended = _lost(error)
        except asyncio.CancelledError:
            ended = _lost(TimeoutError("its node does not answer"))
        if self._kill_asked and ended["reason"] == "lost":
            ended["reason"] = "killed"
        self._mailbox.forget.remote(self._key)
        self._tell({"at": "ended", "id": self.id, **ended})

    async def _given(self) -> Json:
        """Give the chunk to a node, and to another if that one refuses; return how it ended."""
        order = await asyncio.to_thread(self._order)
        for _ in range(GIVES):
            ended = await self._run(order)
            if ended is not None:
                return ended
        raise ValueError("all nodes refused it")

    def _order(self) -> Order:
        chunk, settings = self._chunk, self._settings
        command = chunk["command"]
        saved = {command.get("checkpoint"), *command.get("parts", ())}  # each is used once, so no node needs to cache it
        inputs = {name: self._contents.of_file(Path(path), keep=name not in saved) for name, path in chunk["inputs"].items()}
        folders = {name: self._contents.of_folder(Path(path)) for name, path in chunk["folders"].items()}
        room = self._cluster.room
        limits = settings["limits"] | {"memory_bytes": room.memory_bytes}
        return Order(
            key=self._key,
            chunk=chunk,
            inputs=inputs,
            folders=folders,
            limits=limits,
            cores=room.cores,
            wanted=self._cluster.wanted,
        )

    async def _run(self, order: Order) -> Json | None:
        """Run the chunk; None if the node refused it."""
        memory = self._chunk["memory_bytes"] or order.limits["memory_bytes"]
        is_render = self._chunk["kind"] == "render"
        # A check has a slot of its own, as on one machine: it reserves no cores, or it would wait behind long renders.
        resources = {"num_cpus": order.cores, "memory": memory} if is_render else {"num_cpus": 0}
        self._node = ""
        self._task = give_chunk(order, self._mailbox, resources, self._cluster.selector())
        async for ref in self._task:
            for item in await ref:
                if isinstance(item, Refused):
                    self._cluster.refuse(item.node, item.why)
                    return None
                if (ended := await self._take(item)) is not None:
                    return ended
        raise ValueError("its task ended without a result")

    def _about(self, node: str) -> Json:
        return {"name": self._chunk.get("name", ""), "kind": self._chunk["kind"], "node": node, "since": time.time()}

    async def _take(self, item: Item) -> Json | None:
        if isinstance(item, Begun):
            self._node = item.node
            self._tell({"at": "began", "id": self.id, "node": item.node})
            self._mailbox.began.remote(self._key, self._about(item.node))
            self._cluster.sent(item.node, item.objects, item.bytes)
        elif isinstance(item, Message):
            self._tell({"at": "message", "id": self.id, "message": item.message})
        elif isinstance(item, End):
            (self._folder / "log.txt").write_bytes(item.log)
            return {**item.about, "log_file": True}
        elif isinstance(item, Part | FileEnd):
            if isinstance(item, Part) and len(item.data) > IN_LOOP_BYTES:
                await asyncio.to_thread(self._received.take, item)
            else:
                self._received.take(item)
        return None


def _lost(error: BaseException) -> Json:
    why = (str(error).strip().splitlines() or [""])[0]
    log = f"lost: {type(error).__name__}: {why[:500]}"
    return {"reason": "lost", "exit_code": None, "signal": None, "cpu_s": 0.0, "peak_rss_bytes": 0, "log": log}


class Received:
    """Received files of one chunk; `out` is the folder for the worker's files."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._sha256: dict[str, Any] = {}  # running digests of incomplete files

    def take(self, item: Part | FileEnd) -> None:
        """Take a block or the end of a file; ValueError for items that our tasks do not send, and for bytes changed in
        transit."""
        name = item.name
        if not name or name.startswith(".") or "/" in name or "\0" in name:
            raise ValueError(f"{name!r} is not the name of a worker's file")
        partial = self._out / f".{name}.partial"
        if isinstance(item, Part):
            self._sha256.setdefault(name, hashlib.sha256()).update(item.data)
            with open(partial, "ab") as file:
                file.write(item.data)
            return
        sha256 = self._sha256.pop(name, hashlib.sha256()).hexdigest()
        if sha256 != item.sha256:
            partial.unlink(missing_ok=True)
            raise ValueError(f"{name} was changed in transit")
        os.replace(partial, self._out / name)
