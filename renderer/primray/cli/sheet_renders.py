"""Renders of a contact sheet, in processes with time and memory limits, with their outcomes and anomalies.

A process limits its own memory first, so that no code runs between fork and exec. A folder has one process for each stage. For
one stage, all frames of a camera and a choice of variants are rendered by one process, which keeps the stage open. Frames that
it did not finish are tried again one by one, so that each failure has its own reason and does not affect other frames.
"""

from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from ..diagnostic_codes import Severity
from ..errors import SettingsError, StageOpenError
from ..file_formats import why_locked

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_RENDERED = (0, 5)  # exit codes of renders that wrote a picture; 5: its error is above the target
LIMIT_S = "time"  # Ended.exit_code of a process that exceeded its time


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


def stage_files(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the stages below a folder, and the folders that cannot be read. What is hidden is not looked at, and links to
    folders are not followed."""
    stages: list[Path] = []
    closed: list[Path] = []
    for here, folders, names in os.walk(folder, onerror=lambda error: closed.append(Path(error.filename))):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            path = Path(here, name)
            if path.suffix.lower() in SUFFIXES and not name.startswith(".") and _may_be_stage(path):
                stages.append(path)
    return sorted(stages), sorted(closed)


def _may_be_stage(path: Path) -> bool:
    """Return whether a name is that of a file, or of one whose row says why it cannot be read: a link that leads nowhere, a
    file in a folder that may not be entered."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except OSError:
        return True


def closed_folder(folder: Path, closed: Path) -> Outcome:
    """Return the row of a folder whose stages are unknown, as it cannot be read."""
    error = StageOpenError(
        f"its stages are not on this sheet: {why_locked(str(closed)) or 'it cannot be read'}", where=str(closed)
    )
    name = f"{closed.relative_to(folder).as_posix()}/"
    return Outcome(name, error.exit_code, 0.0, 0, None, f"error: {error}", ("refused",))


Render = Callable[[Path, Path, Limits, Path], Outcome]  # folder, stage, limits, an empty folder


def render_all(
    folder: Path,
    stages: Sequence[Path],
    limits: Limits,
    at_once: int,
    scratch: Path,
    done: Callable[[Outcome], None],
    render: Render | None = None,
) -> list[Outcome]:
    """Render all stages; return outcomes in their order. `done` is called as each ends; `render` is for those that are kept."""
    with processes(at_once) as pool:
        one = render or render_stage
        running = {pool.submit(one, folder, path, limits, scratch / str(k)): k for k, path in enumerate(stages)}
        outcomes: dict[int, Outcome] = {}
        for future in as_completed(running):
            outcomes[running[future]] = future.result()
            done(future.result())
    return [outcomes[k] for k in sorted(outcomes)]


_pids: set[int] = set()  # processes that run_limited waits for
_stops: set[Callable[[], object]] = set()  # what ends renders on other machines


@contextmanager
def stopping(stop: Callable[[], object]) -> Iterator[None]:
    """Have `stop` called if the sheet is interrupted in the block, which waits for another machine."""
    _stops.add(stop)
    try:
        yield
    finally:
        _stops.discard(stop)


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
            for stop in list(_stops):
                stop()
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


def render_stage(folder: Path, stage: Path, limits: Limits, scratch: Path) -> Outcome:
    scratch.mkdir(parents=True, exist_ok=True)
    exr, png, report_file = scratch / "p.exr", scratch / "p.png", scratch / "r.json"
    command = render_command(stage, limits, exr, png, report_file)
    ended = run_limited(command, limits.timeout_s, scratch / "err")
    report = json.loads(report_file.read_text()) if report_file.exists() else {}
    return Outcome(
        stage=stage.relative_to(folder).as_posix(),
        exit_code=ended.exit_code,
        seconds=ended.seconds,
        peak_rss_bytes=ended.peak_rss_bytes,
        picture=str(png) if png.exists() else None,
        message=ended.stderr if ended.exit_code != 0 else "",
        marks=tuple(marks(ended.exit_code, exr, report)),
        report=report,
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
    return Ended(LIMIT_S if stopped else process.returncode, time.monotonic() - start, peak, text)


def marks(exit_code: int | str, exr: Path, report: Mapping[str, Any]) -> Iterator[str]:
    """Yield the anomalies of a process and its picture."""
    if exit_code == LIMIT_S:
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
    """Yield the anomalies of a picture: of its first four channels R, G, B, A, since one sample has no standard errors."""
    import numpy as np
    import OpenImageIO as oiio

    pixels = np.asarray(oiio.ImageBuf(str(exr)).get_pixels(oiio.FLOAT))[..., :4]
    if not np.isfinite(pixels).all():
        yield "not-finite"
    if pixels[..., 3].max() <= 0:
        yield "nothing-seen"
    elif pixels[..., :3].max() <= 0:
        yield "black"
    elif np.ptp(pixels.reshape(-1, 4), axis=0).max() <= 1e-6:
        yield "one-colour"


MOST_CELLS = 2_000
_REJECTED = (2, 3)  # exit codes that are the same for all frames: usage, a scene that cannot be opened


@dataclass(frozen=True)
class Cell:
    """One picture of a sheet."""

    frame: float | None
    camera: str | None
    variants: tuple[str, ...]  # PRIM:SET=NAME
    label: str


@dataclass(frozen=True)
class Grid:
    """The cells of a sheet by rows; each combination of cameras and variants begins its own row."""

    groups: tuple[tuple[Cell, ...], ...]
    columns: int

    @property
    def cells(self) -> list[Cell]:
        return [cell for group in self.groups for cell in group]


def variant_choices(texts: Sequence[str]) -> list[list[str]]:
    """Return the alternatives of each PRIM:SET=NAME,NAME as PRIM:SET=NAME; SettingsError for other text."""
    found = []
    for text in texts:
        where, equals, names = text.rpartition("=")
        chosen = [name.strip() for name in names.split(",") if name.strip()]
        if not equals or ":" not in where or not chosen:
            sentence = f"{text!r} is not a list of variants; expected one such as /World/car:color=red,blue"
            raise SettingsError(sentence, where="--variants", code="variant")
        found.append([f"{where}={name}" for name in chosen])
    return found


def grid_of(
    frames: Sequence[float] | None, cameras: Sequence[str], choices: Sequence[Sequence[str]], columns: int | None
) -> Grid:
    """Lay out every combination: frames along a row, or cameras if there is one frame; variants below each other."""
    times: Sequence[float | None] = [None] if frames is None else frames
    views: Sequence[str | None] = cameras or [None]
    looks = list(product(*choices))
    cells = [
        [Cell(frame, camera, look, _label(frame, camera, look, _same_names(cameras))) for frame in times]
        for look in looks
        for camera in views
    ]
    count = sum(map(len, cells))
    if count > MOST_CELLS:
        raise SettingsError(f"{count} pictures exceed the {MOST_CELLS} of one sheet", code="sheet")
    if len(times) == 1 and len(views) > 1:  # cameras along a row
        flat = [cell for row in cells for cell in row]
        cells = [flat[k : k + len(views)] for k in range(0, len(flat), len(views))]
    if max(map(len, cells)) == 1 or len(cells) == 1:  # one thing varies: about a square of it
        cells = [[cell for row in cells for cell in row]]
        return Grid(tuple(map(tuple, cells)), columns or max(1, round(count**0.5 + 0.49)))
    return Grid(tuple(map(tuple, cells)), columns or max(map(len, cells)))


def _same_names(cameras: Sequence[str]) -> bool:
    return len({_last(camera) for camera in cameras}) < len(cameras)


def _last(path: str) -> str:
    return path.rpartition("/")[2]


def _label(frame: float | None, camera: str | None, look: Sequence[str], whole_paths: bool) -> str:
    words = [] if frame is None else [f"frame {frame:g}"]
    words += [] if camera is None else [camera if whole_paths else _last(camera)]
    words += [choice.rpartition(":")[2] for choice in look]
    return ", ".join(words) or "default time"


def render_cells(
    stage: Path, grid: Grid, limits: Limits, at_once: int, scratch: Path, done: Callable[[Outcome], None]
) -> list[Outcome]:
    """Render all cells; return outcomes in their order. `done` is called as each is known."""
    runs = list(_runs(grid.cells, at_once))
    outcomes: dict[Cell, Outcome] = {}
    with processes(at_once) as pool:
        running = [pool.submit(_render_run, stage, run, limits, scratch / str(k)) for k, run in enumerate(runs)]
        for future in as_completed(running):
            for cell, outcome in future.result().items():
                outcomes[cell] = outcome
                done(outcome)
    return [outcomes[cell] for cell in grid.cells]


def _runs(cells: Sequence[Cell], at_once: int) -> Iterator[list[Cell]]:
    """Yield the cells of each process: cells that differ only in their frame, split further if processes would be idle."""
    by_view: dict[tuple[str | None, tuple[str, ...]], list[Cell]] = {}
    for cell in cells:
        by_view.setdefault((cell.camera, cell.variants), []).append(cell)
    parts = -(-at_once // len(by_view))
    for frames in by_view.values():
        size = -(-len(frames) // parts)
        yield from (frames[k : k + size] for k in range(0, len(frames), size))


def _render_run(stage: Path, cells: list[Cell], limits: Limits, scratch: Path) -> dict[Cell, Outcome]:
    ended = _process(stage, cells, limits, scratch)
    came = any(_file(scratch, cell, "png").exists() for cell in cells)
    alike = len(cells) == 1 or (not came and ended.exit_code in _REJECTED)
    found = {}
    for k, cell in enumerate(cells):
        folder, own = scratch, ended
        if not alike and not _file(folder, cell, "png").exists():
            folder = scratch / f"again-{k}"
            own = _process(stage, [cell], limits, folder)
        found[cell] = _outcome(cell, own, folder, len(cells) if folder == scratch else 1)
    return found


def _file(scratch: Path, cell: Cell, kind: str) -> Path:
    return scratch / (f"p.{kind}" if cell.frame is None else f"p.{cell.frame:.15g}.{kind}")


def _process(stage: Path, cells: list[Cell], limits: Limits, scratch: Path) -> Ended:
    scratch.mkdir(parents=True)
    cell, place = cells[0], "" if cells[0].frame is None else ".%g"
    command = render_command(stage, limits, *(scratch / f"p{place}.{kind}" for kind in ("exr", "png", "json")))
    if cell.frame is not None:
        command += ["--frames", ",".join(f"{each.frame:.15g}" for each in cells)]
    command += [] if cell.camera is None else ["--camera", cell.camera]
    command += [word for variant in cell.variants for word in ("--variant", variant)]
    return run_limited(command, limits.timeout_s * len(cells), scratch / "err")


def _outcome(cell: Cell, ended: Ended, scratch: Path, shared_by: int) -> Outcome:
    """Return the outcome of a cell. A cell with a picture succeeded, whatever happened to others of its process."""
    exr, png, report_file = (_file(scratch, cell, kind) for kind in ("exr", "png", "json"))
    report: dict[str, Any] = json.loads(report_file.read_text()) if report_file.exists() else {}
    exit_code = 0 if png.exists() and exr.exists() else ended.exit_code or 1
    return Outcome(
        stage=cell.label,
        exit_code=exit_code,
        seconds=ended.seconds / shared_by,
        peak_rss_bytes=ended.peak_rss_bytes,
        picture=str(png) if exit_code == 0 else None,
        message="" if exit_code == 0 else ended.stderr,
        marks=tuple(marks(exit_code, exr, report)),
        report=report,
    )
