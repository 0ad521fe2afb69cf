"""A worker's life once it is inside its sandbox: it reports that it is ready, runs one chunk and ends; or, if it is to stay,
waits for more chunks of the same job."""

from __future__ import annotations

import contextlib
import gc
import os
import random
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from ..sandbox import Entered, limit_cpu_of_phase
from .channel import Channel, ClientText

if TYPE_CHECKING:
    from .explain_task import ExplainedStage

Do = Callable[[Mapping[str, Any], Path, Path, Channel], None]

# Workers yield the CPU to the server, whose clients wait for it. Checks are short, and clients wait for them too.
NICE = {"check": 5, "render": 10}
# The kernel accepts one write of a session's priority in this time, from all unprivileged processes together.
AUTOGROUP_EVERY_S, AUTOGROUP_TRIES = 0.1, 8
LATER_S = 2.0  # after the server's watchdog, which can report the reason


def open_channel(entered: Entered, messages: BinaryIO) -> Channel:
    channel = Channel(os.fdopen(0, "rb", closefd=False), messages, ClientText(entered.job, entered.out))
    channel.start()
    return channel


def serve(kind: str, entered: Entered, channel: Channel) -> None:
    """Run chunks until the process ends."""
    do = check if kind == "check" else renders()
    gc.freeze()  # otherwise each collection would visit everything imported, for longer than a small frame takes
    while True:
        channel.send("ready")
        work(do, channel, entered)
        gc.collect()  # frees the last frame's memory before the worker reports ready


def work(do: Do, channel: Channel, entered: Entered) -> None:
    """Run the next chunk; returns if more may follow."""
    command = channel.work()
    shared = command.get("root")  # on shared storage: its file names are relative to that
    if shared:
        channel.text = ClientText(entered.job, entered.out, Path(shared))
    try:
        limits = command.get("limits") or {}
        if limits.get("load_cpu_s"):
            limit_cpu_of_phase(limits["load_cpu_s"] + LATER_S)
        do(command, entered.job, entered.out, channel)
    except BaseException as error:
        from .failures import is_expected, problem_of_error

        if is_expected(error):
            print(channel.text.in_text(str(error)), file=sys.stderr, flush=True)
        else:
            print(channel.text.in_text(traceback.format_exc()), end="", file=sys.stderr, flush=True)
        channel.leave("failed", problem=problem_of_error(error, str(shared or entered.job)).as_json())


def give_way(nice: int) -> None:
    """Lower this process's CPU priority, and that of its session, which is its own if possible."""
    os.nice(nice)
    with contextlib.suppress(PermissionError):  # it leads a group already, and is in a session of its own
        os.setsid()
    if os.getsid(0) != os.getpid():
        return
    session = SessionPriority(nice)
    for _ in range(AUTOGROUP_TRIES):
        session.lower()
        if session.is_low:
            return
        time.sleep(AUTOGROUP_EVERY_S * random.random())


class SessionPriority:
    """The CPU priority of this process's session. If the kernel shares CPU time between sessions, nice has no effect beyond one
    (sched(7), "The autogroup feature")."""

    def __init__(self, nice: int) -> None:
        self._nice = nice
        self.is_low = False  # or cannot be lowered
        try:
            self._file = os.open("/proc/self/autogroup", os.O_WRONLY | os.O_CLOEXEC)
        except OSError:  # the feature does not exist
            self.is_low = True

    def lower(self) -> None:
        """Try once."""
        if self.is_low:
            return
        try:
            os.write(self._file, str(self._nice).encode())
        except BlockingIOError:
            return
        except OSError:  # the feature is switched off
            pass
        self.is_low = True
        os.close(self._file)


def check(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    from .check import check_scene

    check_scene(command, job, out, channel)


def renders() -> Do:
    """Return the function that renders frames of one job, keeping the stage open in between; also their parts, spot checks of
    these, merges, and explanations of pixels."""
    from .merge_task import merge_parts
    from .product_task import render_products
    from .render_task import StageOfFrames, render_frame
    from .spot_check_task import PartChecks

    stages, checks = StageOfFrames(), PartChecks()
    explained: list[ExplainedStage] = []  # at most one

    def do(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
        if command["do"] == "explain":
            explained[:] = explained or [_explained_stage()]
            explained[0].explain(command, job, channel)
        elif command["do"] == "merge":
            merge_parts(command, job, out, channel)
        elif command["do"] == "spot-check":
            checks.check(command, job, out, channel)
        elif command.get("products"):
            render_products(stages, command, job, out, channel)
        else:
            render_frame(stages, command, job, out, channel)

    return do


def _explained_stage() -> ExplainedStage:
    """Return a stage for explanations; renders do not import them."""
    from .explain_task import ExplainedStage

    return ExplainedStage()
