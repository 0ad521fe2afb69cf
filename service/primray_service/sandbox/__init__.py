"""Sandbox of a worker process. Uploaded scenes are untrusted input to USD's parsers; this package limits what a worker can
reach.

    system_calls.py                    the kernel by ctypes; numbers of the calls that a worker is refused
    limits.py                          rlimits: memory, files, file size, CPU
    landlock.py                        which files can be opened; TCP, abstract sockets and signals too on newer kernels
    seccomp.py                         which system calls can be made
    bubblewrap.py                      an empty root with only what Python needs
    namespaces.py                      a forked worker joins the namespaces that bubblewrap made
    spawn.py                           which of these work here; a worker's argument list and environment (the server's side)
    entry.py                           `enter()` (the worker's side), drops privileges before anything large is imported
    attempts.py, self_test.py          attempts from inside that must fail; for /readyz

Python with ctypes rather than the C++ core: the same system calls without a build, for every Python process.
"""

from .entry import Entered, SandboxError, enter
from .limits import Budget, end_phase, limit_cpu, limit_cpu_of_phase
from .self_test import SelfTest, self_test
from .spawn import Spawn, decode_exit, layers, usable_layers, worker_pid, worker_spawn, works

__all__ = [
    "Budget",
    "Entered",
    "SandboxError",
    "SelfTest",
    "Spawn",
    "decode_exit",
    "end_phase",
    "enter",
    "layers",
    "limit_cpu",
    "limit_cpu_of_phase",
    "self_test",
    "usable_layers",
    "worker_pid",
    "worker_spawn",
    "works",
]
