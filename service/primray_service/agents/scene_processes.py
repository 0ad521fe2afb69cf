"""A process for each scene that agents look at: started in the sandbox of the service's workers, each answer within a time.

What takes too long, dies or says nothing sensible is ended, and the next request of the scene starts another process. Those
that were not used longest are ended where all together hold more memory than they may. One process is kept ready for the next
scene, because starting Python in a sandbox takes longer than a look.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import tempfile
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from primray.errors import LimitError, PrimrayError

from ..executor.process import kill_with_children, used_by
from ..sandbox import Budget, worker_spawn

PROGRAM = ("-m", "primray_service.agents.scene_process")
START_S = 30.0
MOST_LINE_BYTES = 4 * 2**20
MOST_WAITING = 16
MOST_SCENES = 8
MOST_HELD = 0.75  # of the memory, up to which another process is kept ready


@dataclass(frozen=True, kw_only=True)
class SceneLimits:
    memory_bytes: int  # of all processes together; the budget of each
    threads: int
    file_bytes: int = 2 * 2**30


@dataclass(eq=False)
class SceneProcess:
    child: asyncio.subprocess.Process
    slot: Path
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)
    users: int = 0

    @property
    def out(self) -> Path:
        return self.slot / "out"

    async def ask(self, request: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        """Return the answer; raises TimeoutError, EOFError or ValueError where there is none."""
        assert self.child.stdin is not None
        self.child.stdin.write(json.dumps(request).encode() + b"\n")
        async with asyncio.timeout(seconds):
            await self.child.stdin.drain()
            return await self.line()

    async def line(self) -> dict[str, Any]:
        assert self.child.stdout is not None
        text = await self.child.stdout.readline()
        if not text:
            raise EOFError
        found = json.loads(text)
        if not isinstance(found, dict):
            raise ValueError("an answer is an object")
        return found

    def is_alive(self) -> bool:
        return self.child.returncode is None

    async def end(self) -> None:
        if self.child.returncode is None:
            kill_with_children(self.child.pid)
        await self.child.wait()  # until nothing holds its pipes
        shutil.rmtree(self.slot, ignore_errors=True)


def _moved(file: Path, target: Path) -> None:
    """Move a file that a process has written, by no link that it may have put there."""
    with os.fdopen(os.open(file, os.O_RDONLY | os.O_NOFOLLOW), "rb") as source, target.open("wb") as copy:
        shutil.copyfileobj(source, copy)
    file.unlink()


class SceneProcesses:
    """Belongs to the loop of the main thread: children die with the thread that starts them."""

    def __init__(self, roots: Sequence[Path], limits: SceneLimits) -> None:
        self._roots = [str(root) for root in roots]
        self._limits = limits
        self._folder = Path(tempfile.mkdtemp(prefix="primray-mcp-"))
        self._known: OrderedDict[str, SceneProcess] = OrderedDict()  # used last at the end
        self._ready: asyncio.Task[SceneProcess] | None = None  # a process without a scene
        self._starting = asyncio.Lock()
        self._waiting = 0
        self._number = 0

    @property
    def count(self) -> int:
        return len(self._known)

    def get_ready(self) -> None:
        """Start a process for the next scene, unless one is ready or the scenes leave too little memory."""
        if self._ready is None and self._held_by_scenes() < MOST_HELD * self._limits.memory_bytes:
            self._ready = asyncio.create_task(self._started(""))

    async def answer(
        self, scene: str, request: Mapping[str, Any], seconds: float, into: Mapping[str, Path] | None = None
    ) -> dict[str, Any]:
        """Return what the scene's process answers. PrimrayError with its code and place where it fails; `into`: where the files
        go that it writes, by their names."""
        if self._waiting >= MOST_WAITING:
            raise LimitError(f"{MOST_WAITING} requests are waiting already; repeat this one later", code="busy")
        self._waiting += 1
        try:
            found = await self._answered(scene, request, seconds, into or {})
        finally:
            self._waiting -= 1
        self.get_ready()  # after the answer, which needs the CPUs
        await self._shrink()
        if "error" in found:
            error = found["error"]
            raise PrimrayError(str(error["message"]), where=str(error["where"]), code=str(error["code"]))
        return found

    async def _answered(
        self, scene: str, request: Mapping[str, Any], seconds: float, into: Mapping[str, Path]
    ) -> dict[str, Any]:
        """Return what the scene's process answers when it is this request's turn; another process where that one has ended by
        then, as it does at a request that takes too long."""
        while True:
            process = await self._process_of(scene)
            process.users += 1
            try:
                async with process.turn:
                    if not process.is_alive():
                        continue
                    found = await self._asked(scene, process, request, seconds)
                    for name, target in into.items() if "error" not in found else ():
                        await asyncio.to_thread(_moved, process.out / name, target)
                    return found
            finally:
                process.users -= 1

    async def _asked(self, scene: str, process: SceneProcess, request: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        answered = False
        try:
            found = await process.ask(request, seconds)
            answered = True
            return found
        except TimeoutError:
            raise LimitError(f"there was no answer in {seconds:.0f} s", where=scene, code="time") from None
        except (EOFError, ValueError, OSError):
            raise await self._death_of(scene, process) from None
        finally:
            if not answered:  # also where the client cancels: the process would answer a question that nobody asks any more
                await self._forget(scene, process)

    async def _death_of(self, scene: str, process: SceneProcess) -> PrimrayError:
        with suppress(TimeoutError):
            async with asyncio.timeout(2):
                await process.child.wait()
        code = process.child.returncode
        signalled = code is not None and (code < 0 or code > 128)
        name = signal.Signals(-code if code < 0 else code - 128).name if signalled and code is not None else f"status {code}"
        sentence = f"the scene's process ended with {name}; it may need more than its memory, or its files are damaged"
        return PrimrayError(sentence, where=scene, code="scene-process")

    async def _process_of(self, scene: str) -> SceneProcess:
        async with self._starting:
            found = self._known.get(scene)
            if found is not None and found.is_alive():
                self._known.move_to_end(scene)
                return found
            if found is not None:
                await self._forget(scene, found)
            while len(self._known) >= MOST_SCENES and await self._end_oldest():
                pass
            process = self._known[scene] = await self._ready_or_started(scene)
            return process

    async def _ready_or_started(self, scene: str) -> SceneProcess:
        ready, self._ready = self._ready, None
        if ready is not None:
            try:
                process = await ready
            except (PrimrayError, OSError):
                return await self._started(scene)  # the fault may be over, and is raised with the scene's name if it is not
            if process.is_alive():
                return process
            await process.end()
        return await self._started(scene)

    async def _started(self, scene: str) -> SceneProcess:
        self._number += 1
        slot = self._folder / str(self._number)
        for name in ("job", "out"):
            (slot / name).mkdir(parents=True, mode=0o700)
        limits = self._limits
        budget = Budget(memory_bytes=limits.memory_bytes, threads=limits.threads, file_bytes=limits.file_bytes)
        spawn = worker_spawn(slot, budget, PROGRAM, roots=self._roots)
        pipe = asyncio.subprocess.PIPE
        starting = asyncio.ensure_future(
            asyncio.create_subprocess_exec(
                *spawn.argv,
                env=spawn.env,
                cwd=spawn.cwd,
                stdin=pipe,
                stdout=pipe,
                start_new_session=True,
                limit=MOST_LINE_BYTES,
            )
        )
        try:
            process = SceneProcess(await asyncio.shield(starting), slot)
        except asyncio.CancelledError:  # asyncio would kill bubblewrap alone, and wait for the pipes of what it has started
            await SceneProcess(await starting, slot).end()
            raise
        try:
            async with asyncio.timeout(START_S):
                await process.line()
        except BaseException as error:
            await process.end()
            if isinstance(error, TimeoutError | EOFError | ValueError):
                sentence = "the scene's process cannot be started in its sandbox"
                raise PrimrayError(sentence, where=scene, code="scene-process") from None
            raise
        return process

    async def _shrink(self) -> None:
        """End processes that were not used longest, until the rest hold no more than they may."""
        while self._held_by_scenes() > self._limits.memory_bytes:
            if not await self._end_oldest():
                return

    def _held_by_scenes(self) -> int:
        return sum(used_by(process.child.pid).rss_bytes for process in self._known.values())

    async def _end_oldest(self) -> bool:
        """End the process that was not used longest, if it is idle and not the last one; return whether there was one."""
        for scene, process in list(self._known.items())[:-1] if len(self._known) > 1 else []:
            if not process.users:
                await self._forget(scene, process)
                return True
        return False

    async def _forget(self, scene: str, process: SceneProcess) -> None:
        if self._known.get(scene) is process:
            del self._known[scene]
        await process.end()

    async def close(self) -> None:
        ready, self._ready = self._ready, None
        if ready is not None:
            ready.cancel()
            with suppress(asyncio.CancelledError, PrimrayError, OSError):
                await (await ready).end()
        for scene, process in list(self._known.items()):
            await self._forget(scene, process)
        shutil.rmtree(self._folder, ignore_errors=True)
