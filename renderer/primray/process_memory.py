"""Memory of this process: its limit, and Python's garbage collection.

Limits are for commands that run in their own process. Estimates reject a render that does not fit before anything is allocated.
Whatever they miss, a watch thread of the core ends the process before it exceeds the limit, and reports the estimate. A process
that belongs to the user, such as a notebook, is never ended.
"""

from __future__ import annotations

import gc
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from .errors import LimitError

MIB = 2**20
CODE = "memory-limit"
MARGIN = 24 * MIB  # kMargin of base/memory_watch.cpp: a process is ended when this much of its limit is left
PLACEHOLDER = "@HELD@"


def resident_bytes() -> float:
    """Return the resident memory of this process, or infinity where the system does not report it."""
    try:
        return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # there is no /proc
        return float("inf")


def machine_bytes() -> int:
    """Return the physical memory of the machine."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def available_bytes() -> int:
    """Return the memory that this process may use: the least of its cgroup limits and the machine's memory."""
    return min([machine_bytes(), *_cgroup_limits()])


def _cgroup_limits(root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")) -> Iterator[int]:
    """Yield the memory limits of this process's cgroups, of both cgroup versions, up to the root."""
    try:
        lines = own.read_text("ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        return
    for line in lines:
        number, controllers, path = line.split(":", 2)
        if number == "0":
            top, name = root, "memory.max"
        elif "memory" in controllers.split(","):
            top, name = root / "memory", "memory.limit_in_bytes"
        else:
            continue
        parts = Path(path.lstrip("/"))
        for folder in (parts, *parts.parents):
            try:
                text = (top / folder / name).read_text("ascii").strip()
            except (OSError, UnicodeDecodeError):
                continue
            if text.isdigit():  # "max": no limit
                yield int(text)


# The core's watch_memory: limit, the text before and after the MiB held, the same for JSON, and the exit code.
Watch = Callable[[int, str, str, str, str, int], None]


class Held:
    """A process held to `limit` bytes. `is_json`: the message that ends it is also printed as a JSON line."""

    def __init__(self, limit: int, is_json: bool, watch: Watch) -> None:
        self.limit, self._is_json, self._watch = limit, is_json, watch
        self._further = ""

    def expect(self, parts: Mapping[str, int]) -> None:
        """Record the estimate of the render's memory, for the message if the process is ended."""
        self._further = f"; the render was estimated to need {described(parts)}"
        self.watch()

    def read_stage(self) -> None:
        """Record that the stage is being read, when no estimate exists yet."""
        self._further = "; it was reading the stage. `primray inspect` estimates the memory of a render"
        self.watch()

    def watch(self) -> None:
        """Start the watch that ends the process before it exceeds the limit."""
        limit = f"{self.limit / MIB:.0f} MiB are allowed"
        message = f"the process uses {PLACEHOLDER} MiB and {limit}, so it is stopped before it exceeds the limit{self._further}"
        before, after = f"error: {CODE}: {message}\n".split(PLACEHOLDER)
        line = {"type": "error", "code": CODE, "message": message, "where": "", "exit_code": LimitError.exit_code}
        json_before, json_after = (json.dumps(line) + "\n").split(PLACEHOLDER) if self._is_json else ("", "")
        self._watch(self.limit, before, after, json_before, json_after, LimitError.exit_code)


held: Held | None = None  # set if the command owns its process and has a limit
owns_process = False  # set by the command line, which is allowed to end its process


def hold(limit: int | None, is_json: bool, watch: Callable[[], Watch]) -> None:
    """Limit the process to `limit` bytes from now on, if the command owns it.

    Raise LimitError if it already holds that much.
    """
    global held
    if limit is None or not owns_process:
        return
    now = resident_bytes()
    if now + MARGIN > limit:
        raise too_little(limit, {"the process before it opens the stage": int(now + MARGIN)})
    held = Held(limit, is_json, watch())
    held.read_stage()


def too_little(limit: int, parts: Mapping[str, int]) -> LimitError:
    """Return the error of a render whose `parts` need more than `limit`."""
    sentence = f"the render needs about {described(parts)}; {limit / MIB:.0f} MiB are allowed"
    return LimitError(sentence, code=CODE)


def described(parts: Mapping[str, int]) -> str:
    """Return the total memory needed with its parts, the largest first, as text."""
    of = sorted(parts.items(), key=lambda item: -item[1])
    shown = ", ".join(f"{name} {size / MIB:.0f}" for name, size in of if size >= MIB / 2)
    return f"{sum(parts.values()) / MIB:.0f} MiB" + (f" ({shown})" if shown else "")


@contextmanager
def without_collection() -> Iterator[None]:
    """Suspend cyclic garbage collection inside the block.

    Collections rescan every live object, which costs a tenth of the time of building a scene.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
