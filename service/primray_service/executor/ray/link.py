"""The Ray driver seen from the server: a separate process, its lines, and its end, which the server outlives."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib.util import find_spec
from typing import Any

from ...jobs import Json
from . import protocol

DRIVER = "primray_service.executor.ray.driver"
CONNECT_WITHIN_S = 90.0
END_WITHIN_S = 3.0
LAST_LINES = 20  # of its stderr that are kept
# Ray prints this when the head refuses a token; it retries for 20 s, and then reports only that it could not connect.
REFUSED = b"InvalidAuthToken"

OnLine = Callable[[Mapping[str, Any]], None]


class NotConnected(Exception):
    """No connection to a cluster; `code` is one of protocol.py."""

    def __init__(self, code: str, why: str) -> None:
        super().__init__(why)
        self.code = code
        self.why = why


class Link:
    """One driver process, from its start to its end. `on_line` gets its lines once it is connected."""

    def __init__(self, process: asyncio.subprocess.Process, on_line: OnLine) -> None:
        self._process = process
        self._on_line = on_line
        self._connected: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._said: deque[str] = deque(maxlen=LAST_LINES)
        self._reading = [asyncio.ensure_future(self._read_lines()), asyncio.ensure_future(self._read_log())]

    @classmethod
    async def connect(cls, settings: Json, on_line: OnLine) -> Link:
        """Start a driver and connect it; raises NotConnected if there is no usable Ray."""
        if find_spec("ray") is None:
            raise NotConnected(protocol.NOT_INSTALLED, "ray is not installed: pip install 'primray[ray]'")
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", DRIVER),
            env=environment(os.environ),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            limit=protocol.MAX_LINE_BYTES,
            start_new_session=True,  # Ctrl-C is for the server
        )
        link = cls(process, on_line)
        link.send({"do": "connect", **settings})
        try:
            await asyncio.wait_for(asyncio.shield(link._connected), CONNECT_WITHIN_S)
        except TimeoutError:
            await link.close()
            why = f"the Ray cluster at {settings['address']} has not answered within {CONNECT_WITHIN_S:g} s"
            raise NotConnected(protocol.UNREACHABLE, why) from None
        except BaseException:
            await link.close()
            raise
        return link

    def send(self, line: Json) -> None:
        """Send a line; has no effect if the process is gone."""
        assert self._process.stdin is not None
        if not self._process.stdin.is_closing():
            with suppress(OSError):
                self._process.stdin.write(json.dumps(line).encode() + b"\n")

    async def ended(self) -> str:
        """Wait for its end, and return the last line that it printed."""
        await asyncio.wait(self._reading)
        await self._process.wait()
        return " ".join(line for line in list(self._said)[-3:])

    async def close(self) -> None:
        """Close its input, which ends it; kill it if it does not end."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            await asyncio.wait_for(self._process.wait(), END_WITHIN_S)
        except TimeoutError:
            with suppress(ProcessLookupError):
                self._process.kill()
        await self.ended()

    async def _read_lines(self) -> None:
        assert self._process.stdout is not None
        while True:
            try:
                line = await self._process.stdout.readline()
            except ValueError:  # longer than any of our lines
                self._process.kill()
                return
            if not line.endswith(b"\n"):
                break
            self._take(json.loads(line))
        if not self._connected.done():
            why = f"the Ray driver ended: {self._said[-1] if self._said else 'it printed nothing'}"
            self._refuse(protocol.UNREACHABLE, why)

    def _take(self, line: Mapping[str, Any]) -> None:
        if line["at"] == "failed":
            self._refuse(str(line["code"]), str(line["why"]))
            return
        self._on_line(line)
        if line["at"] == "cluster" and not self._connected.done():
            self._connected.set_result(None)

    async def _read_log(self) -> None:
        assert self._process.stderr is not None
        while line := await self._process.stderr.readline():
            self._said.append(line.decode("utf-8", "replace").strip()[:500])
            if REFUSED in line and not self._connected.done():
                self._refuse(protocol.WRONG_TOKEN, "the Ray cluster refuses the token (RAY_AUTH_TOKEN, ~/.ray/auth_token)")

    def _refuse(self, code: str, why: str) -> None:
        if not self._connected.done():
            self._connected.set_exception(NotConnected(code, why))


def environment(ours: Mapping[str, str]) -> dict[str, str]:
    """Return the driver's environment: token authentication is on unless it was switched off on purpose, and usage statistics
    are off."""
    return {"RAY_AUTH_MODE": "token", "RAY_USAGE_STATS_ENABLED": "0", **ours}
