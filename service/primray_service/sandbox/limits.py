"""Resource limits of a worker (setrlimit). They bind before anything is read; a worker cannot raise them again, as hard limits
are set with them and it has no capabilities.

What they cannot say, the executor's watchdog does: resident memory, CPU seconds of one phase, bytes of all files together.
"""

from __future__ import annotations

import resource
from collections.abc import Mapping
from dataclasses import dataclass

GiB = 2**30
# Beyond the budget, address space that is reserved and never touched: pxr alone reserves 561 MB of which 90 MB are resident,
# glibc an arena of 64 MiB and a stack of 8 MiB for each thread. With 1 GiB, oneTBB sometimes found no room for its threads.
RESERVED_BYTES = 2 * GiB
RESERVED_BYTES_PER_THREAD = 72 * 2**20
OPEN_FILES = 4096
# Tasks are counted over all of the user's processes: the limit is so many above those of the machine when a worker starts.
MORE_TASKS = 2048


@dataclass(frozen=True)
class Budget:
    """What one worker may use. `cpu_s`: of its whole life; None: as its command says, later (`limit_cpu`)."""

    memory_bytes: int
    threads: int = 1
    file_bytes: int = 8 * GiB
    cpu_s: int | None = None


def limits_of(budget: Budget) -> dict[str, int]:
    """By the names of the resource module."""
    found = {
        "RLIMIT_AS": budget.memory_bytes + RESERVED_BYTES + budget.threads * RESERVED_BYTES_PER_THREAD,
        "RLIMIT_FSIZE": budget.file_bytes,
        "RLIMIT_NOFILE": OPEN_FILES,
        "RLIMIT_NPROC": _tasks() + MORE_TASKS,
        "RLIMIT_CORE": 0,
        "RLIMIT_MEMLOCK": 0,
        "RLIMIT_MSGQUEUE": 0,
    }
    return found if budget.cpu_s is None else {**found, "RLIMIT_CPU": budget.cpu_s}


def _tasks() -> int:
    """Threads of the whole machine, at least the user's."""
    try:
        with open("/proc/loadavg", encoding="ascii") as file:
            return int(file.read().split()[3].split("/")[1])
    except (OSError, ValueError, IndexError):
        return 4096


def set_limits(limits: Mapping[str, int]) -> None:
    """Soft and hard; where the hard limit is lower already, that stays."""
    for name, wanted in limits.items():
        which = getattr(resource, name)
        hard = resource.getrlimit(which)[1]
        value = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(which, (value, value))


def limit_cpu(seconds: float) -> None:
    """SIGXCPU, which ends the process, after so many more CPU seconds of all threads, and SIGKILL two seconds later."""
    spent = resource.getrusage(resource.RUSAGE_SELF)
    soft = int(spent.ru_utime + spent.ru_stime + seconds) + 1
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    most = soft + 2 if hard == resource.RLIM_INFINITY else min(soft + 2, hard)
    resource.setrlimit(resource.RLIMIT_CPU, (min(soft, most), most))


def limit_cpu_of_phase(seconds: float) -> None:
    """SIGXCPU after so many more CPU seconds, unless `end_phase` comes first."""
    spent = resource.getrusage(resource.RUSAGE_SELF)
    soft = int(spent.ru_utime + spent.ru_stime + seconds) + 1
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def end_phase() -> None:
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
