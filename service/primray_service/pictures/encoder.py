"""The server's interface to the helper process: one request at a time, recent pictures cached, each picture made once."""

from __future__ import annotations

import asyncio
import json
import os
import struct
import sys
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..limits import MiB
from ..problems import Problem
from .request import PictureRequest, Space

KEPT_BYTES = 64 * MiB
TIMEOUT_S = 20.0
MOST_TABLES = 12  # each is smaller than a megabyte
LINE_BYTES = 64 * 1024
# Beginning of worker/preview.py's header, which is read here without numpy: magic, version, 4 sizes, passes, samples.
HEADER = struct.Struct("<8sIIIIIIQ")
MAGIC = b"primrayP"


@dataclass(frozen=True)
class Picture:
    data: bytes = field(repr=False)
    media_type: str
    headers: dict[str, str]


def revision(path: Path) -> str | None:
    """Return the revision of the preview in a file, reading only its header; None if there is none. Blocks, but briefly."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return None
    with os.fdopen(handle, "rb") as file:
        head = file.read(HEADER.size)
        made = os.fstat(file.fileno())
    if len(head) < HEADER.size or head[:8] != MAGIC:
        return None
    *_, passes, samples = HEADER.unpack(head)
    # The file's inode and time are included, since another attempt may reach the same pass.
    return f"{passes}-{samples}-{made.st_ino:x}-{made.st_mtime_ns:x}"


class PictureEncoder:
    """Encoder for one event loop. The helper starts with the first picture (or `warm`), and again if it died."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._turn = asyncio.Lock()
        self._kept: OrderedDict[tuple[str, str, PictureRequest], Picture] = OrderedDict()
        self._kept_bytes = 0
        self._tables: dict[tuple[str | None, ...], bytes] = {}

    async def picture(self, path: Path, known_revision: str, request: PictureRequest) -> Picture:
        """Return a picture; Problem("unavailable") if it cannot be made."""
        key = (str(path), known_revision, request)
        if (kept := self._get(key)) is not None:
            return kept
        async with self._turn:
            if (kept := self._get(key)) is not None:  # another request made it meanwhile
                return kept
            made = await self._made({"path": str(path), **request.as_json()})
            self._keep(key, made)
            return made

    async def view_table(self, space: Space, *through: str | None) -> bytes:
        """Return the display transform as views.view_table makes it: view, display and look, or the configuration's defaults.
        Raises Problem("unavailable") if it cannot be made."""
        key = (space, *through)
        async with self._turn:
            if key not in self._tables:
                made = (await self._made({"table": key})).data
                while len(self._tables) >= MOST_TABLES:
                    del self._tables[next(iter(self._tables))]
                self._tables[key] = made
            return self._tables[key]

    async def warm(self) -> None:
        """Start the helper before it is needed."""
        async with self._turn:
            await self._running()

    async def close(self) -> None:
        process, self._process = self._process, None
        if process is not None and process.returncode is None:
            process.kill()
            await process.wait()

    def _get(self, key: tuple[str, str, PictureRequest]) -> Picture | None:
        kept = self._kept.get(key)
        if kept is not None:
            self._kept.move_to_end(key)
        return kept

    def _keep(self, key: tuple[str, str, PictureRequest], made: Picture) -> None:
        self._kept[key] = made
        self._kept_bytes += len(made.data)
        while self._kept_bytes > KEPT_BYTES:
            _, oldest = self._kept.popitem(last=False)
            self._kept_bytes -= len(oldest.data)

    async def _made(self, asked: dict[str, Any]) -> Picture:
        try:
            async with asyncio.timeout(TIMEOUT_S):
                head, data = await self._ask(asked)
        except (TimeoutError, OSError, EOFError, ValueError) as error:
            await self.close()
            raise _not_now(f"The picture could not be made: {type(error).__name__}.") from None
        except asyncio.CancelledError:
            await self.close()  # its answer would be taken for the next request's
            raise
        if "error" in head:
            raise _not_now(f"The picture could not be made: {head['error']}.")
        return Picture(data, head["media_type"], head["headers"])

    async def _ask(self, asked: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
        process = await self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(asked).encode() + b"\n")
        await process.stdin.drain()
        head = json.loads(await process.stdout.readline() or b"!")
        return head, await process.stdout.readexactly(head["bytes"])

    async def _running(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "primray_service.pictures.process",
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, limit=LINE_BYTES,
                env=_environment(),
            )  # fmt: skip
        return self._process


def _environment() -> dict[str, str]:
    """Return the helper's environment, without keys and database addresses; PYTHONPATH is passed on."""
    kept = ("PATH", "PYTHONPATH", "LANG", "OCIO", "TMPDIR")
    return {name: os.environ[name] for name in kept if name in os.environ}


def _not_now(detail: str) -> Problem:
    return Problem("unavailable", detail, headers={"retry-after": "1"})
