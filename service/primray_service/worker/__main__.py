"""A worker: enters its sandbox, imports what takes long, says that it is ready, does one thing and ends."""

from __future__ import annotations

import contextlib
import os
import random
import sys
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from ..sandbox import enter, limit_cpu_of_phase
from .channel import Channel, claim_stdout
from .client_text import ClientText
from .warm import warm_up

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# The server comes first: its clients wait for it. Checks are short, and somebody waits for them too.
NICE = {"check": 5, "render": 10}
AUTOGROUP_TRIES = 8
LATER_S = 2.0  # than the server's watchdog, which can say why


def main(arguments: list[str]) -> None:
    (kind,) = arguments
    messages = claim_stdout()
    give_way(NICE[kind])
    entered = enter((messages.fileno(),))
    text = ClientText(entered.job, entered.out)
    channel = Channel(os.fdopen(0, "rb", closefd=False), messages, text)
    channel.start()
    warm_up(kind, entered.out / "tmp")
    channel.send("ready")
    command = channel.first()
    try:
        do(command, entered.job, entered.out, channel)
    except BaseException as error:
        from .failures import is_expected, problem_of_error

        if is_expected(error):
            print(text.in_text(str(error)), file=sys.stderr, flush=True)
        else:
            print(text.in_text(traceback.format_exc()), end="", file=sys.stderr, flush=True)
        channel.leave("failed", problem=problem_of_error(error, str(entered.job)).as_json())


def give_way(nice: int) -> None:
    """Let other processes go first. Where the kernel shares time between sessions, nice says nothing beyond this one's own:
    then the session has to give way as well (sched(7), "The autogroup feature")."""
    os.nice(nice)
    with contextlib.suppress(PermissionError):  # it leads a group already, and is in a session of its own
        os.setsid()
    if os.getsid(0) != os.getpid():
        return
    for _ in range(AUTOGROUP_TRIES):
        try:
            Path("/proc/self/autogroup").write_text(str(nice))
        except BlockingIOError:  # the kernel takes one in 0.1 s from all who are not privileged
            time.sleep(0.1 * random.random())
        except OSError:  # there is no such feature
            return
        else:
            return


def do(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    limits = command.get("limits") or {}
    if limits.get("load_cpu_s"):
        limit_cpu_of_phase(limits["load_cpu_s"] + LATER_S)
    if command["do"] == "check":
        from .check import check_scene

        check_scene(command, job, out, channel)
        return
    if command["do"] != "render":
        raise ValueError(f"no command {command['do']!r}")
    from .render_task import render_frame

    render_frame(command, job, out, channel)


main(sys.argv[1:])
