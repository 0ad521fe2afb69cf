"""A process joins the namespaces of another: how a forked worker gets the root that bubblewrap has made, as bubblewrap makes
roots only around programs that it starts.

The process must have one thread. A child that it forks afterwards is inside the process namespace as well.
"""

from __future__ import annotations

import errno
import os
from contextlib import ExitStack

from .system_calls import call

# The user namespace comes first, as it gives the right to join the others, and mounts last: /proc is the joining process' own.
USER, MOUNTS = "user", "mnt"
REQUIRED = (USER, "ipc", "uts", "net", "pid", MOUNTS)
NAMES = (USER, "cgroup", "ipc", "uts", "net", "pid", MOUNTS)


def join(pid: int) -> None:
    """Join all namespaces of the process; OSError if one that isolates is this process' own."""
    with ExitStack() as opened:
        handles = []
        for name in NAMES:
            theirs, own = f"/proc/{pid}/ns/{name}", f"/proc/self/ns/{name}"
            if os.path.samestat(os.stat(theirs), os.stat(own)):
                if name in REQUIRED:
                    raise OSError(errno.EPERM, f"process {pid} has no {name} namespace of its own")
                continue
            handle = os.open(theirs, os.O_RDONLY | os.O_CLOEXEC)
            opened.callback(os.close, handle)
            handles.append(handle)
        for handle in handles:
            call("setns", handle, 0)
