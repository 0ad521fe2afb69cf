"""Commands about submitted jobs: `primray status`, `watch`, `fetch`, `cancel`, `pause`, `resume` and `retry`.

They show jobs, follow them until they have ended, download their files (broken downloads are resumed, digests checked), end
them, free their workers for a while, or render a frame again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Labels, Server, connected, labels_of
from .exits import INTERRUPTED, USAGE, CommandError, error_of_end
from .job_text import block, error_text, frames_text, place_text, plain, print_warnings, seconds_text, table

if TYPE_CHECKING:
    from ..client import Client, Event, Job, Output, Progress


def status(
    job: Annotated[str | None, typer.Argument(metavar="JOB", help="Show this job.", show_default="the latest")] = None,
    count: Annotated[int, typer.Option("--count", "-n", metavar="N", help="Number of jobs, newest first.", min=1)] = 20,
    state: Annotated[str | None, typer.Option(metavar="STATE", help="Only jobs in this state.", show_default=False)] = None,
    label: Labels = None,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Show a service's jobs, newest first, or one job in detail."""
    with connected("status", server, key_file) as client:
        if json:
            found = [client.document(job)] if job else islice(client.documents(state=state, labels=labels_of(label)), count)
            for document in found:
                print_line({"type": "job", **document})
        elif job:
            print("\n".join(block(client.job(job), client.outputs(job))))
        else:
            print("\n".join(table(list(islice(client.jobs(state=state, labels=labels_of(label)), count)))))


JobId = Annotated[str, typer.Argument(metavar="JOB", help="A job's id.", show_default=False)]
JobIds = Annotated[list[str], typer.Argument(metavar="JOB...", help="Jobs' ids.", show_default=False)]


def pause(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Pause jobs: running frames write a checkpoint and free their workers."""
    with connected("pause", server, key_file) as client:
        for job_id in jobs:
            print_job(client.pause(job_id).state, job_id, json)


def resume(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Resume paused jobs: their frames continue from their checkpoints."""
    with connected("resume", server, key_file) as client:
        for job_id in jobs:
            print_job(client.resume(job_id).state, job_id, json)


def retry(
    job: JobId,
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
            print_job(client.retry_frame(job, number).state, job, json, frame=number)


def print_job(state: str, job_id: str, json: bool, frame: int | None = None) -> None:
    if json:
        print_line({"type": "job", "id": job_id, "state": state} | ({} if frame is None else {"frame": frame}))
    else:
        print(f"{job_id} {state}" + ("" if frame is None else f", frame {frame} is queued"))


def cancel(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Cancel jobs; the pictures rendered so far are kept."""
    with connected("cancel", server, key_file) as client:
        for job_id in jobs:
            job = client.cancel(job_id)
            if json:
                print_line({"type": "job", **client.document(job_id)})
            else:
                print(f"{job.id} {job.state}")


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
    from ..client.documents import TERMINAL, read

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


ShowBeside = Callable[[int, int], None]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files with other contents.")]


def fetch(
    job: JobId,
    folder: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Target folder.")] = Path("."),
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="PATTERN", help="Only files with names like *.exr; may be repeated.", show_default=False),
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the job's end first.")] = False,
    overwrite: Overwrite = False,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Download a job's files; if it has not ended, those of its finished frames."""
    with connected("fetch", server, key_file) as client:
        found = client.job(job)
        if wait and not found.is_terminal:
            found = watched(client, found, json)
        fetched = download_all(client, job, folder, json, only, overwrite=overwrite)
        if not fetched:
            advice = "" if found.is_terminal else "; use --wait to wait for its end"
            raise CommandError("no-outputs", f"{job} is {found.state} and has no such files{advice}")


def download_all(
    client: Client,
    job_id: str,
    folder: Path,
    as_json: bool,
    only: list[str] | None = None,
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Download the files and return their paths, printing each one as it arrives. Raises CommandError at the end for targets
    that hold other files."""
    outputs = [
        output for output in client.outputs(job_id) if not only or any(fnmatchcase(output.name, pattern) for pattern in only)
    ]
    fetched, taken = [], []
    with _show_beside(outputs, as_json) as show_of:
        for output in outputs:
            try:
                path = client.download(job_id, output, folder, show=show_of(output), overwrite=overwrite)
            except FileExistsError as error:
                taken.append(str(error.filename))
                continue
            except OSError as error:
                raise CommandError("cannot-write", f"{plain(output.name)} cannot be written: {error}", USAGE) from None
            fetched.append(path)
            if as_json:
                line = {"type": "output", "job": job_id, "name": output.name, "path": str(path), "bytes": output.bytes}
                print_line({**line, "sha256": output.sha256})
            else:
                print(path, flush=True)
    if taken:
        names = ", ".join(map(plain, taken))
        raise CommandError(
            "file-exists", "other files with these names exist; use --overwrite to replace them", USAGE, where=names
        )
    return fetched


@contextmanager
def _show_beside(outputs: list[Output], as_json: bool) -> Iterator[Callable[[Output], ShowBeside]]:
    if as_json or not sys.stderr.isatty():
        yield lambda output: lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    text = TextColumn("{task.description}", markup=False)
    with Progress(
        text, BarColumn(), DownloadColumn(), TransferSpeedColumn(), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("", total=sum(output.bytes for output in outputs))
        before = 0

        def show_of(output: Output) -> ShowBeside:
            nonlocal before
            begun, before = before, before + output.bytes
            return lambda done, of: bar.update(task, description=plain(output.name), completed=begun + done)

        yield show_of
