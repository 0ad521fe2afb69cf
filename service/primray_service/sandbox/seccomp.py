"""A seccomp filter: which system calls a worker may make (kernel: Documentation/userspace-api/seccomp_filter.rst).

Refused calls get EPERM, which libraries handle; calls newer than this list get ENOSYS. The filter is a classic BPF program:
load a word of `struct seccomp_data`, compare, jump, return.
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from .system_calls import BY_ARGUMENT, LAST_KNOWN, REFUSED, call, machine, number_of

_AUDIT_ARCH = (0xC000003E, 0xC00000B7)  # x86_64, aarch64: EM_* with the bits for 64-bit and little-endian

KILL_PROCESS, ALLOW = 0x80000000, 0x7FFF0000
EPERM, ENOSYS = (0x00050000 | number for number in (errno.EPERM, errno.ENOSYS))

_LOAD, _RETURN = 0x20, 0x06  # BPF_LD|BPF_W|BPF_ABS, BPF_RET|BPF_K
_EQUAL, _GREATER, _HAS_BITS = 0x15, 0x25, 0x45  # BPF_JMP|BPF_JEQ, JGT, JSET, all |BPF_K
_NUMBER, _ARCHITECTURE = 0, 4  # offsets in struct seccomp_data

_SECCOMP_SET_MODE_FILTER, _FLAG_TSYNC = 1, 1
_GET_ACTION_AVAIL = 2

_CLONE_THREAD = 0x00010000
_CLONE_NEW = 0x7E020000 | 0x00000080  # NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET; NEWTIME
_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C  # both inject input into a terminal
_PR_SET_PDEATHSIG = 1


def _low(argument: int) -> int:
    """Return the offset of an argument's low 32 bits; both architectures are little-endian."""
    return 16 + 8 * argument


@dataclass(frozen=True)
class _Instruction:
    code: int
    value: int
    if_true: int = 0
    if_false: int = 0

    def packed(self) -> bytes:
        return struct.pack("=HBBI", self.code, self.if_true, self.if_false, self.value)


def _refuse_if(code: int, offset: int, values: tuple[int, ...]) -> Iterator[_Instruction]:
    """Refuse if a word of the arguments is one of the values (or has one of the bits), else allow."""
    yield _Instruction(_LOAD, offset)
    for place, value in enumerate(values):
        yield _Instruction(code, value, if_true=len(values) - place)
    yield _Instruction(_RETURN, ALLOW)
    yield _Instruction(_RETURN, EPERM)


def _allow_if(code: int, offset: int, values: tuple[int, ...]) -> Iterator[_Instruction]:
    """Allow if a word of the arguments is one of the values (or has one of the bits), else refuse."""
    yield _Instruction(_LOAD, offset)
    for place, value in enumerate(values):
        yield _Instruction(code, value, if_true=len(values) - place)
    yield _Instruction(_RETURN, EPERM)
    yield _Instruction(_RETURN, ALLOW)


def _threads_only() -> Iterator[_Instruction]:
    yield _Instruction(_LOAD, _low(0))
    yield _Instruction(_HAS_BITS, _CLONE_NEW, if_true=2)
    yield _Instruction(_HAS_BITS, _CLONE_THREAD, if_false=1)
    yield _Instruction(_RETURN, ALLOW)
    yield _Instruction(_RETURN, EPERM)


def _by_argument(name: str, pid: int) -> list[_Instruction]:
    match name:
        case "clone":
            return list(_threads_only())
        case "clone3":  # its flags are in memory, which a filter cannot read; glibc then falls back to clone
            return [_Instruction(_RETURN, ENOSYS)]
        case "ioctl":
            return list(_refuse_if(_EQUAL, _low(1), (_TIOCSTI, _TIOCLINUX)))
        case "prctl":  # otherwise it could outlive its server
            return list(_refuse_if(_EQUAL, _low(0), (_PR_SET_PDEATHSIG,)))
        case "prlimit64" | "sched_setaffinity":
            return list(_allow_if(_EQUAL, _low(0), (0, pid)))
        case _:  # signals: to itself only
            return list(_allow_if(_EQUAL, _low(0), (pid,)))


def program(pid: int) -> list[_Instruction]:
    """Return the filter for the process with this id on this architecture."""
    here = machine()
    if here is None:
        raise OSError(errno.ENOSYS, "no seccomp filter is known for this machine")
    instructions = [
        _Instruction(_LOAD, _ARCHITECTURE),
        _Instruction(_EQUAL, _AUDIT_ARCH[here], if_true=1),
        _Instruction(_RETURN, KILL_PROCESS),
        _Instruction(_LOAD, _NUMBER),
        _Instruction(_GREATER, LAST_KNOWN, if_false=1),
        _Instruction(_RETURN, ENOSYS),
    ]
    for numbers in REFUSED.values():
        if (number := number_of(numbers)) is not None:
            instructions += [_Instruction(_EQUAL, number, if_false=1), _Instruction(_RETURN, EPERM)]
    for name, numbers in BY_ARGUMENT.items():
        if (number := number_of(numbers)) is not None:
            block = _by_argument(name, pid)
            instructions += [_Instruction(_EQUAL, number, if_false=len(block)), *block]
    return [*instructions, _Instruction(_RETURN, ALLOW)]


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))


def available() -> None:
    """Raise OSError if the kernel has no seccomp filters."""
    if machine() is None:
        raise OSError(errno.ENOSYS, "no seccomp filter is known for this machine")
    action = ctypes.c_uint32(EPERM & 0xFFFF0000)
    call("seccomp", _GET_ACTION_AVAIL, 0, ctypes.byref(action))


def install() -> None:
    """Install the filter for all threads of this process. no_new_privs must be set."""
    code = b"".join(instruction.packed() for instruction in program(os.getpid()))
    filter_program = _Program(len(code) // 8, code)
    call("seccomp", _SECCOMP_SET_MODE_FILTER, _FLAG_TSYNC, ctypes.byref(filter_program))
