"""Resource usage of a worker, read from /proc: memory and CPU seconds of its processes together, bytes in its folder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

PAGE = os.sysconf("SC_PAGE_SIZE")
TICKS = os.sysconf("SC_CLK_TCK")
MOST_PROCESSES = 512
MOST_FILES = 10_000  # a folder with more counts as too large


@dataclass(frozen=True)
class Used:
    rss_bytes: int = 0
    cpu_s: float = 0.0  # of living processes, and of children that they waited for


def used_by(pid: int) -> Used:
    """Return the usage of the process and all of its descendants."""
    rss = cpu = 0
    for process in _tree(pid):
        try:
            rss += int(Path(f"/proc/{process}/statm").read_text("ascii").split()[1])
            after_name = Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()
            cpu += sum(map(int, after_name[11:15]))
        except (OSError, ValueError, IndexError):
            continue  # it has just ended
    return Used(rss * PAGE, cpu / TICKS)


def peak_rss_bytes(pid: int) -> int:
    """Return the most memory that one process has held (VmHWM); 0 if it is gone."""
    try:
        for line in Path(f"/proc/{pid}/status").read_text("ascii", "replace").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 0


def innermost(pid: int) -> int:
    """Return the process at the end of a chain of only children: the worker itself, if a sandbox's processes are around it."""
    for _ in range(4):
        below = _children(pid)
        if len(below) != 1:
            return pid
        pid = below[0]
    return pid


def _tree(pid: int) -> list[int]:
    found = [pid]
    for process in found:
        found += _children(process)
        if len(found) > MOST_PROCESSES:
            break
    return found


def _children(pid: int) -> list[int]:
    """Return the children of all its threads."""
    found = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):
            found += [int(word) for word in Path(f"/proc/{pid}/task/{thread}/children").read_text("ascii").split()]
    except (OSError, ValueError):
        pass
    return found


def folder_bytes(folder: Path, most: int) -> int:
    """Return the bytes on disk of all files below a folder; counting stops above `most`, or if there are too many files."""
    total = entries = 0
    folders = [str(folder)]
    while folders:
        try:
            with os.scandir(folders.pop()) as found:
                for entry in found:
                    entries += 1
                    if entries > MOST_FILES or total > most:
                        return most + 1
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    else:
                        total += entry.stat(follow_symlinks=False).st_blocks * 512
        except OSError:
            continue  # it has just been removed
    return total
