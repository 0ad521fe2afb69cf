"""Privileges that a process drops before it reads anything: capabilities, new privileges, inherited files, life without its
parent."""

from __future__ import annotations

import ctypes
import os
import signal
import struct
from contextlib import suppress

from .system_calls import (
    PR_CAP_AMBIENT,
    PR_CAP_AMBIENT_CLEAR_ALL,
    PR_CAPBSET_DROP,
    PR_SET_NO_NEW_PRIVS,
    PR_SET_PDEATHSIG,
    call,
    prctl,
)

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
