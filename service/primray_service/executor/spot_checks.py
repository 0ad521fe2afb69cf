"""CheckedExecutor: parts of frames run on machines that are not trusted; all else, and spot checks of these parts, run here.

Merges, pictures, frames that are not rendered in parts, and checks of scenes are this machine's. A part's film is copied and
hashed when its worker says that it is done; random tiles, drawn by a secret and that hash, are rendered again here
(primray.distributed.spot_checks). If they have the same bits, the dispatcher gets the part, with what is known of the scene
here. Otherwise the part counts as lost, and is given out again. What a part saves under way cannot be checked, and is not kept.

A machine of which a second part is wrong is excluded: once may have been a bit that flipped. Frames that have accepted parts of
it begin again, as the tiles that were checked of these are few.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import shutil
import signal
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from primray.content_hash import hash_of_file
from primray.distributed.planner import seed_of

from ..files import DataDirectory
from ..jobs import Json
from .base import Capacity, Chunk, Ended, Executor, Handle, Message, OnMessage

LOG = logging.getLogger(__name__)
PART = "part.prc"
CHECK_CPU_S = 900.0  # before a check has prepared its scene
FROM_CHUNK = ("file", "settings", "limits", "root")
WRONG_PARTS = 2  # after which a machine is excluded
MOST_FRAMES = 1000  # whose machines are known
WITHDRAWN = "the frame begins again: it has parts of a node that is excluded"


@runtime_checkable
class Excluding(Protocol):
    """An executor of several machines, which can be excluded. Its handles name the `worker` that runs the chunk."""

    def exclude(self, worker: str, why: str) -> None: ...


class CheckedExecutor:
    """`outside` runs parts, `inside` all else. `tiles`: how many are rendered again of each part. `refused`: parts so far;
    `excluded`: machines that get no more, and why."""

    def __init__(
        self, outside: Executor, inside: Executor, data: DataDirectory, *, tiles: int, secret: bytes | None = None
    ) -> None:
        self.refused = 0
        self.excluded: dict[str, str] = {}
        self.tiles = tiles
        self._wrong: Counter[str] = Counter()  # parts by machine
        self._accepted: dict[str, set[str]] = {}  # machines of accepted parts, by the frame's group
        self._withdrawn: set[str] = set()  # frames that begin again
        self.outside, self.inside, self.data = outside, inside, data
        self.secret = secrets.token_bytes(32) if secret is None else secret
        self.places = asyncio.Semaphore(1)

    def capacity(self) -> Capacity:
        return self.outside.capacity()

    async def start(self) -> None:
        await self.inside.start()
        self.places = asyncio.Semaphore(self.inside.capacity().slots)
        await self.outside.start()

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        if chunk.command.get("part"):
            return _CheckedPart(self, chunk, on_message)
        if chunk.kind == "render":
            return _Waiting(self, chunk, on_message)
        return self.inside.submit(chunk, on_message)

    def health(self) -> Json:
        outside, inside = self.outside.health(), self.inside.health()
        checks = {"tiles": self.tiles, "refused": self.refused, "excluded": [worker[:8] for worker in self.excluded]}
        return {**outside, "ok": bool(outside["ok"] and inside["ok"]), "spot_checks": checks}

    def accepts(self, worker: str, group: str) -> None:
        """Note that a part of this machine is in the frame."""
        self._accepted.setdefault(group, set()).add(worker)
        while len(self._accepted) > MOST_FRAMES:
            del self._accepted[next(iter(self._accepted))]

    def refuses(self, worker: str, why: str) -> None:
        """Count a wrong part of a machine, which is excluded if it is not the first."""
        self.refused += 1
        self._wrong[worker] += 1
        if not worker or self._wrong[worker] < WRONG_PARTS or worker in self.excluded:
            return
        self.excluded[worker] = f"{self._wrong[worker]} of its parts do not have the bits of a render here, the last: {why}"
        LOG.error("the node %s is excluded: %s", worker[:8], self.excluded[worker])
        if isinstance(self.outside, Excluding):
            self.outside.exclude(worker, self.excluded[worker])
        self._withdrawn |= {group for group, workers in self._accepted.items() if worker in workers}

    def is_excluded(self, worker: str) -> bool:
        return worker in self.excluded

    def withdraws(self, group: str) -> bool:
        """Return whether the frame has to begin again; asked once."""
        if group not in self._withdrawn:
            return False
        self._withdrawn.discard(group)
        self._accepted.pop(group, None)
        return True

    async def close(self) -> None:
        await self.outside.close()
        await self.inside.close()


class _Waiting:
    """A chunk that runs here once there is a place."""

    def __init__(self, executor: CheckedExecutor, chunk: Chunk, on_message: OnMessage) -> None:
        self._executor, self._chunk, self._on_message = executor, chunk, on_message
        self._handle: Handle | None = None
        self._told: list[Json] = []
        self._work = asyncio.create_task(self._live())

    async def _live(self) -> Ended:
        async with self._executor.places:
            self._handle = self._executor.inside.submit(self._chunk, self._on_message)
            for command in self._told:
                self._handle.tell(command)
            return await self._handle.result()

    @property
    def folder(self) -> Path:
        return Path() if self._handle is None else self._handle.folder

    async def result(self) -> Ended:
        try:
            return await asyncio.shield(self._work)
        except asyncio.CancelledError:
            if not self._work.cancelled():
                raise
            return Ended("killed", None, signal.SIGKILL, Path(), 0.0, 0, "")

    def tell(self, command: Json) -> None:
        if self._handle is None:
            self._told.append(command)
        else:
            self._handle.tell(command)

    def kill(self) -> None:
        if self._handle is None:
            self._work.cancel()
        else:
            self._handle.kill()

    def release(self) -> None:
        if self._handle is not None:
            self._handle.release()


class _CheckedPart:
    """A part that runs elsewhere, and then its check, as one chunk."""

    def __init__(self, executor: CheckedExecutor, chunk: Chunk, on_message: OnMessage) -> None:
        self._executor, self._chunk, self._on_message = executor, chunk, on_message
        self._saved: Message | None = None
        self._done: Message | None = None
        self._is_done = asyncio.Event()
        self._is_wrong = False  # by its check, as opposed to parts that could not be checked
        self._check: _Waiting | None = None
        self._copies = executor.data.slots / f"{chunk.id}-check"
        self._outer = executor.outside.submit(chunk, self._hear)
        self._work = asyncio.create_task(self._live())

    def _hear(self, message: Message) -> None:
        """Pass messages on, but for what the part leaves, and that it is done."""
        at = message.get("at")
        if at == "checkpoint":
            self._saved = message
        elif at == "done":
            self._done = message
            self._is_done.set()
        else:
            self._on_message(message)

    async def _live(self) -> Ended:
        ending, done = asyncio.create_task(self._outer.result()), asyncio.create_task(self._is_done.wait())
        await asyncio.wait([ending, done], return_when=asyncio.FIRST_COMPLETED)
        done.cancel()
        if self._done is None:
            return await ending
        executor, group, worker = self._executor, self._group, getattr(self._outer, "worker", "")
        why = await self._fault(worker) if _is_whole(self._done) else ""
        if self._is_wrong:
            executor.refuses(worker, why)
        is_withdrawn = executor.withdraws(group)
        if not why and not is_withdrawn:
            self._on_message(self._done)
            return await ending
        LOG.warning("part %s is refused: %s", self._chunk.id, why or WITHDRAWN)
        self._outer.kill()
        ended = await ending
        log = ended.log if not ended.log or ended.log.endswith("\n") else f"{ended.log}\n"
        log += f"the part is refused: {why}\n" if why else ""
        log += f"{WITHDRAWN}\n" if is_withdrawn else ""
        reason = "withdrawn" if is_withdrawn else "lost"
        return replace(ended, reason=reason, exit_code=None, signal=None, log=log, log_file=None, lives=False)

    @property
    def _group(self) -> str:
        """The frame that the part is of: its job may have others."""
        return f"{self._chunk.group} {self._chunk.command['settings'].get('time_code')}"

    async def _fault(self, worker: str) -> str:
        """Return why the part is refused, "" if it is not: then the dispatcher is told of its checkpoint."""
        if self._executor.is_excluded(worker):
            return "its node is excluded"
        if self._saved is None:
            return "it left no film"
        try:
            chunk = await asyncio.to_thread(self._check_chunk, self._saved)
        except (OSError, KeyError, TypeError, ValueError) as error:
            return f"its film did not arrive: {error!r}"
        heard: dict[str, Message] = {}
        over = asyncio.Event()

        def hear(message: Mapping[str, Any]) -> None:
            heard[str(message.get("at"))] = message
            if message.get("at") in ("done", "failed"):
                over.set()

        self._check = _Waiting(self._executor, chunk, hear)
        ending, last = asyncio.create_task(self._check.result()), asyncio.create_task(over.wait())
        await asyncio.wait([ending, last], return_when=asyncio.FIRST_COMPLETED)
        last.cancel()
        if "done" not in heard:
            detail = heard.get("failed", {}).get("problem", {}).get("detail", "its check ended")
            return f"it could not be checked: {detail}"
        fault = heard["done"]["report"]["parts"]["fault"]
        self._is_wrong = fault is not None
        if self._executor.is_excluded(worker):  # meanwhile
            return "its node is excluded"
        if fault is None and "checkpoint" in heard:
            self._executor.accepts(worker, self._group)
            self._on_message(heard["checkpoint"])
            return ""
        return str(fault)

    def _check_chunk(self, saved: Message) -> Chunk:
        """Copy the film, so that nobody can change it any more, and return the chunk that checks it."""
        self._copies.mkdir(parents=True, exist_ok=True)
        copy, chunk = self._copies / PART, self._chunk
        shutil.copyfile(self._outer.folder / str(saved["file"]), copy, follow_symlinks=False)
        first, end = chunk.command["settings"]["sample_range"]
        seed = seed_of(self._executor.secret, hash_of_file(copy), (first, end))
        command = {name: chunk.command[name] for name in FROM_CHUNK if name in chunk.command}
        command |= {"do": "spot-check", "part": PART, "number": chunk.command["number"], "seed": f"{seed:x}"}
        return replace(
            chunk,
            id=f"{chunk.id}-check",
            command=command | {"tiles": self._executor.tiles},
            inputs={**chunk.inputs, PART: copy},
            load_cpu_s=CHECK_CPU_S,
            group=f"{chunk.group}/checks",
        )

    @property
    def folder(self) -> Path:
        return self._outer.folder if self._check is None else self._check.folder

    async def result(self) -> Ended:
        return await asyncio.shield(self._work)

    def tell(self, command: Json) -> None:
        self._outer.tell(command)

    def kill(self) -> None:
        self._outer.kill()
        if self._check is not None:
            self._check.kill()

    def release(self) -> None:
        self._outer.release()
        if self._check is not None:
            self._check.release()
        with suppress(OSError):
            shutil.rmtree(self._copies)


def _is_whole(done: Message) -> bool:
    """Return whether a part took all of its samples; the dispatcher keeps no other."""
    stop = done.get("report", {}).get("stop")
    return isinstance(stop, Mapping) and stop.get("reason") == "samples"
