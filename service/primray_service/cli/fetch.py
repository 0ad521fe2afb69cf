"""`primray fetch`: downloads a job's files, resumes broken downloads and checks the digests."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected
from .exits import USAGE, CommandError
from .job_text import plain
from .watch import JobId, watched

if TYPE_CHECKING:
    from ..client import Client, Output

Show = Callable[[int, int], None]
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
    with _showing(outputs, as_json) as show_of:
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
def _showing(outputs: list[Output], as_json: bool) -> Iterator[Callable[[Output], Show]]:
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

        def show_of(output: Output) -> Show:
            nonlocal before
            begun, before = before, before + output.bytes
            return lambda done, of: bar.update(task, description=plain(output.name), completed=begun + done)

        yield show_of
