"""RayParts: parts of a frame as chunks on the nodes of a Ray cluster, for a render without a service.

A RayExecutor in an event loop of its own thread does the work, with the same driver, tasks, sandbox and scene caches as in the
service. Nothing is kept beyond the frame; samples of a lost chunk are rendered again.
"""

from __future__ import annotations

import asyncio
import json
import logging
import shutil
import tempfile
import threading
from collections.abc import Coroutine, Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from primray.distributed.executor import PartLost
from primray.errors import LimitError, SettingsError
from primray.settings import RenderSettings, settings_as_json

from ..cli.exits import SCENE_REJECTED, CommandError, error_of, problems_as_errors
from ..cli.scene_file import scene_file
from ..executor.base import Chunk, Ended, Handle
from ..executor.ray.executor import RayExecutor
from ..files import DataDirectory
from ..jobs import Json
from ..limits import Limits
from ..problems import Problem

T = TypeVar("T")
DAY_S = 24 * 3600.0
# Holders of the cluster's token render stages of their own, so the limits against untrusted users of a service do not apply.
LIMITS = Limits(load_cpu_s=DAY_S, seconds=30 * DAY_S, texture_bytes=2**40, output_bytes=2**40, instances=2**40)
OF_ANY_NODE = ("memory-limit", "time-limit", "storage-limit")  # ends that would be the same on any node
LEAVE_WITHIN_S = 5.0
NEVER_S = 1e9  # no checkpoints before the end


class RayParts:
    """Executor of parts on a cluster. `address`: of the cluster's head, or "auto" on one of its nodes; the others are as for
    `primray serve --executor ray`.

    Close it, or use it as a context manager; it connects when its first frame begins.
    """

    def __init__(
        self,
        address: str = "auto",
        *,
        slots: int | None = None,
        cores: int | None = None,
        labels: Mapping[str, str] | None = None,
        limits: Limits = LIMITS,
        allow_unsandboxed: bool = False,
    ) -> None:
        self._limits = limits
        self._made_by: dict[str, Any] = {
            "address": address,
            "slots": slots,
            "cores": cores,
            "labels": labels,
            "allow_unsandboxed": allow_unsandboxed,
        }
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._executor: RayExecutor | None = None
        self._loop = asyncio.new_event_loop()
        self._thread: threading.Thread | None = None
        self._packed: Packed | None = None
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        self._running: set[Future[None]] = set()
        self._following: set[asyncio.Task[None]] = set()
        self._frames = self._parts = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def begin(self, stage: str) -> None:
        if self._executor is None:
            self._connect()
        self._scratch = tempfile.TemporaryDirectory(prefix="primray-scene-")
        self._packed = packed(Path(stage), Path(self._scratch.name))
        self._frames += 1

    def _connect(self) -> None:
        """Connect; raises PrimrayError, with a code of executor/ray/protocol.py, if there is no usable cluster."""
        self._folder = tempfile.TemporaryDirectory(prefix="primray-ray-")
        data = DataDirectory(Path(self._folder.name))
        data.create()
        if self._thread is None:
            self._thread = threading.Thread(target=self._loop.run_forever, name="ray parts", daemon=True)
            self._thread.start()

        async def started() -> RayExecutor:
            executor = RayExecutor(data, self._limits, **self._made_by)
            try:
                await executor.start()
            except BaseException:
                await executor.close()
                raise
            return executor

        with problems_as_errors():
            self._executor = self._wait(started())

    def _wait(self, work: Coroutine[Any, Any, T]) -> T:
        """Run the coroutine in the loop's thread, and wait for it."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def slots(self) -> int:
        return 0 if self._executor is None else self._executor.capacity().slots

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        if settings.session_layer is not None:
            sentence = "a session layer cannot be sent to other machines: make it a layer of the stage"
            raise SettingsError(sentence, where="session_layer", code="parts-setting")
        self._parts += 1
        future: Future[None] = Future()
        self._running.add(future)
        future.add_done_callback(self._running.discard)
        self._loop.call_soon_threadsafe(self._give, self._chunk(settings), file, future)
        return future

    def _chunk(self, settings: RenderSettings) -> Chunk:
        assert self._packed is not None
        assert settings.sample_range is not None
        first, end = settings.sample_range
        command: Json = {
            "do": "render",
            "file": self._packed.root,
            "settings": settings_as_json(settings),
            "checkpoint": None,
            "number": 10 * self._parts,  # a worker that stays must not leave two files of one name
            "checkpoint_every_s": NEVER_S,
            "picture_only": False,
            "preview": False,
            "part": True,
            "keeps_beside": True,
            "limits": asdict(self._limits),
        }
        return Chunk(
            f"{self._packed.root} {first}:{end}",
            "render",
            json.loads(json.dumps(command)),
            self._packed.inputs,
            self._packed.folders,
            load_cpu_s=self._limits.load_cpu_s,
            group=f"frame-{self._frames}",
            more_follow=True,
        )

    def _give(self, chunk: Chunk, file: Path, future: Future[None]) -> None:
        """Submit a chunk; runs in the loop."""
        assert self._executor is not None
        if future.cancelled():
            return
        heard = _Heard()
        try:
            handle = self._executor.submit(chunk, heard)
        except Problem as problem:  # the cluster has just gone away
            _settle(future, PartLost(str(problem.detail)))
            return
        future.add_done_callback(lambda done: self._loop.call_soon_threadsafe(handle.kill) if done.cancelled() else None)
        following = asyncio.ensure_future(_follow(handle, heard, file, future))
        self._following.add(following)  # a task without a reference may be garbage-collected
        following.add_done_callback(self._following.discard)

    def end(self) -> None:
        for future in list(self._running):
            future.cancel()
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = self._packed = None

    def close(self) -> None:
        self.end()
        if self._executor is not None:
            self._wait(self._ended(self._executor))
            self._executor = None
        if self._thread is not None:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._thread = None
        if not self._loop.is_running():
            self._loop.close()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    async def _ended(self, executor: RayExecutor) -> None:
        await executor.close()
        if self._following:
            await asyncio.wait(self._following, timeout=LEAVE_WITHIN_S)


class _Heard:
    """Messages of a chunk's worker that matter here."""

    def __init__(self) -> None:
        self.file = ""  # its checkpoint
        self.is_done = False
        self.problem: Json | None = None

    def __call__(self, message: Mapping[str, Any]) -> None:
        at = message.get("at")
        if at == "checkpoint":
            self.file = Path(str(message["file"])).name
        elif at == "failed":
            self.problem = dict(message["problem"])
        self.is_done = self.is_done or at == "done"


async def _follow(handle: Handle, heard: _Heard, file: Path, future: Future[None]) -> None:
    ended = await handle.result()
    try:
        if not future.cancelled():
            _settle(future, await asyncio.to_thread(_taken, ended, heard, file))
    finally:
        handle.release()


def _taken(ended: Ended, heard: _Heard, file: Path) -> Exception | None:
    """Copy the checkpoint to its file; return the error, or None."""
    if heard.problem is not None:
        return error_of(heard.problem)
    if heard.is_done and heard.file:
        try:
            shutil.move(ended.folder / heard.file, file)
        except OSError as error:
            return PartLost(f"its checkpoint did not arrive: {error.strerror}")
        return None
    last = (ended.log.strip().splitlines() or [ended.protocol_error])[-1]
    if ended.reason in OF_ANY_NODE:
        return LimitError(f"a part was ended for its {ended.reason.replace('-', ' ')}: {last}", code=ended.reason)
    return PartLost(f"its worker ended ({ended.reason}): {last}")


def _settle(future: Future[None], error: Exception | None) -> None:
    with suppress(InvalidStateError):  # it was cancelled
        if error is None:
            future.set_result(None)
        else:
            future.set_exception(error)


LOG = logging.getLogger("primray")
PACKAGE = "package"


@dataclass(frozen=True)
class Packed:
    """A packed stage; `root` is its path in a chunk's job folder."""

    root: str
    inputs: Mapping[str, Path] = field(default_factory=dict)
    folders: Mapping[str, Path] = field(default_factory=dict)


def packed(stage: Path, scratch: Path) -> Packed:
    """Pack a stage; raises PrimrayError if a file cannot be read. Notes about files go to the log."""
    found = scene_file(stage, scratch)
    for note in found.notes:
        LOG.warning(note)
    if found.members is None or found.entry is None:
        # A copy: nodes must not get half of a file that is saved while the frame is rendered.
        copy = scratch / f"root{found.path.suffix.lower()}"
        shutil.copyfile(found.path, copy)
        return Packed(found.name, {found.name: copy})
    folder = scratch / PACKAGE
    for name, file in found.members.items():
        copy = folder / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(file, copy)
        except OSError as error:
            raise CommandError(
                "unreadable-file", f"it cannot be read: {error.strerror}", SCENE_REJECTED, where=str(file)
            ) from None
    return Packed(f"{PACKAGE}/{found.entry}", {}, {PACKAGE: folder})
