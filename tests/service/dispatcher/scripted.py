"""An executor whose workers are coroutines of the test: each plays what a worker would say and leave, to the letter."""

from __future__ import annotations

import asyncio
import hashlib
import os
import shutil
import signal
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from primray_service.executor.base import Capacity, Chunk, Ended, OnMessage
from primray_service.files import DataDirectory
from primray_service.jobs import Json
from primray_service.problems import Problem
from primray_service.worker.protocol import LAST


class Dies(Exception):
    """The worker's process ends so, without a last word."""

    def __init__(self, reason: str = "signal", number: int | None = None, exit_code: int | None = None) -> None:
        super().__init__(reason)
        self.ended = (reason, exit_code, number)


def segfault() -> Dies:
    return Dies("signal", signal.SIGSEGV)


def killed_outside() -> Dies:
    return Dies("signal", signal.SIGKILL)


class Worker:
    """What a script plays. `told` are the later commands; `went_on_from` is the content of the checkpoint that it got."""

    def __init__(self, chunk: Chunk, folder: Path, on_message: OnMessage) -> None:
        self.chunk = chunk
        self.command: Json = chunk.command
        self.out = folder
        self.told: list[str] = []
        self._has_left = False
        self._on_message = on_message
        self._commands: asyncio.Queue[str] = asyncio.Queue()
        inputs = {name: path.read_bytes() for name, path in chunk.inputs.items()}
        self.went_on_from = inputs.get(self.command.get("checkpoint") or "", b"")
        self.number = int(self.command.get("number", 0))

    @property
    def has_left(self) -> bool:
        """It has said its last word."""
        return self._has_left

    def say(self, at: str, **members: Any) -> None:
        self._has_left = self._has_left or at in LAST
        self._on_message({"at": at, **members})

    def write(self, name: str, body: bytes) -> Path:
        """A new file: what a link of that name points to is not ours to write."""
        path = self.out / name
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(body)
        return path

    def sampling(self) -> None:
        for phase in ("opening", "translating", "building", "sampling"):
            self.say("phase", phase=phase)

    def progress(self, fraction: float, **members: Any) -> None:
        self.say("progress", fraction=fraction, samples_done=64 * fraction, rays=1000, elapsed_s=fraction, **members)

    def checkpoint(self, body: bytes = b"") -> None:
        self.number += 1
        name = f"checkpoint-{self.number}.prc"
        self.write(name, body or self.went_on_from + str(self.number).encode())
        self.say("checkpoint", number=self.number, file=name, bytes=1, samples=8.0, seconds=1.0)

    def done(self, reason: str = "samples", pixels: str = "0" * 64, met: bool | None = None, **changes: Any) -> None:
        outputs = []
        for name in self.command["outputs"]:
            body = f"{name} {pixels}".encode()
            self.write(name, body)
            digest = hashlib.sha256(body).hexdigest()
            kind = "application/json" if name.endswith("json") else "image/png"
            outputs.append({"name": name, "file": name, "bytes": len(body), "sha256": digest, "media_type": kind} | changes)
        error = {"relmse": {"estimate": 0.02, "ci95": [0.01, 0.03]}}
        report = {"stop": {"reason": reason, "target_met": met}, "samples": 64, "rays": 1000, "error": error}
        self.say("done", outputs=outputs, report={**report, "pixels_sha256": pixels, "stages_s": {"render": 1.0}})

    def fails(self, slug: str, detail: str = "As it is.") -> None:
        self.say("failed", problem=Problem(slug, detail).as_json())

    async def hears(self, *does: str) -> str:
        """Wait until it is told one of these."""
        while (told := await self._commands.get()) not in does:
            pass
        return told


Script = Callable[[Worker], Awaitable[None]]


class ScriptedHandle:
    def __init__(self, worker: Worker, work: asyncio.Task[None], on_release: Callable[[], None]) -> None:
        self._worker = worker
        self._work = work
        self._killed = False
        self._on_release = on_release

    @property
    def folder(self) -> Path:
        return self._worker.out

    async def result(self) -> Ended:
        await asyncio.wait([self._work])
        reason: str = "exited"
        code: int | None = 0
        number: int | None = None
        if self._killed:
            reason, code, number = "killed", None, signal.SIGKILL
        elif (error := self._work.exception()) is not None:
            if not isinstance(error, Dies):
                raise error
            reason, code, number = error.ended
        return Ended(reason, code, number, self.folder, 0.5, 2**20, "the worker's log\n")

    def tell(self, command: Json) -> None:
        self._worker.told.append(command["do"])
        self._worker._commands.put_nowait(command["do"])

    def kill(self) -> None:
        if not self._work.done():
            self._killed = True
            self._work.cancel()

    def release(self) -> None:
        self._on_release()


class ScriptedExecutor:
    """`workers` are all that ever ran. A script of a check is told apart by `worker.chunk.kind`."""

    def __init__(self, data: DataDirectory, script: Script, slots: int = 1) -> None:
        self._data = data
        self._slots = slots
        self.script = script
        self.workers: list[Worker] = []
        self.running: set[asyncio.Task[None]] = set()
        self.most_running = 0
        self.held = 0  # slots not released

    def capacity(self) -> Capacity:
        return Capacity(self._slots, 2, 2**30)

    async def start(self) -> None:
        return

    def submit(self, chunk: Chunk, on_message: OnMessage) -> ScriptedHandle:
        folder = self._data.slots / chunk.id / "out"
        folder.mkdir(parents=True)
        worker = Worker(chunk, folder, on_message)
        self.workers.append(worker)
        work = asyncio.create_task(self._play(worker))
        self.running.add(work)
        work.add_done_callback(self.running.discard)
        self.most_running = max(self.most_running, len(self.running))
        self.held += 1

        def release() -> None:
            self.held -= 1
            shutil.rmtree(folder.parent, ignore_errors=True)

        return ScriptedHandle(worker, work, release)

    async def _play(self, worker: Worker) -> None:
        await self.script(worker)

    def health(self) -> Json:
        return {"ok": True}

    async def close(self) -> None:
        for work in self.running:
            work.cancel()
