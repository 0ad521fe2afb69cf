"""`primray cancel`, `pause`, `resume` and `retry`: end jobs, free their workers for a while, or render a frame again."""

from __future__ import annotations

from typing import Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected
from .exits import USAGE, CommandError

Job = Annotated[str, typer.Argument(metavar="JOB", help="A job's id.", show_default=False)]


def pause(jobs: Jobs, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Pause jobs: running frames write a checkpoint and free their workers."""
    with connected("pause", server, key_file) as client:
        for job_id in jobs:
            show(client.pause(job_id).state, job_id, json)


def resume(jobs: Jobs, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Resume paused jobs: their frames continue from their checkpoints."""
    with connected("resume", server, key_file) as client:
        for job_id in jobs:
            show(client.resume(job_id).state, job_id, json)


def retry(
    job: Job,
    frame: Annotated[
        list[int] | None,
        typer.Option("--frame", metavar="N", help="The frame's index in the job, from 0.", show_default="all that failed"),
    ] = None,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Render finished frames of a job again; its other frames stay as they are."""
    with connected("retry", server, key_file) as client:
        numbers = frame or [each.number for each in client.frames(job) if each.state == "failed"]
        if not numbers:
            raise CommandError("nothing-failed", f"no frame of {job} has failed; name one with --frame", USAGE)
        for number in numbers:
            show(client.retry_frame(job, number).state, job, json, frame=number)


def show(state: str, job_id: str, json: bool, frame: int | None = None) -> None:
    if json:
        print_line({"type": "job", "id": job_id, "state": state} | ({} if frame is None else {"frame": frame}))
    else:
        print(f"{job_id} {state}" + ("" if frame is None else f", frame {frame} is queued"))


Jobs = Annotated[list[str], typer.Argument(metavar="JOB...", help="Jobs' ids.", show_default=False)]


def cancel(jobs: Jobs, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Cancel jobs; the pictures rendered so far are kept."""
    with connected("cancel", server, key_file) as client:
        for job_id in jobs:
            job = client.cancel(job_id)
            if json:
                print_line({"type": "job", **client.document(job_id)})
            else:
                print(f"{job.id} {job.state}")
