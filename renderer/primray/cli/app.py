"""The Typer application with all commands of `primray`; commands of other packages are added by `installed`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from .command_group import CommandGroup
from .commands.compare import compare
from .commands.doctor import doctor
from .commands.estimate import estimate
from .commands.inspect import inspect
from .commands.merge import merge
from .commands.render import render
from .commands.sheet import sheet
from .typer_options import with_options

app = typer.Typer(
    cls=CommandGroup,
    help="Render USD stages on CPUs.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(asked: bool) -> None:
    if asked:
        from ..report.report import package_versions

        versions = package_versions()
        print(f"primray {versions['primray']}")
        print(f"embree {versions['embree']}, usd {versions['usd']}, python {versions['python']}")
        raise typer.Exit


@app.callback()
def primray(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print versions and exit.")
    ] = False,
) -> None:
    """Render USD stages on CPUs."""


_COMMANDS: dict[str, Callable[..., None]] = {
    "render": render,
    "estimate": estimate,
    "merge": merge,
    "inspect": inspect,
    "sheet": sheet,
    "compare": compare,
    "doctor": doctor,
}
for _name, _command in _COMMANDS.items():
    app.command(_name)(with_options(_name, _command))
