"""The Typer application with all commands of `primray`; commands of other packages are added by `installed`."""

from __future__ import annotations

from typing import Annotated

import typer

from . import output_flags, render_flags, stage_flags
from .command_group import CommandGroup
from .commands import render as render_module
from .commands.compare import compare
from .commands.doctor import doctor
from .commands.estimate import estimate
from .commands.inspect import inspect
from .commands.merge import merge
from .commands.sheet import sheet

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


_named = {
    "typer": typer,
    "stage_flags": stage_flags,
    "render_flags": render_flags,
    "output_flags": output_flags,
}
vars(render_module).update(_named)  # names in its annotations, which it imports only for type checking
app.command()(render_module.render)
app.command()(estimate)
app.command()(merge)
app.command()(inspect)
app.command()(sheet)
app.command()(compare)
app.command()(doctor)
