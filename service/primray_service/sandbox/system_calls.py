"""System calls through ctypes: those that Python's standard library does not have."""

from __future__ import annotations

import ctypes
import os
import platform
from typing import Any

from .call_numbers import OURS, Numbers

MACHINES = ("x86_64", "aarch64")

PR_SET_PDEATHSIG = 1
PR_SET_DUMPABLE = 4
PR_CAPBSET_DROP = 24
PR_SET_NO_NEW_PRIVS = 38
PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL = 47, 4

_libc = ctypes.CDLL(None, use_errno=True)
_libc.syscall.restype = ctypes.c_long
_libc.prctl.restype = ctypes.c_int


def machine() -> int | None:
    """Return the index of this architecture in `Numbers`; None if unsupported."""
    name = platform.machine()
    return MACHINES.index(name) if name in MACHINES else None


def number_of(numbers: Numbers) -> int | None:
    here = machine()
    return None if here is None else numbers[here]


def call(name: str, *arguments: Any) -> int:
    """Make a system call; OSError if the kernel answers with an error, or has no such call."""
    number = number_of(OURS[name])
    if number is None:
        raise OSError(os.strerror(38), name)
    return _checked(_libc.syscall(ctypes.c_long(number), *map(_word, arguments)), name)


def prctl(option: int, *arguments: int) -> int:
    padded = [*arguments, 0, 0, 0, 0][:4]
    return _checked(_libc.prctl(option, *(ctypes.c_ulong(a) for a in padded)), f"prctl({option})")


def _word(argument: Any) -> Any:
    return ctypes.c_long(argument) if isinstance(argument, int) else argument


def _checked(result: int, name: str) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{name}: {os.strerror(number)}")
    return result
