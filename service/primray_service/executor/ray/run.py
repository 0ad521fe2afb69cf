"""One chunk on a cluster, seen from the server: its files arrive in a local folder before the messages that name them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...jobs import Json
from ...worker.protocol import LAST
from ..base import Chunk, Ended, OnMessage
from ..slots import Slot

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

    def has_ended(self, told: Mapping[str, Any]) -> None:
        log_file = self._slot.log if told.get("log_file") else None
        about = {name: told[name] for name in ("reason", "exit_code", "signal", "cpu_s", "peak_rss_bytes", "log")}
        self._end(Ended(folder=self.folder, log_file=log_file, protocol_error=str(told.get("protocol_error", "")), **about))

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
