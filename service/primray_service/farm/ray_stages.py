"""RayStages: whole pictures of many stages on the nodes of a Ray cluster, each by one of them, for contact sheets.

The driver, tasks, sandbox and scene caches are those of `RayParts`.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import shutil
import tempfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Self

from primray.cli.ray_sheets import RemoteEnd
from primray.cli.sheet_renders import stopping
from primray.distributed.executor import PartLost
from primray.errors import LimitError, SettingsError
from primray.settings import RenderSettings, settings_as_json

from ..cli.exits import error_of
from ..executor.base import Chunk, Ended
from ..problems import Problem
from .ray_parts import NEVER_S, RayParts, _Heard, packed

TIME_LIMIT = "time-limit"


class RayStages(RayParts):
    """Use it as a context manager: it connects as it is entered. `render` may be called by many threads."""

    def __init__(self, address: str = "auto", **options: Any) -> None:
        super().__init__(address, **options)
        self._numbers = itertools.count(1)

    def __enter__(self) -> Self:
        self._connect()
        return self

    def render(
        self, stage: Path, settings: RenderSettings, names: tuple[str, ...], folder: Path, timeout_s: float, memory_bytes: int
    ) -> RemoteEnd:
        """Render a stage on some node and write the files of these names. TimeoutError, PartLost or PrimrayError."""
        if settings.session_layer is not None:
            sentence = "a session layer cannot be sent to other machines: make it a layer of the stage"
            raise SettingsError(sentence, where="session_layer", code="parts-setting")
        with tempfile.TemporaryDirectory(prefix="primray-scene-") as scratch:
            chunk = self._whole(stage, settings, names, Path(scratch), memory_bytes)
            running = asyncio.run_coroutine_threadsafe(self._run(chunk, names, folder), self._loop)
            with stopping(running.cancel):
                try:
                    return running.result(timeout_s)
                except TimeoutError:
                    running.cancel()
                    raise

    def _whole(self, stage: Path, settings: RenderSettings, names: tuple[str, ...], scratch: Path, memory_bytes: int) -> Chunk:
        assert self._executor is not None
        found, number = packed(stage, scratch), next(self._numbers)
        given_bytes = self._executor.capacity().memory_bytes  # a chunk that asks for more than nodes have is never begun
        limits = replace(self._limits, memory_bytes=min(memory_bytes, given_bytes))
        command = {
            "do": "render",
            "file": found.root,
            "settings": settings_as_json(settings),
            "checkpoint": None,
            "number": 0,
            "checkpoint_every_s": NEVER_S,
            "picture_only": False,
            "preview": False,
            "outputs": list(names),
            "limits": asdict(limits),
        }
        return Chunk(
            f"{number} {found.root}",
            "render",
            json.loads(json.dumps(command)),
            found.inputs,
            found.folders,
            load_cpu_s=limits.load_cpu_s,
            memory_bytes=limits.memory_bytes,
        )

    async def _run(self, chunk: Chunk, names: tuple[str, ...], folder: Path) -> RemoteEnd:
        assert self._executor is not None
        heard = _Heard()
        try:
            handle = self._executor.submit(chunk, heard)
        except Problem as problem:  # the cluster has just gone away
            raise PartLost(str(problem.detail)) from None
        ending = asyncio.ensure_future(handle.result())
        try:
            return await asyncio.to_thread(_taken, await asyncio.shield(ending), heard, names, folder)
        except asyncio.CancelledError:
            handle.kill()
            await ending
            raise
        finally:
            handle.release()


def _taken(ended: Ended, heard: _Heard, names: tuple[str, ...], folder: Path) -> RemoteEnd:
    """Copy the files that came, and return how the process ended."""
    if heard.problem is not None:
        raise error_of(heard.problem)
    if heard.is_done:
        for name in names:
            if (ended.folder / name).is_file():
                shutil.copyfile(ended.folder / name, folder / name)
        return RemoteEnd(0, ended.peak_rss_bytes, "")
    last = (ended.log.strip().splitlines() or [ended.protocol_error])[-1]
    if ended.reason in ("lost", "killed"):
        raise PartLost(f"its node was lost: {last}")
    if ended.reason == TIME_LIMIT:
        raise TimeoutError
    if ended.reason in ("memory-limit", "storage-limit"):
        raise LimitError(f"it was ended for its {ended.reason.replace('-', ' ')}: {last}", code=ended.reason)
    code = -ended.signal if ended.signal else ended.exit_code or 1
    return RemoteEnd(code, ended.peak_rss_bytes, f"error: its process ended with {code}: {last}")
