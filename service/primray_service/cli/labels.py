"""Labels of jobs from the command line: `--label name=value`."""

from __future__ import annotations

from typing import Annotated

import typer

from .exits import USAGE, CommandError

Labels = Annotated[
    list[str] | None, typer.Option("--label", "-l", metavar="NAME=VALUE", help="May be repeated.", show_default=False)
]


def labels_of(texts: list[str] | None) -> dict[str, str]:
    labels = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise CommandError("label", f"--label {text}: write name=value", USAGE)
        labels[name] = value
    return labels
