"""`primray watch`: follows a job's progress until it has ended, by a bar, JSON lines, or a line for each change of state."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected
from .exits import INTERRUPTED, CommandError, error_of_end
from .job_text import error_text, frames_text, place_text, plain, print_warnings, seconds_text

if TYPE_CHECKING:
    from ..client import Client, Event, Job, Progress


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


Show = Callable[[str, "Progress", str], None]  # arguments: the job's state, its progress, its position in the queue


def follow(client: Client, job: Job, as_json: bool, after: int | None = None) -> Job:
    """Show the events of a job after the event with that id, and return the job when it has ended. KeyboardInterrupt
    propagates; it does not end the job."""
    from ..client import Progress, QueuePlace
    from ..client.documents import TERMINAL
    from ..client.reading import read

    if as_json:
        for event in client.watch(job.id):
            print_line({"type": "event", "job": job.id, "id": event.id or None, "event": event.type, "data": event.data})
        return client.job(job.id)
    state, progress, place = job.state, job.progress, place_text(job.queue)
    with _showing(job.id) as show:
        show(state, progress, place)
        for event in client.watch(job.id, after):
            if event.type == "progress":
                progress = read(Progress, event.data)
            elif event.type in ("state", "end"):
                state = str(event.data.get("state", state))
            elif event.type == "queue":
                place = place_text(read(QueuePlace, event.data))
            elif event.type == "warning":
                _say(event)
            if state not in TERMINAL:  # the final number of frames comes with the job
                show(state, progress, place if state == "queued" else "")
        ended = client.job(job.id)
        show(ended.state, ended.progress, "")
    return ended


def _say(event: Event) -> None:
    warning = event.data.get("warning", event.data)
    if isinstance(warning, dict):
        print_warnings([warning])


@contextmanager
def _showing(job_id: str) -> Iterator[Show]:
    if sys.stderr.isatty():
        with _bar(job_id) as show:
            yield show
    else:
        yield _lines(job_id)


def _lines(job_id: str) -> Show:
    last = ("", "")

    def show(state: str, progress: Progress, place: str) -> None:
        nonlocal last
        turn = place.partition(",")[0]  # a changed estimate is not worth a line
        if (state, turn) != last:
            last = (state, turn)
            details = ", ".join(filter(None, (place, frames_text(progress), error_text(progress))))
            print(f"{job_id} {plain(state)}{f': {plain(details)}' if details else ''}", file=sys.stderr, flush=True)

    return show


@contextmanager
def _bar(job_id: str) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[details]}", markup=False),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(job_id, total=1.0, details="")

        def show(state: str, progress: Progress, place: str) -> None:
            eta = f"ETA {seconds_text(progress.eta_s)}" if progress.eta_s and state == "running" else ""
            doing = progress.phase if state in ("preparing", "running") and progress.phase else state
            details = "  ".join(filter(None, (place, frames_text(progress), error_text(progress), eta)))
            bar.update(task, completed=progress.fraction, description=plain(doing), details=plain(details))

        yield show
