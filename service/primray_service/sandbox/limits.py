"""Resource limits of a worker (setrlimit). They apply before anything is read; a worker cannot raise them again, as hard limits
are set as well and it has no capabilities.

The executor's watchdog covers the rest: resident memory, CPU seconds of one phase, bytes of all files together.
"""

from __future__ import annotations

import resource
from collections.abc import Mapping
from dataclasses import dataclass

GiB = 2**30
# Address space beyond the budget, for memory that is reserved and never touched: pxr alone reserves 561 MB of which 90 MB are
# resident, glibc an arena of 64 MiB and a stack of 8 MiB for each thread. With 1 GiB, oneTBB sometimes found no room for its
# threads.
RESERVED_BYTES = 2 * GiB
RESERVED_BYTES_PER_THREAD = 72 * 2**20
OPEN_FILES = 4096
# The kernel counts tasks over all of the user's processes: the limit is this number above those of the machine when a worker
# starts.
MORE_TASKS = 2048


@dataclass(frozen=True)
class Budget:
    """Resources of one worker. `cpu_s`: for its whole life; None: set later by its command (`limit_cpu`)."""

    memory_bytes: int
    threads: int = 1
    file_bytes: int = 8 * GiB
    cpu_s: int | None = None


def limits_of(budget: Budget) -> dict[str, int]:
    """Return the limits by the names of the resource module."""
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
    """Return the threads of the whole machine, which include the user's."""
    try:
        with open("/proc/loadavg", encoding="ascii") as file:
            return int(file.read().split()[3].split("/")[1])
    except (OSError, ValueError, IndexError):
        return 4096


def set_limits(limits: Mapping[str, int]) -> None:
    """Set soft and hard limits; a hard limit that is lower already stays."""
    for name, wanted in limits.items():
        which = getattr(resource, name)
        hard = resource.getrlimit(which)[1]
        value = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(which, (value, value))


def limit_cpu(seconds: float) -> None:
    """Send SIGXCPU, which ends the process, after that many more CPU seconds of all threads, and SIGKILL two seconds later."""
    spent = resource.getrusage(resource.RUSAGE_SELF)
    soft = int(spent.ru_utime + spent.ru_stime + seconds) + 1
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    most = soft + 2 if hard == resource.RLIM_INFINITY else min(soft + 2, hard)
    resource.setrlimit(resource.RLIMIT_CPU, (min(soft, most), most))


def limit_cpu_of_phase(seconds: float) -> None:
    """Send SIGXCPU after that many more CPU seconds, unless `end_phase` is called first."""
    spent = resource.getrusage(resource.RUSAGE_SELF)
    soft = int(spent.ru_utime + spent.ru_stime + seconds) + 1
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def end_phase() -> None:
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
