"""`primray status`: the latest jobs, or one of them."""

from __future__ import annotations

from itertools import islice
from typing import Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Labels, Server, connected, labels_of
from .job_text import block, table


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
