"""Entry into the sandbox, a worker's first action: before it imports USD or numpy and before it has a job.

Capabilities, new privileges, inherited files and a life beyond the parent are given up as well. Landlock binds the calling
thread and threads started later, so no library may have started threads yet. A layer that was announced and cannot be applied
ends the worker: nothing runs with fewer layers than the server believes.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import struct
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import landlock, seccomp
from .limits import set_limits
from .spawn import PLAN
from .system_calls import (
    PR_CAP_AMBIENT,
    PR_CAP_AMBIENT_CLEAR_ALL,
    PR_CAPBSET_DROP,
    PR_SET_NO_NEW_PRIVS,
    PR_SET_PDEATHSIG,
    call,
    prctl,
)


class SandboxError(Exception):
    """A layer could not be applied."""


@dataclass(frozen=True)
class Entered:
    job: Path  # read-only
    out: Path  # writable
    layers: frozenset[str]
    took_ms: dict[str, float] = field(default_factory=dict)  # by layer


def enter(keep_files: tuple[int, ...] = (), plan: Mapping[str, Any] | None = None) -> Entered:
    """Enter the sandbox, for good. Afterwards the current folder, HOME and TMPDIR are in the output folder; all files but
    standard input, output, error and `keep_files` are closed. `plan`: a forked worker's; None: that of the environment."""
    if plan is None:
        plan = _plan()
    entered = Entered(Path(plan["job"]), Path(plan["out"]), frozenset(plan["layers"]))
    try:
        _require_one_thread()
        os.umask(0o077)
        os.makedirs(entered.out / "tmp", exist_ok=True)
        os.chdir(entered.out)
        die_with_parent(plan["parent"])
        close_other_files(keep_files)
        for layer, raise_wall in (("rlimits", _limits), ("landlock", _landlock), ("seccomp", _seccomp)):
            if layer in entered.layers:
                began = time.perf_counter()
                raise_wall(plan)
                entered.took_ms[layer] = (time.perf_counter() - began) * 1000
    except OSError as error:
        raise SandboxError(f"the sandbox cannot be entered: {error}") from error
    return entered


def _plan() -> dict[str, Any]:
    text = os.environ.pop(PLAN, None)
    if text is None:
        raise SandboxError(f"{PLAN} is not set: workers must be started by the service, through worker_spawn")
    plan: dict[str, Any] = json.loads(text)
    return plan


def _require_one_thread() -> None:
    try:
        threads = len(os.listdir("/proc/self/task"))
    except OSError:  # no /proc: threads known to Python are those it started itself
        return
    if threads != 1:
        raise SandboxError(f"{threads} threads run already: the sandbox must be entered before anything starts one")


def _limits(plan: Mapping[str, Any]) -> None:
    set_limits(plan["limits"])
    drop_capabilities()
    no_new_privileges()


def _landlock(plan: Mapping[str, Any]) -> None:
    no_new_privileges()
    landlock.restrict(plan["readable"], [plan["out"]], plan["devices"])


def _seccomp(plan: Mapping[str, Any]) -> None:
    no_new_privileges()
    seccomp.install()


_CAPABILITY_VERSION_3 = 0x20080522
_MOST_CAPABILITIES = 64


def die_with_parent(parent: int | None) -> None:
    """Request SIGKILL when the thread that started this process ends; it is sent at once if `parent` is not the parent any
    more."""
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if parent is not None and os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def close_other_files(keep: tuple[int, ...] = ()) -> None:
    """Close all files but standard input, output and error and these."""
    first = 3
    for handle in sorted({h for h in keep if h >= 3}):
        _close_range(first, handle - 1)
        first = handle + 1
    _close_range(first, 2**31 - 1)


def _close_range(first: int, last: int) -> None:
    if first > last:
        return
    try:
        call("close_range", first, last, 0)
    except OSError:  # Linux before 5.9
        os.closerange(first, min(last, os.sysconf("SC_OPEN_MAX")) + 1)


def drop_capabilities() -> None:
    """Drop the capabilities of all sets, so that root is a user like others (and rlimits bind it)."""
    for capability in range(_MOST_CAPABILITIES):
        with suppress(OSError):  # unknown to this kernel, or not ours to drop
            prctl(PR_CAPBSET_DROP, capability)
    with suppress(OSError):
        prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL)
    header = ctypes.create_string_buffer(struct.pack("=Ii", _CAPABILITY_VERSION_3, 0), 8)
    call("capset", header, ctypes.create_string_buffer(24))


def no_new_privileges() -> None:
    prctl(PR_SET_NO_NEW_PRIVS, 1)
