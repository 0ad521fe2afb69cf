"""Start of a worker: its argument list and its environment, with every layer of the sandbox that works on this machine.

    spawn = worker_spawn(slot, Budget(memory_bytes=..., threads=...))
    subprocess.Popen(spawn.argv, env=spawn.env, cwd=spawn.cwd, start_new_session=True, stdin=PIPE, stdout=PIPE, stderr=PIPE)

slot/job and slot/out exist and are the worker's alone; files may be put into slot/job (by hard links) at any time later. The
program calls `enter()` first of all (entry.py). Whether a layer works is tested once.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from . import bubblewrap, landlock, seccomp
from .bubblewrap import DEVICES, JOB, OUT, machine_paths, readable_paths
from .limits import Budget, limits_of

LAYERS = ("rlimits", "landlock", "seccomp", "bubblewrap")


@cache
def layers() -> dict[str, str]:
    """Return each layer's name with "on" or "off: why"."""
    return {
        "rlimits": "on",
        "landlock": _landlock(),
        "seccomp": _seccomp(),
        "bubblewrap": "on" if (why := bubblewrap.missing()) is None else f"off: {why}",
    }


def usable_layers() -> frozenset[str]:
    return frozenset(name for name, state in layers().items() if state.startswith("on"))


def works(usable: frozenset[str] | None = None) -> bool:
    """Return whether untrusted uploads may be opened: file access is restricted, and system calls are filtered."""
    on = usable_layers() if usable is None else usable
    return "seccomp" in on and bool(on & {"landlock", "bubblewrap"})


def _landlock() -> str:
    try:
        return f"on (ABI {landlock.abi()})"
    except OSError as error:
        return f"off: {error.strerror or error}"


def _seccomp() -> str:
    try:
        seccomp.available()
    except OSError as error:
        return f"off: {error.strerror or error}"
    return "on"


Json = dict[str, Any]
WORKER = ("-m", "primray_service.worker")
INHERITED = ("PRIMRAY_ISA",)
PLAN = "PRIMRAY_SANDBOX"  # environment variable with the plan for `enter`


@dataclass(frozen=True, kw_only=True)
class Spawn:
    argv: list[str]
    env: dict[str, str]
    cwd: str
    job: str  # the two folders as the worker sees them
    out: str
    wrapped: bool  # whether the child is bubblewrap, and the worker its grandchild


def worker_spawn(
    slot: Path,
    budget: Budget,
    program: Sequence[str] = WORKER,
    layers: frozenset[str] | None = None,
    roots: Sequence[str] = (),
) -> Spawn:
    """Return how to start a worker. `layers`: fewer than are available, for tests of single ones. `roots`: folders that it can
    read at their own paths. Start it in the thread that lives longest: the worker dies with that thread."""
    on = usable_layers() if layers is None else layers
    wrapped = "bubblewrap" in on
    slot = slot.resolve()
    job, out = (JOB, OUT) if wrapped else (str(slot / "job"), str(slot / "out"))
    colors = configuration()
    luts = () if colors is None else readable_files(colors, slot)
    plan = _plan(on, budget, job, out, (*luts, *roots)) | {"parent": None if wrapped else os.getpid()}
    env = {**_environment(out, colors), **_usd_threads(budget.threads), PLAN: json.dumps(plan)}
    # Isolated mode: no PYTHON* variables, no user site-packages, not the current folder. No .pyc files are written.
    command = [sys.executable, "-I", "-B", *program]
    argv = bubblewrap.wrap(slot, env, command, (*luts, *roots)) if wrapped else command
    # bubblewrap's own environment is empty, so that nothing can be read from /proc.
    return Spawn(argv=argv, env={} if wrapped else env, cwd="/", job=job, out=out, wrapped=wrapped)


def fork_server_spawn(slot: Path, handle: int) -> Spawn:
    """Return how to start the process that workers are forked from (worker/fork_server.py), which reads requests from the
    socket `handle`. Its environment is that of workers in so far as it is the same for all of them. `slot`: for a file that it
    opens and removes again."""
    argv = [sys.executable, "-I", "-B", "-m", "primray_service.worker.fork_server", str(handle)]
    return Spawn(argv=argv, env=_environment(OUT, configuration()), cwd=str(slot), job="", out="", wrapped=False)


def worker_fork(
    slot: Path,
    budget: Budget,
    layers: frozenset[str] | None = None,
    roots: Sequence[str] = (),
) -> Json:
    """Return what the fork server must know to start a worker with the sandbox of `worker_spawn`."""
    on = usable_layers() if layers is None else layers
    wrapped = "bubblewrap" in on
    slot = slot.resolve()
    job, out = (JOB, OUT) if wrapped else (str(slot / "job"), str(slot / "out"))
    colors = configuration()
    beside = (*(() if colors is None else readable_files(colors, slot)), *roots)
    return {
        "plan": _plan(on, budget, job, out, beside),
        "environment": _environment(out, colors),
        "threads": budget.threads,
        "bubblewrap": bubblewrap.park(slot, beside) if wrapped else None,
    }


def _plan(on: frozenset[str], budget: Budget, job: str, out: str, beside: Sequence[str]) -> Json:
    return {
        "job": job,
        "out": out,
        "layers": sorted(on),
        "limits": limits_of(budget),
        "readable": [*readable_paths(), *machine_paths(), *beside, job],
        "devices": list(DEVICES),
    }


def _environment(out: str, colors: str | None) -> dict[str, str]:
    """Return the worker's environment: beside the OpenColorIO configuration only the core's ISA class is inherited, and no
    plug-in path, search path or token."""
    chosen = {name: os.environ[name] for name in INHERITED if name in os.environ}
    return chosen | {
        "HOME": f"{out}/tmp",
        "TMPDIR": f"{out}/tmp",
        "LANG": "C.UTF-8",
        "LC_ALL": "C.UTF-8",
        "OPENBLAS_NUM_THREADS": "1",  # numpy's; each thread reserves memory and none has work
        **({} if colors is None else {OCIO: colors}),
    }


def _usd_threads(threads: int) -> dict[str, str]:
    """Return the variables that limit USD's threads in a process that is not forked."""
    # The second one keeps USD from printing a warning about the first.
    return {"PXR_WORK_THREAD_LIMIT": str(threads), "TF_ENV_SETTING_ALERTS_ENABLED": "0"}


def decode_exit(returncode: int, wrapped: bool) -> tuple[int | None, int | None]:
    """Return exit code and signal of the worker, one of them None. bubblewrap reports a signal as 128 plus its number, as
    shells do."""
    if returncode < 0:
        return None, -returncode
    if wrapped and returncode > 128:
        return None, returncode - 128
    return returncode, None


def worker_pid(child: int) -> int | None:
    """Return the pid of a spawned child's worker: the child, or inside bubblewrap the last of its chain; None before it
    exists."""
    pid = child
    for _ in range(3):
        below = _children(pid)
        if not below:
            return pid
        pid = below[0]
    return pid


def _children(pid: int) -> list[int]:
    try:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text("ascii").split()]
    except (OSError, ValueError):
        return []


OCIO = "OCIO"
BUILTIN = "ocio://"
_LUTS = """3dl cc ccc cdl clf csp ctf cub cube hdl icc icm itx look lut m3d mga spi1d spi3d spimtx vf"""
LUTS = frozenset(f".{name}" for name in _LUTS.split())
MOST_FILES = 4000


def configuration() -> str | None:
    """Return the absolute path or name of the configuration in $OCIO; None if it names nothing that exists."""
    said = os.environ.get(OCIO, "")
    if said.startswith(BUILTIN):
        return said
    path = os.path.abspath(said) if said else ""
    return path if os.path.isfile(path) else None


def readable_files(source: str, slot: Path) -> tuple[str, ...]:
    """Return files and folders for workers; never one that contains a worker's own."""
    found = () if source.startswith(BUILTIN) else _files_of(source)
    return tuple(path for path in found if not slot.is_relative_to(path))


@cache
def _files_of(source: str) -> tuple[str, ...]:
    config = Path(source)
    folders = [Path(config.parent, path) for path in _search_paths(source)]
    others = [
        folder.resolve()
        for folder in folders
        if folder.is_dir() and not config.parent.resolve().is_relative_to(folder.resolve())
    ]
    beside = [path for path in sorted(config.parent.iterdir()) if path.is_file() and path.suffix.lower() in LUTS]
    linked = {str(path.resolve()) for path in (config, *beside)}
    return tuple(dict.fromkeys([source, *map(str, beside[:MOST_FILES]), *sorted(linked), *map(str, others)]))


def _search_paths(source: str) -> list[str]:
    """Return the configuration's search paths; none if it cannot be read, which the worker reports."""
    import PyOpenColorIO as ocio

    try:
        config = ocio.Config.CreateFromFile(source)
        context = config.getCurrentContext()
        return [context.resolveStringVar(path) for path in config.getSearchPaths()]
    except (ocio.Exception, ocio.ExceptionMissingFile, RuntimeError, ValueError):
        return []
