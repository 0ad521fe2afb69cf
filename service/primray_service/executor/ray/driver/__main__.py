"""Dispatch of the server's lines to their targets; the process ends when its input does."""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import socket
import sys
import traceback
from collections.abc import Mapping
from typing import Any, BinaryIO

import ray

from ....jobs import Json
from ....worker.channel import claim_stdout
from .. import protocol
from ..link import NotConnected
from ..node.fitness import wanted_here
from ..node.tasks import mailbox_actor
from .cluster import Cluster, connect, what_runs
from .contents import Contents
from .given_chunk import GivenChunk


class Driver:
    def __init__(self, settings: Json, messages: BinaryIO) -> None:
        self._settings = settings
        self._messages = messages
        self._contents = Contents(ray.put)
        self._owner = f"{socket.gethostname()}-{os.getppid()}-{secrets.token_hex(4)}"
        self._mailbox = mailbox_actor(ray.get_runtime_context().get_node_id(), self._owner)
        self._cluster = Cluster(settings, wanted_here(settings["allow_unsandboxed"]), self.tell)
        self._given: dict[str, GivenChunk] = {}
        self._looking: set[asyncio.Task[None]] = set()

    def tell(self, line: Json) -> None:
        """Send a line to the server, which reads at once; this process ends if the server is gone."""
        try:
            left = memoryview(json.dumps(line).encode() + b"\n")
            while left:
                left = left[self._messages.write(left) or 0 :]
        except OSError:
            os._exit(0)

    async def live(self, lines: asyncio.StreamReader) -> None:
        """Process lines until the input ends, or the cluster cannot be reached any more."""
        working = [asyncio.ensure_future(self._cluster.watch()), asyncio.ensure_future(self._read(lines))]
        done, _ = await asyncio.wait(working, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()

    async def _read(self, lines: asyncio.StreamReader) -> None:
        while line := await lines.readline():
            self._heed(json.loads(line))

    def _heed(self, line: Mapping[str, Any]) -> None:
        does, name = line["do"], str(line["id"])
        if does == "run":
            given = GivenChunk(line, self._cluster, self._contents, self._mailbox, self._settings, self.tell)
            self._given[name] = given
            given.living.add_done_callback(lambda _: self._given.pop(name, None))
        elif does == "look":
            looking = asyncio.ensure_future(self._look(name))
            self._looking.add(looking)
            looking.add_done_callback(self._looking.discard)
        elif does == "exclude":
            self._cluster.exclude(str(line["node"]), str(line["why"]))
        elif name not in self._given:
            return
        elif does == "tell":
            self._given[name].say(line["command"])
        elif does == "kill":
            self._given[name].kill()

    async def _look(self, name: str) -> None:
        self.tell({"at": "running", "id": name, "owners": await what_runs(self._owner)})


async def main() -> None:
    messages = claim_stdout()
    lines = asyncio.StreamReader(protocol.MAX_LINE_BYTES)
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    settings = json.loads(await lines.readline())
    try:
        connect(settings["address"])  # in this thread, which Ray takes for its main one
        driver = Driver(settings, messages)
    except NotConnected as error:
        messages.write(json.dumps({"at": "failed", "code": error.code, "why": error.why}).encode() + b"\n")
        return
    try:
        await driver.live(lines)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)  # Ray ends the processes that it started; joining its threads may take seconds


asyncio.run(main())
