"""Entry into the sandbox, a worker's first action: before it imports USD or numpy and before it has a job.

Landlock binds the calling thread and threads started later, so no library may have started threads yet. A layer that was
announced and cannot be applied ends the worker: nothing runs with fewer layers than the server believes.
"""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import landlock, privileges, seccomp
from .limits import set_limits
from .spawn import PLAN


class SandboxError(Exception):
    """A layer could not be applied."""


@dataclass(frozen=True)
class Entered:
    job: Path  # read-only
    out: Path  # writable
    layers: frozenset[str]
    took_ms: dict[str, float] = field(default_factory=dict)  # by layer


def enter(keep_files: tuple[int, ...] = ()) -> Entered:
    """Enter the sandbox, for good. Afterwards the current folder, HOME and TMPDIR are in the output folder; all files but
    standard input, output, error and `keep_files` are closed."""
    plan = _plan()
    entered = Entered(Path(plan["job"]), Path(plan["out"]), frozenset(plan["layers"]))
    try:
        _require_one_thread()
        os.umask(0o077)
        os.makedirs(entered.out / "tmp", exist_ok=True)
        os.chdir(entered.out)
        privileges.die_with_parent(plan["parent"])
        privileges.close_other_files(keep_files)
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


def _limits(plan: dict[str, Any]) -> None:
    set_limits(plan["limits"])
    privileges.drop_capabilities()
    privileges.no_new_privileges()


def _landlock(plan: dict[str, Any]) -> None:
    privileges.no_new_privileges()
    landlock.restrict(plan["readable"], [plan["out"]], plan["devices"])


def _seccomp(plan: dict[str, Any]) -> None:
    privileges.no_new_privileges()
    seccomp.install()
