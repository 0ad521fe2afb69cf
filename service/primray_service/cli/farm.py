"""`primray farm status`: the state of a Ray cluster, without a service."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from primray.cli.console import print_line

from .connection import Json
from .exits import USAGE, CommandError
from .job_text import plain

# Flags that `primray serve` has, too.
RayCores = Annotated[
    int | None,
    typer.Option(metavar="N", help="Cores for each render.", show_default="8, or all of the smallest node", min=1),
]
RayLabel = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Only nodes that have this label; may be repeated.", show_default=False),
]

farm = typer.Typer(
    help="Look at a Ray cluster.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@farm.callback()
def _farm() -> None:
    """Look at a Ray cluster."""


@farm.command()
def status(
    ray_address: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Address of the cluster's head; auto: this machine's cluster.")
    ] = "auto",
    ray_cores: RayCores = None,
    ray_label: RayLabel = None,
    allow_unsandboxed: Annotated[bool, typer.Option("--allow-unsandboxed", help="Include nodes without a sandbox.")] = False,
    json: Json = False,
) -> None:
    """Show the nodes of a Ray cluster, how many renders each has room for, and what runs there for whom."""
    from ..farm.status import farm_status, status_lines

    labels = dict(label.partition("=")[::2] for label in ray_label or [])
    if not all(name and value for name, value in labels.items()):
        raise CommandError("ray-label", "--ray-label must be NAME=VALUE", USAGE)
    settings = {"address": ray_address, "cores": ray_cores, "labels": labels, "allow_unsandboxed": allow_unsandboxed}
    found = farm_status(settings)
    if json:
        print_line({"type": "farm", **found.as_json()})
    else:
        print("\n".join(plain(line) for line in status_lines(found, time.time())))
