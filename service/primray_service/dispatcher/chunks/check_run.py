"""The running chunk of one scene check. Belongs to the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from ...executor.base import Chunk, Ended, Executor
from ...jobs import Json
from . import messages
from .chunk_run import LEAVE_S
from .inbox import MOST_WARNINGS

MOST_KEPT = 500  # warnings kept


class CheckRun:
    def __init__(self, executor: Executor, chunk: Chunk) -> None:
        self.facts: Json = {}
        self.warnings: list[Json] = []
        self.last: Json | messages.Failed | None = None  # facts, or the failure
        self.is_not_believed = False
        self._said_last = asyncio.Event()
        self._warned = 0
        self._handle = executor.submit(chunk, self._on_message)
        self._ending = asyncio.create_task(self._handle.result())
        self._ending.add_done_callback(lambda _: self._said_last.set())

    def _on_message(self, message: Mapping[str, Any]) -> None:
        try:
            self._take(message)
        except messages.NotBelieved:
            self.is_not_believed = True
            self._handle.kill()

    def _take(self, message: Mapping[str, Any]) -> None:
        at = message.get("at")
        if at == "warning":
            self._warned += 1
            if self._warned > MOST_WARNINGS:
                raise messages.NotBelieved("too many warnings")
            if self._warned <= MOST_KEPT:
                self.warnings.append(messages.warning_of(message))
        elif at == "facts":
            found = messages.mapping(message)
            del found["at"]
            self.facts = self.last = found
        elif at == "failed":
            self.last = messages.failed_of(message)
        if self.last is not None:
            self._said_last.set()

    async def ended(self) -> Ended:
        await self._said_last.wait()
        if not self._ending.done():
            await asyncio.wait([self._ending], timeout=LEAVE_S)
            self._handle.kill()
        return await asyncio.shield(self._ending)

    async def close(self) -> None:
        if not self._ending.done():
            self._handle.kill()
            await asyncio.wait([self._ending])
        self._handle.release()
