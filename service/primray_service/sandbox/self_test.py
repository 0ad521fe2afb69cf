"""Self-test of the sandbox: a real worker process tries to break out (attempts.py), towards targets that really exist."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..files import make_held
from .limits import Budget
from .spawn import layers, worker_spawn, works

_PROGRAM = "primray_service.sandbox.attempts"
_TIMEOUT_S = 20.0
LAST = "execute a program"  # the attempt that ends its process if it is allowed


@dataclass(frozen=True)
class SelfTest:
    """Result. `attempts`: by name, "refused: why" or "allowed"; `ok`: all were refused."""

    ok: bool
    layers: dict[str, str]
    attempts: dict[str, str] = field(default_factory=dict)
    problem: str | None = None

    def as_json(self) -> dict[str, Any]:
        return {"ok": self.ok, "layers": self.layers, "attempts": self.attempts, "problem": self.problem}


def self_test(folder: Path, only: frozenset[str] | None = None) -> SelfTest:
    """Run the self-test; blocks for some 0.2 s. `folder`: below the data directory, where slots are; `only`: fewer layers than
    are available."""
    with slot_and_targets(folder) as (slot, targets):
        attempts, problem = _run(slot, targets, only)
    allowed = sorted(name for name, result in attempts.items() if result == "allowed")
    if problem is None and LAST not in attempts:
        problem = "it ended before all attempts were made"
    if problem is None and allowed:
        problem = f"a worker can {', '.join(allowed)}"
    if problem is None and not works(only):
        problem = "neither Landlock nor bubblewrap with seccomp works here"
    return SelfTest(problem is None, layers(), attempts, problem)


@contextmanager
def slot_and_targets(folder: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Provide a worker's folder, and targets that could be reached without a sandbox."""
    with _slot(folder) as slot, _targets(slot) as targets:
        yield slot, targets


@contextmanager
def _slot(folder: Path) -> Iterator[Path]:
    """Provide a folder with a lock beside it, as slots have: otherwise another server that starts would remove it."""
    lock, handle = make_held(lambda: _make_lock(folder))
    slot = folder / f"{lock.stem}-1"
    try:
        slot.mkdir(mode=0o700)
        yield slot
    finally:
        shutil.rmtree(slot, ignore_errors=True)
        lock.unlink(missing_ok=True)
        os.close(handle)


def _make_lock(folder: Path) -> tuple[Path, int]:
    path = folder / f"selftest{secrets.token_hex(8)}.lock"
    return path, os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def _run(slot: Path, targets: dict[str, Any], only: frozenset[str] | None) -> tuple[dict[str, str], str | None]:
    spawn = worker_spawn(slot, Budget(2**30), ("-m", _PROGRAM, json.dumps(targets)), only)
    try:
        ended = subprocess.run(
            spawn.argv,
            env=spawn.env,
            cwd=spawn.cwd,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            start_new_session=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return {}, f"a worker cannot be started: {error}"
    attempts: dict[str, str] = {}
    for line in ended.stdout.splitlines():
        attempts.update(json.loads(line))
    if ended.returncode == 0:
        return attempts, None
    last = ended.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
    return attempts, f"a worker ended with {ended.returncode}: {' '.join(last)[:300]}"


@contextmanager
def _targets(slot: Path) -> Iterator[dict[str, Any]]:
    """Provide targets that could be reached without a sandbox."""
    for name in ("job", "out"):
        (slot / name).mkdir()
    (slot / "job" / "scene").write_bytes(b"#usda 1.0\n")
    outside = slot / "outside"
    outside.write_bytes(b"secret")
    name = f"\0primray-{secrets.token_hex(8)}"
    with ExitStack() as stack:
        tcp = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        udp = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        udp.bind(("127.0.0.1", 0))
        abstract = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        abstract.bind(name)
        abstract.listen()
        yield {
            "server_pid": os.getpid(),
            "file": str(outside),
            "folder": str(slot),
            "tcp_port": tcp.getsockname()[1],
            "udp_port": udp.getsockname()[1],
            "abstract": name,
        }
