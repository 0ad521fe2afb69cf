"""Options of Typer for the flags of commands."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_origin

import typer

from ..settings import RenderSettings, rows
from ..settings.setting import Flag
from .flags import default_of, flags_of, names_of


def with_options(name: str, command: Callable[..., None], of: type = RenderSettings) -> Callable[..., None]:
    """Return a command with the signature that Typer reads: its own parameters, and the flags of settings.

    A parameter that is annotated with an option of its own keeps it; others have the flag of their name, and their own default.
    """
    order = vars(command).get("order")
    if order is None:
        return command
    signature = inspect.signature(command, eval_str=True)
    own = {each.name: each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD}
    flags, defaults = flags_of(of), {row.name: default_of(row) for row in rows(of) if row.flag is not None}

    def parameter(name: str) -> inspect.Parameter:
        if name in own and get_origin(own[name].annotation) is Annotated:
            return own[name].replace(kind=inspect.Parameter.KEYWORD_ONLY)
        flag = flags[name]
        usual = defaults.get(name, False if flag.form is bool else None)
        default = own[name].default if name in own else usual
        return _parameter(name, flag, default, is_usual=default is usual or default == usual)

    def run(**given: Any) -> None:
        command(**given)

    run.__doc__ = command.__doc__
    parameters = [parameter(each) for each in names_of(name, order, list(own), of)]
    vars(run)["__signature__"] = inspect.Signature(parameters)
    return run


def _parameter(name: str, flag: Flag, default: Any, *, is_usual: bool) -> inspect.Parameter:
    form = flag.form | None if default is None else flag.form
    if flag.names:
        shown = flag.shown if is_usual else True
        option = typer.Option(*flag.names, metavar=flag.metavar, help=flag.help, show_default=shown)
    else:
        option = typer.Argument(metavar=flag.metavar, help=flag.help, show_default=flag.shown)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[form, option])
