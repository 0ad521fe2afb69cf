"""Executor that renders parts of a frame in processes on this machine, and the program of such a process.

The program, `python -m primray.distributed.local_processes`, reads its task as a line of JSON from stdin. It writes the part's
checkpoint, or prints the error as JSON on stdout. Any other end is a crash.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..checkpoints.checkpointing import Checkpointing
from ..diagnostics import Diagnostics
from ..errors import LimitError, PrimrayError, SceneError, SettingsError
from ..render.prepare import open_once, prepare
from ..report.report import Costs, usable_threads
from ..settings import RenderSettings, settings_as_json, settings_of_json
from .executor import PartLost

PROGRAM = "primray.distributed.local_processes"
LAST_CHARACTERS = 500  # of a process's output that an error quotes


class LocalProcesses:
    """Renders up to `processes` parts of a frame at a time, each in its own process, so that a crash affects one part only.

    >>> executor = primray.LocalProcesses(2)
    >>> primray.render("shot.usda", resolution=(32, 18), spp=4, executor=executor).report["samples_per_pixel"]
    [4, 4]

    The cores are shared among them, unless `RenderSettings.threads` says otherwise. Raises SettingsError for less than one.
    """

    def __init__(self, processes: int) -> None:
        if processes < 1:
            raise SettingsError(f"the number of processes must be 1 or more, not {processes}", code="parts-setting")
        self._slots = processes
        self._stage = ""
        self._running: set[Future[None]] = set()

    def begin(self, stage: str) -> None:
        self._stage = stage

    def slots(self) -> int:
        return self._slots

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        threads = settings.threads or max(usable_threads() // self._slots, 1)
        order = {"stage": self._stage, "settings": settings_as_json(replace(settings, threads=threads)), "file": str(file)}
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            [sys.executable, "-m", PROGRAM], stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )
        future: Future[None] = Future()
        self._running.add(future)
        future.add_done_callback(lambda _: self._running.discard(future))
        future.add_done_callback(lambda done: process.kill() if done.cancelled() else None)
        threading.Thread(target=_follow, args=(process, order, future), name="part", daemon=True).start()
        return future

    def end(self) -> None:
        for future in list(self._running):
            future.cancel()


def _follow(process: subprocess.Popen[bytes], order: dict[str, Any], future: Future[None]) -> None:
    said, printed = process.communicate(json.dumps(order).encode() + b"\n")
    with suppress(InvalidStateError):  # it was cancelled
        if process.returncode:
            last = printed.decode("utf-8", "replace").strip()[-LAST_CHARACTERS:]
            future.set_exception(PartLost(f"its process exited with {process.returncode}: {last}"))
        elif said.strip():
            future.set_exception(error_of_json(json.loads(said)))
        else:
            future.set_result(None)


NEVER_S = 1e9  # interval of checkpoints before the end
_BY_EXIT_CODE = {error.exit_code: error for error in (SceneError, SettingsError, LimitError)}


def render_part(stage: str, settings: RenderSettings, file: Path) -> None:
    """Render the part's samples only: pictures and AOVs are made from the whole frame."""
    saving, diagnostics = Checkpointing(file, every_s=NEVER_S), Diagnostics()
    saving.check()
    opened = open_once(stage, settings)
    prepared = prepare(opened.stage, opened.diagnostics, settings, Costs(), diagnostics, fingerprinted=True)
    _, saved = saving.run(prepared, list(diagnostics), lambda fraction, samples, rays: None)
    if why := saved["failed"]:
        raise PrimrayError(why, where=str(file), code="write-failed")


def error_as_json(error: PrimrayError) -> dict[str, Any]:
    return {"code": error.code, "message": error.message, "where": error.where, "exit_code": error.exit_code}


def error_of_json(told: Mapping[str, Any]) -> PrimrayError:
    """Return the error of a part's process as an exception."""
    kind = _BY_EXIT_CODE.get(told["exit_code"], PrimrayError)
    return kind(told["message"], where=told["where"], code=told["code"])


def main() -> None:
    order = json.loads(sys.stdin.readline())
    try:
        render_part(order["stage"], settings_of_json(order["settings"]), Path(order["file"]))
    except PrimrayError as error:
        print(json.dumps(error_as_json(error)))


if __name__ == "__main__":
    main()
