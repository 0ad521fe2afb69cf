"""`primray cancel`: end jobs."""

from __future__ import annotations

from typing import Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected

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
