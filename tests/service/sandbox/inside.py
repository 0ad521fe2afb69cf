"""Small programs inside the sandbox: what they print as JSON, and how they end."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from primray_service.sandbox import Budget, decode_exit, usable_layers, worker_spawn

GiB = 2**30
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
    spawn = worker_spawn(slot, budget or Budget(2 * GiB), ("-c", preface + program), layers)
    ended = subprocess.run(
        spawn.argv, env=spawn.env, cwd=spawn.cwd, capture_output=True, start_new_session=True, timeout=60, **options
    )
    lines = ended.stdout.decode().splitlines()
    code, signal = decode_exit(ended.returncode, spawn.wrapped)
    return Ended(json.loads(lines[-1]) if lines else None, code, signal, ended.stderr.decode("utf-8", "replace"))
