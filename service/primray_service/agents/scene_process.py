"""The process of one scene: enters its sandbox, opens the stage at the first request, and answers until its stdin ends.

Requests and answers are lines of JSON. Files are looked at before each request: those that have changed are read again. The end
of stdin ends the process at once, whatever it is doing: no signal says that the server died where it died before bubblewrap had
asked for one.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from primray.live.file_watch import Stamp, stamp_of

from ..sandbox import enter
from ..worker.channel import SERVER_GONE, claim_stdout

if TYPE_CHECKING:
    from .looks import Eye


class Scenes:
    """The kept scene of this process, as composed last."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._eye: Eye | None = None
        self._composed: tuple[object, ...] = ()
        self._files: dict[str, Stamp] = {}

    def answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        does, path = request["do"], request["path"]
        if does == "look":
            return self._opened(path, request).look(request)
        if does == "compare":
            other = request["before"]
            now = self._opened(path, request)
            return now.changed(request, None if other is None else _opened(other, request))
        if does == "render":
            return self._opened(path, request).picture(request, self._out / request["file"])
        return {"answer": self._examined(does, path, request), "pictures": []}

    def _examined(self, does: str, path: str, request: Mapping[str, Any]) -> dict[str, Any]:
        import primray

        from .looks import bounded

        stage = self._opened(path, request).kept.opened.stage
        asked: dict[str, Any] = {"time_code": request["time_code"], "camera": request["camera"]}
        found: dict[str, Any]
        if does == "inspect":
            found = primray.inspect(stage, **asked)
        elif does == "doctor":
            seconds, side = request["seconds"], (request["size"], 0)
            found = primray.doctor(stage, pilot_seconds=seconds, resolution=side, **asked).as_json()
        else:
            targets = request["target_errors"]
            side = (request["size"], 0)
            found = primray.estimate(stage, targets, pilot_seconds=request["seconds"], resolution=side, **asked).as_json()
        return bounded({**found, "scene": path})  # type: ignore[no-any-return]

    def _opened(self, path: str, request: Mapping[str, Any]) -> Eye:
        """Return the stage as its files are now."""
        from primray import usd

        composed = (path, tuple(request["variants"]))
        changed = {file for file, stamp in self._files.items() if stamp_of(file) != stamp}
        if self._eye is None or composed != self._composed or changed:
            if changed:
                usd.reload_layers(path, changed)
            looks = {} if self._eye is None or path != self._composed[0] else self._eye.seen
            self._files = {path: None}  # a stage that cannot be opened now is read again at the next request
            self._eye = None
            begun = time.time_ns()
            eye = _opened(path, request)
            eye.seen.update(looks)
            self._eye, self._composed = eye, composed
            self._files = {file: _read_stamp(file, begun) for file in usd.files_to_watch(path)}
        return self._eye


def _opened(path: str, request: Mapping[str, Any]) -> Eye:
    from primray.incremental.scene import KeptStage
    from primray.settings import RenderSettings

    from .looks import Eye

    return Eye(KeptStage(path, RenderSettings(variants=tuple(request["variants"]))))


def _read_stamp(file: str, begun_ns: int) -> Stamp:
    """Return the stamp of a file that has been read since `begun_ns`; None where it was written meanwhile, so that it counts as
    changed. A time of modification in the future says nothing."""
    stamp = stamp_of(file)
    return None if stamp is not None and begun_ns < stamp[0] <= time.time_ns() else stamp


def failure(error: BaseException) -> dict[str, Any]:
    """Return an error's code, message and place."""
    from primray.errors import PrimrayError

    if isinstance(error, PrimrayError):
        return {"code": error.code, "message": error.message, "where": error.where}
    if isinstance(error, MemoryError):
        return {"code": "memory", "message": "the scene needs more memory than it may have", "where": ""}
    traceback.print_exception(error)
    return {"code": "internal", "message": f"this is a defect in primray: {type(error).__name__}", "where": ""}


def _read(requests: SimpleQueue[bytes]) -> None:
    for line in sys.stdin.buffer:
        requests.put(line)
    os._exit(SERVER_GONE)


def main() -> None:
    messages = claim_stdout()
    entered = enter((messages.fileno(),))
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_read, args=(requests,), name="requests", daemon=True).start()
    from . import looks  # noqa: F401 - what takes long, before the first request

    scenes = Scenes(entered.out)
    messages.write(b'{"ready": true}\n')
    while True:
        try:
            found = scenes.answer(json.loads(requests.get()))
        except Exception as error:
            found = {"error": failure(error)}
        text = memoryview(json.dumps(found, allow_nan=False).encode() + b"\n")
        while text:
            text = text[messages.write(text) or 0 :]


if __name__ == "__main__":
    main()
