"""A worker: enters its sandbox, imports what takes long, says that it is ready, does one thing and ends."""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from .channel import Channel, claim_stdout

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any


def main(arguments: list[str]) -> None:
    kind, job, out = arguments
    messages = claim_stdout()
    enter(job, out)
    channel = Channel(os.fdopen(0, "rb", closefd=False), messages)
    channel.start()
    warm(kind)
    channel.send("ready")
    command = channel.first()
    try:
        do(command, Path(job), Path(out), channel)
    except BaseException as error:
        traceback.print_exc()
        from .failures import problem_of_error

        channel.leave("failed", problem=problem_of_error(error, job).as_json())


def enter(job: str, out: str) -> None:
    os.nice(10)


def warm(kind: str) -> None:
    """Import what takes long, and what opens files of its own."""
    from primray import core

    core.module()
    core.build_digest()
    core.lanes()
    from . import render_task  # noqa: F401


def do(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    if command["do"] != "render":
        raise ValueError(f"no command {command['do']!r}")
    from .render_task import render_frame

    render_frame(command, job, out, channel)


main(sys.argv[1:])
