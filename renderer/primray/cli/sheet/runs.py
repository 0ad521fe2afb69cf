"""Render processes with time and memory limits, one for each stage of a folder, with their outcomes and anomalies.

A process limits its own memory first, so that no code runs between fork and exec.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...diagnostic_codes import Severity

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_RENDERED = (0, 5)  # exit codes of renders that wrote a picture; 5: its error is above the target
_LIMIT_S = "time"  # Ended.exit_code of a process that exceeded its time


@dataclass(frozen=True)
class Limits:
    """Limits and settings of each render."""

    width: int  # pixels; also the largest height
    spp: int
    timeout_s: float
    memory_bytes: int
    threads: int | None
    flags: tuple[str, ...] = ()  # further flags of `primray render`
    sized_by_flags: bool = False  # these flags set the width


@dataclass(frozen=True)
class Outcome:
    """Outcome of one stage's render.

    `marks` name anomalies: crash, time, refused, not-finite, black, one-colour, nothing-seen, missing (a part of the picture,
    by a diagnostic of severity error).
    """

    stage: str  # path relative to the folder; in a sheet of one shot the picture's label
    exit_code: int | str  # that of `primray render`; "time": stopped by the time limit; negative: killed by that signal
    seconds: float
    peak_rss_bytes: int
    picture: str | None  # a PNG
    message: str  # stderr of a render that failed
    marks: tuple[str, ...]
    report: dict[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> bool:
        """Whether there is no picture, or an unusable one; other anomalies are left to a person."""
        return bool({"crash", "time", "refused", "not-finite"} & set(self.marks))


def stage_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())


def render_all(
    folder: Path, stages: Sequence[Path], limits: Limits, at_once: int, scratch: Path, done: Callable[[Outcome], None]
) -> list[Outcome]:
    """Render all stages; return outcomes in their order. `done` is called as each ends."""
    with processes(at_once) as pool:
        running = {pool.submit(_render, folder, path, limits, scratch / str(k)): k for k, path in enumerate(stages)}
        outcomes: dict[int, Outcome] = {}
        for future in as_completed(running):
            outcomes[running[future]] = future.result()
            done(future.result())
    return [outcomes[k] for k in sorted(outcomes)]


_pids: set[int] = set()  # processes that run_limited waits for


@contextmanager
def processes(at_once: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads in which to call `run_limited`.

    If the sheet is interrupted, running processes are killed and no more are started.
    """
    with ThreadPoolExecutor(at_once) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for pid in list(_pids):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            raise


_MAIN = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from primray.cli import main
main()
"""


def _render(folder: Path, stage: Path, limits: Limits, scratch: Path) -> Outcome:
    scratch.mkdir(parents=True)
    exr, png, report_file = scratch / "p.exr", scratch / "p.png", scratch / "r.json"
    command = render_command(stage, limits, exr, png, report_file)
    ended = run_limited(command, limits.timeout_s, scratch / "err")
    report = json.loads(report_file.read_text()) if report_file.exists() else {}
    return Outcome(
        stage.relative_to(folder).as_posix(),
        ended.exit_code,
        ended.seconds,
        ended.peak_rss_bytes,
        str(png) if png.exists() else None,
        ended.stderr if ended.exit_code != 0 else "",
        tuple(marks(ended.exit_code, exr, report)),
        report,
    )


def render_command(stage: Path, limits: Limits, exr: Path, png: Path, report: Path) -> list[str]:
    """Return the command line of a process that limits its own memory and renders."""
    command = [sys.executable, "-c", _MAIN.format(limit=limits.memory_bytes), "render", str(stage)]
    command += ["-o", str(exr), "-o", str(png), "--report", str(report)]
    command += [] if limits.sized_by_flags else ["-w", str(limits.width)]
    command += ["--spp", str(limits.spp)]
    return [*command, *(["-j", str(limits.threads)] if limits.threads else []), *limits.flags]


@dataclass(frozen=True)
class Ended:
    """How a process ended."""

    exit_code: int | str
    seconds: float
    peak_rss_bytes: int
    stderr: str


def run_limited(command: list[str], timeout_s: float, stderr: Path) -> Ended:
    """Run a command until it ends or its time limit is reached."""
    start = time.monotonic()
    with stderr.open("wb") as to:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=to)
        _pids.add(process.pid)
        stopped = False
        while True:  # wait4 reports the memory of this child alone
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                _pids.discard(pid)
                break
            if not stopped and time.monotonic() - start > timeout_s:
                process.kill()
                stopped = True
            time.sleep(0.02)
    process.returncode = os.waitstatus_to_exitcode(status)
    peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    text = stderr.read_text(errors="replace").strip()
    return Ended(_LIMIT_S if stopped else process.returncode, time.monotonic() - start, peak, text)


def marks(exit_code: int | str, exr: Path, report: Mapping[str, Any]) -> Iterator[str]:
    """Yield the anomalies of a process and its picture."""
    if exit_code == _LIMIT_S:
        yield "time"
    elif exit_code == 1 or (isinstance(exit_code, int) and exit_code < 0):
        yield "crash"
    elif exit_code not in _RENDERED:
        yield "refused"
    else:
        yield from _picture_marks(exr)
        if any(diagnostic["severity"] == Severity.ERROR.value for diagnostic in report.get("diagnostics", ())):
            yield "missing"


def _picture_marks(exr: Path) -> Iterator[str]:
    """Yield the anomalies of a picture."""
    import numpy as np
    import OpenImageIO as oiio

    pixels = np.asarray(oiio.ImageBuf(str(exr)).get_pixels(oiio.FLOAT))
    if not np.isfinite(pixels).all():
        yield "not-finite"
    if pixels[..., 3].max() <= 0:
        yield "nothing-seen"
    elif pixels[..., :3].max() <= 0:
        yield "black"
    elif np.ptp(pixels.reshape(-1, pixels.shape[2]), axis=0).max() <= 1e-6:
        yield "one-colour"
