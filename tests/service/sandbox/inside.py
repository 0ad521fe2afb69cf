"""Small programs inside the sandbox: what they print as JSON, and how they end. They are started as programs, or forked
(conftest.py says which)."""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from primray_service.executor.fork_server import ForkedProcess
from primray_service.sandbox import Budget, decode_exit, usable_layers, worker_spawn
from primray_service.sandbox.spawn import fork_server_spawn, worker_fork

GiB = 2**30
FORKS = False
FORK_SERVER = """
import json, os, socket, sys
from primray_service.sandbox.spawn import PLAN
from primray_service.worker import fork_server
def work(request):
    os.environ[PLAN] = json.dumps(request.complete_plan())
    exec(compile(request.targets["program"], "program", "exec"), {"__name__": "__main__"})
fork_server.close_other_files((int(sys.argv[1]),))
fork_server.accept(socket.socket(fileno=int(sys.argv[1])), work)
"""
PREFACE = """
import ctypes, errno, json, os, socket, sys
from primray_service.sandbox import enter
entered = enter()
def attempt(call, *arguments):
    try:
        call(*arguments)
    except OSError as error:
        return errno.errorcode.get(error.errno, str(error))
    return "done"
libc = ctypes.CDLL(None, use_errno=True)
def raw(*arguments):
    result = libc.syscall(*(ctypes.c_long(a) if isinstance(a, int) else a for a in arguments))
    return errno.errorcode[ctypes.get_errno()] if result < 0 else "done"
def say(value):
    print(json.dumps(value), flush=True)
"""


@dataclass
class Ended:
    said: Any
    exit_code: int | None
    signal: int | None
    errors: str


def needs(*layers: str) -> frozenset[str]:
    missing = set(layers) - usable_layers()
    if missing:
        pytest.skip(f"skipped: no {', '.join(sorted(missing))}")
    return frozenset(layers)


def make_slot(folder: Path) -> Path:
    slot = folder / "slot"
    (slot / "job").mkdir(parents=True)
    (slot / "out").mkdir()
    return slot


def run_inside(
    slot: Path,
    program: str,
    layers: frozenset[str] | None,
    *,
    budget: Budget | None = None,
    preface: str = PREFACE,
    **options: Any,
) -> Ended:
    if FORKS:
        return asyncio.run(_run_forked(slot, preface + program, layers, budget or Budget(2 * GiB), **options))
    spawn = worker_spawn(slot, budget or Budget(2 * GiB), ("-c", preface + program), layers)
    ended = subprocess.run(
        spawn.argv, env=spawn.env, cwd=spawn.cwd, capture_output=True, start_new_session=True, timeout=60, **options
    )
    lines = ended.stdout.decode().splitlines()
    code, signal = decode_exit(ended.returncode, spawn.wrapped)
    return Ended(json.loads(lines[-1]) if lines else None, code, signal, ended.stderr.decode("utf-8", "replace"))


async def _run_forked(
    slot: Path, program: str, layers: frozenset[str] | None, budget: Budget, pass_fds: Sequence[int] = ()
) -> Ended:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        start = fork_server_spawn(slot, theirs.fileno())
        argv = [sys.executable, "-I", "-B", "-c", FORK_SERVER, str(theirs.fileno())]
        server = subprocess.Popen(argv, env=start.env, start_new_session=True, pass_fds=(theirs.fileno(), *pass_fds))
    with ours:
        request = worker_fork(slot, budget, layers) | {"kind": "program", "targets": {"program": program}}
        lines: list[bytes] = []
        log = slot / "log.txt"
        forked = ForkedProcess(ours, request, log, 2**20, lines.append)
        ended = await asyncio.wait_for(asyncio.shield(forked.exit), 60)
    assert server.wait(20) == 0
    said = json.loads(lines[-1]) if lines else None
    code, signal = decode_exit(ended.returncode, wrapped=False)
    return Ended(said, code, signal, log.read_text(errors="replace"))
