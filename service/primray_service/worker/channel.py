"""A worker's end of the protocol: messages out, commands in. Its server's death (the end of stdin) ends it at once.

All text that leaves a worker passes through ClientText, so that a library's own message, or a path outside the upload, reveals
nothing of this machine.
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from .protocol import LAST, MAX_LINE_BYTES, WORK

SERVER_GONE = 4  # exit code
PREVIEWS_FOR_S = 10.0  # after a client asked for one


def claim_stdout() -> BinaryIO:
    """Return the pipe for messages; output of libraries to stdout then goes to stderr, which is the log."""
    messages = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    return messages


class Channel:
    """Channel to the server. Messages may be sent by any thread; a thread of its own reads commands."""

    def __init__(self, commands: BinaryIO, messages: BinaryIO, text: ClientText) -> None:
        self._commands = commands
        self._messages = messages
        self.text = text
        self._lock = threading.Lock()
        self._work: Mapping[str, Any] | None = None  # current or next chunk
        self._came = threading.Event()
        self._previews_until = 0.0
        self._number: int | None = None
        self.stop = False
        self.give_way = False

    def start(self) -> None:
        threading.Thread(target=self._read, name="commands", daemon=True).start()

    def send(self, at: str, **members: Any) -> None:
        line = json.dumps(finite(self.text.in_json({"at": at, **members})), ensure_ascii=True, allow_nan=False).encode() + b"\n"
        if len(line) > MAX_LINE_BYTES:
            raise ValueError(f"a message {at!r} of {len(line)} bytes")
        with self._lock:
            try:
                self._write(line)
            except OSError:
                os._exit(SERVER_GONE)

    def _write(self, line: bytes) -> None:
        view = memoryview(line)
        while view:
            view = view[self._messages.write(view) or 0 :]

    def leave(self, at: str, **members: Any) -> None:
        """Send the last message and end the process, without waiting for exit handlers of libraries."""
        assert at in LAST
        self.send(at, **members)
        os._exit(0)

    def work(self) -> Mapping[str, Any]:
        """Wait for the command with the next chunk, and return it."""
        self._came.wait()
        self._came.clear()
        assert self._work is not None
        return self._work

    def done(self, *, stay: bool, **members: Any) -> None:
        """Send the last message of a chunk, and end the process unless it is to stay."""
        if not stay:
            self.leave("done", **members)
        self._work = None  # later commands come too late, until there is another chunk
        self.send("done", **members)

    def ask_preview(self) -> None:
        self._previews_until = time.monotonic() + PREVIEWS_FOR_S

    def wants_preview(self) -> bool:
        return time.monotonic() < self._previews_until

    def nothing_to_save(self, number: int | None) -> None:
        """Answer stop and yield at once from now on, since there is no more than checkpoint `number` to save; None: the
        sampling handles them."""
        self._number = number
        self._leave_if_ordered()

    def _leave_if_ordered(self) -> None:
        number = self._number
        if number is not None and self.give_way:
            self.leave("yielded", number=number)
        if number == 0 and self.stop:  # if there is a checkpoint, the picture is made from it
            self.leave("done", outputs=[], report={"interrupted": True, "samples": 0})

    def _read(self) -> None:
        while True:
            line = self._commands.readline(MAX_LINE_BYTES + 1)
            if not line.endswith(b"\n"):
                os._exit(SERVER_GONE)
            self._heed(json.loads(line))

    def _heed(self, command: Mapping[str, Any]) -> None:
        does = command["do"]
        if does in WORK:
            self._begin(command)
        elif self._work is None:
            return
        elif does == "preview":
            self.ask_preview()
        elif does == "stop":
            self.stop = True
        elif does == "yield":
            self.give_way = True
        self._leave_if_ordered()

    def _begin(self, command: Mapping[str, Any]) -> None:
        self._previews_until, self._number = 0.0, None
        self.stop = self.give_way = False
        self._work = command
        self._came.set()


def finite(value: Any) -> Any:
    """Return the value with NaN and infinities, which strict JSON does not have, as null."""
    if isinstance(value, Mapping):
        return {str(name): finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# An absolute path between the marks that USD puts around assets: it leads outside the upload.
_OUTSIDE = re.compile(r"@/(?:[^@/]*/)*([^@/]*)@")
# USD's explanation about a file, whether it exists or not: it may quote the file's contents.
_WHY = re.compile(r" -- .*?(?=; skipping\.|\.?$)", re.DOTALL)
_PRIM = re.compile(r"(?:/[A-Za-z_]\w*)+")  # nothing but a prim's path, or a folder that could be one
_ANONYMOUS = re.compile(r"anon:0x[0-9a-fA-F]+:?")


class ClientText:
    """Texts of one worker, by its folders as it sees them."""

    def __init__(self, job: Path, out: Path, shared: Path | None = None) -> None:
        folders = [
            *([] if shared is None else [shared]),
            job / "package",
            job,
            out / "tmp",
            out,
            *map(Path, sys.path),
            Path(sys.prefix),
            Path(sys.base_prefix),
        ]
        prefixes = {f"{place}/" for folder in folders for place in (folder, folder.resolve()) if str(folder) not in (".", "/")}
        known = "|".join(re.escape(prefix) for prefix in sorted(prefixes, key=len, reverse=True))
        self._known = re.compile(rf"(?<![\w/.\-])(?:{known})")

    def in_text(self, text: str) -> str:
        if "/" in text and not _PRIM.fullmatch(text):
            text = self._known.sub("", text)
            if _OUTSIDE.search(text):
                text = _WHY.sub("", _OUTSIDE.sub(r"@.../\1@", text))
        return _ANONYMOUS.sub("", text) if "anon:0x" in text else text

    def in_json(self, value: Any) -> Any:
        """Return the value with all of its texts converted; prim paths stay as they are."""
        if isinstance(value, str):
            return self.in_text(value)
        if isinstance(value, Mapping):
            return {name: item if name in _PRIMS else self.in_json(item) for name, item in value.items()}
        if isinstance(value, list | tuple):
            return [self.in_json(item) for item in value]
        return value


_PRIMS = frozenset(("prim", "prim_path"))
