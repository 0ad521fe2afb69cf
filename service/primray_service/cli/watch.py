"""`primray watch`: follows a job's progress until it has ended."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected
from .exits import INTERRUPTED, CommandError, error_of_end
from .following import follow
from .job_text import print_warnings

if TYPE_CHECKING:
    from ..client import Client, Job

JobId = Annotated[str, typer.Argument(metavar="JOB", help="A job's id.", show_default=False)]


def watch(job: JobId, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Follow a job until it has ended, and exit with its result. Ctrl-C stops watching; the job continues."""
    with connected("watch", server, key_file) as client:
        # read before the job: events in between are shown twice rather than missed
        after = None if json else client.last_event_id(job)
        found = client.job(job)
        if not json:
            print_warnings(found.warnings)
        end_as(watched(client, found, json, after))


def watched(client: Client, job: Job, as_json: bool, after: int | None = None) -> Job:
    """Follow a job's events after the given one and return it at its end; CommandError if the user interrupts."""
    try:
        ended = follow(client, job, as_json, after)
    except KeyboardInterrupt:
        advice = f"the job continues: `primray watch {job.id}` to see more, `primray cancel {job.id}` to cancel it"
        raise CommandError("interrupted", advice, INTERRUPTED) from None
    if as_json:
        print_line({"type": "job", **client.document(job.id)})
    return ended


def end_as(job: Job) -> None:
    """End the command with the exit code for the job's end."""
    error = error_of_end(job)
    if error is not None:
        raise error
    print(f"{job.id} {job.state}", file=sys.stderr)
