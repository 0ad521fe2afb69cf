"""A worker: enters its sandbox, does its slow imports, reports that it is ready, runs one chunk and ends; or, if it is to
stay, waits for more chunks of the same job.

Before its first chunk it renders a stage of one cube, which does whatever happens once in a process: libraries are loaded,
their plug-ins and configurations read, threads started, so that the first picture of a job is not late.
"""

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
from typing import Any

from ..sandbox import Entered, enter, limit_cpu_of_phase
from .channel import Channel, ClientText, claim_stdout

STAGE = '#usda 1.0\ndef Cube "cube" {\n}\n'


def warm_up(kind: str, folder: Path) -> None:
    """Warm up; `folder` is for files that are removed afterwards."""
    from primray import usd
    from primray.composition import Composition
    from primray.diagnostics import Diagnostics

    stage = folder / "warm.usda"
    stage.write_text(STAGE)
    if kind == "check":
        from . import check  # noqa: F401

        usd.open_stage(str(stage), Diagnostics(), Composition())
    else:
        _render(stage, folder)
    stage.unlink()


def _render(stage: Path, folder: Path) -> None:
    from primray import core
    from primray.render import render
    from primray.settings import RenderSettings

    from . import render_task  # noqa: F401

    core.build_digest()
    image = render(str(stage), RenderSettings(resolution=(16, 16), spp=2, threads=1))
    for name in ("warm.exr", "warm.png"):
        image.save(folder / name).unlink()


Do = Callable[[Mapping[str, Any], Path, Path, Channel], None]

# Workers yield the CPU to the server, whose clients wait for it. Checks are short, and clients wait for them too.
NICE = {"check": 5, "render": 10}
AUTOGROUP_TRIES = 8
LATER_S = 2.0  # after the server's watchdog, which can report the reason


def main(arguments: list[str]) -> None:
    (kind,) = arguments
    messages = claim_stdout()
    give_way(NICE[kind])
    entered = enter((messages.fileno(),))
    text = ClientText(entered.job, entered.out)
    channel = Channel(os.fdopen(0, "rb", closefd=False), messages, text)
    channel.start()
    warm_up(kind, entered.out / "tmp")
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
    """Lower this process's CPU priority. If the kernel shares CPU time between sessions, nice has no effect beyond this one:
    then the session's priority is lowered as well (sched(7), "The autogroup feature")."""
    os.nice(nice)
    with contextlib.suppress(PermissionError):  # it leads a group already, and is in a session of its own
        os.setsid()
    if os.getsid(0) != os.getpid():
        return
    for _ in range(AUTOGROUP_TRIES):
        try:
            Path("/proc/self/autogroup").write_text(str(nice))
        except BlockingIOError:  # the kernel accepts one write in 0.1 s from all unprivileged processes
            time.sleep(0.1 * random.random())
        except OSError:  # the feature does not exist
            return
        else:
            return


def check(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    from .check import check_scene

    check_scene(command, job, out, channel)


def renders() -> Do:
    """Return the function that renders frames of one job, keeping the stage open in between; also their parts, and merges of
    these."""
    from .merge_task import merge_parts
    from .product_task import render_products
    from .render_task import StageOfFrames, render_frame

    stages = StageOfFrames()

    def do(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
        if command["do"] == "merge":
            merge_parts(command, job, out, channel)
        elif command.get("products"):
            render_products(stages, command, job, out, channel)
        else:
            render_frame(stages, command, job, out, channel)

    return do


main(sys.argv[1:])
