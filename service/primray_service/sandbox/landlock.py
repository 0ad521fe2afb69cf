"""Landlock: the kernel's rules on which files this process and its later threads may open (docs.kernel.org,
userspace-api/landlock.html). It needs no privileges and no namespaces, so it works where bubblewrap cannot.

It binds the calling thread and threads started later: enter before any library starts threads. It does not hide names (stat
works) and covers no modes, owners or times: seccomp.py refuses their calls.
"""

from __future__ import annotations

import ctypes
import os
import stat
from collections.abc import Iterable

from .system_calls import call

EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
REMOVE_DIR, REMOVE_FILE = 1 << 4, 1 << 5
MAKE_CHAR, MAKE_DIR, MAKE_REG, MAKE_SOCK, MAKE_FIFO, MAKE_BLOCK, MAKE_SYM = (1 << bit for bit in range(6, 13))
REFER, TRUNCATE, IOCTL_DEV = 1 << 13, 1 << 14, 1 << 15

# Highest right that each ABI version knows.
_KNOWN_FS = {1: MAKE_SYM, 2: REFER, 3: TRUNCATE, 4: TRUNCATE, 5: IOCTL_DEV}
_OF_A_FILE = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
NET_ALL = 0b11  # bind and connect TCP: ABI 4
SCOPE_ALL = 0b11  # abstract unix sockets and signals: ABI 6

READ = READ_FILE | READ_DIR
# Links, devices, sockets and pipes cannot be created; REFER lets files move between its own folders, never in from others.
WRITE = READ | WRITE_FILE | REMOVE_DIR | REMOVE_FILE | MAKE_DIR | MAKE_REG | REFER | TRUNCATE

_CREATE_RULESET_VERSION = 1
_RULE_PATH_BENEATH = 1


class _Ruleset(ctypes.Structure):
    _fields_ = (
        ("handled_access_fs", ctypes.c_uint64),
        ("handled_access_net", ctypes.c_uint64),
        ("scoped", ctypes.c_uint64),
    )


class _PathBeneath(ctypes.Structure):
    _pack_ = 1
    _layout_ = "ms"
    _fields_ = (("allowed_access", ctypes.c_uint64), ("parent_fd", ctypes.c_int32))


def abi() -> int:
    """Return the kernel's ABI version; OSError if Landlock is missing or switched off."""
    return call("landlock_create_ruleset", None, 0, _CREATE_RULESET_VERSION)


def handled_fs(version: int) -> int:
    """Return all rights that this ABI knows: those handled and not granted are refused."""
    return 2 * _KNOWN_FS[min(version, max(_KNOWN_FS))] - 1


def restrict(readable: Iterable[str], writable: Iterable[str], devices: Iterable[str] = ()) -> None:
    """Restrict this process to these paths: `readable` and `writable` with everything below them, `devices` for reading and
    writing.

    Paths that do not exist are skipped. no_new_privs must be set.
    """
    version = abi()
    handled = handled_fs(version)
    ruleset = _Ruleset(handled, NET_ALL if version >= 4 else 0, SCOPE_ALL if version >= 6 else 0)
    # An older kernel takes a shorter structure.
    size = 24 if version >= 6 else 16 if version >= 4 else 8
    handle = call("landlock_create_ruleset", ctypes.byref(ruleset), size, 0)
    try:
        for paths, access in ((readable, READ), (writable, WRITE), (devices, READ_FILE | WRITE_FILE)):
            for path in paths:
                _allow(handle, path, access & handled)
        call("landlock_restrict_self", handle, 0)
    finally:
        os.close(handle)


def _allow(ruleset: int, path: str, access: int) -> None:
    try:
        folder = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    try:
        if not stat.S_ISDIR(os.fstat(folder).st_mode):
            access &= _OF_A_FILE
        rule = _PathBeneath(access, folder)
        call("landlock_add_rule", ruleset, _RULE_PATH_BENEATH, ctypes.byref(rule), 0)
    finally:
        os.close(folder)
