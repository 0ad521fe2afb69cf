"""The Typer application with all commands of `primray`, including those of other packages.

Other packages, such as the render service, add commands through the entry-point group `primray.commands`. An entry point names
a table of name -> ("module:function", one line of help), in a module that imports nothing heavy. The function's module is
imported when its command is used; `--help` shows the lines of the table. Error messages quote the refused value.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from inspect import Parameter, Signature
from inspect import signature as signature_of
from typing import Annotated, Any, get_origin

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from ..errors import SettingsError
from ..file_formats import SUFFIXES as OTHER_SUFFIXES
from ..settings import RenderSettings, rows
from ..settings.setting import Flag
from .commands.ci import ci
from .commands.compare import compare
from .commands.dataset import dataset
from .commands.doctor import doctor
from .commands.estimate import estimate
from .commands.explain import explain
from .commands.inspect import inspect
from .commands.lidar import lidar
from .commands.measure import measure
from .commands.merge import merge
from .commands.pin import pin
from .commands.relight import relight
from .commands.render import render
from .commands.sensor import sensor
from .commands.sheet import sheet
from .commands.thumbnail import thumbnail
from .commands.verify import verify
from .flags import default_of, flags_of, names_of
from .kept_inputs import keeping_inputs


def with_options(name: str, command: Callable[..., None], of: type = RenderSettings) -> Callable[..., None]:
    """Return a command with the signature that Typer reads: its own parameters, and the flags of settings.

    A parameter that is annotated with an option of its own keeps it; others have the flag of their name, and their own default.
    """
    order = vars(command).get("order")
    if order is None:
        return command
    signature = signature_of(command, eval_str=True)
    own = {each.name: each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD}
    flags, defaults = flags_of(of), {row.name: default_of(row) for row in rows(of) if row.flag is not None}

    def parameter(name: str) -> Parameter:
        if name in own and get_origin(own[name].annotation) is Annotated:
            return own[name].replace(kind=Parameter.KEYWORD_ONLY)
        flag = flags[name]
        usual = defaults.get(name, False if flag.form is bool else None)
        default = own[name].default if name in own else usual
        return _parameter(name, flag, default, is_usual=default is usual or default == usual)

    def run(**given: Any) -> None:
        command(**given)

    run.__doc__ = command.__doc__
    parameters = [parameter(each) for each in names_of(name, order, list(own), of)]
    vars(run)["__signature__"] = Signature(parameters)
    return run


def _parameter(name: str, flag: Flag, default: Any, *, is_usual: bool) -> Parameter:
    form = flag.form | None if default is None else flag.form
    if flag.names:
        shown = flag.shown if is_usual else True
        option = typer.Option(*flag.names, metavar=flag.metavar, help=flag.help, show_default=shown)
    else:
        option = typer.Argument(metavar=flag.metavar, help=flag.help, show_default=flag.shown)
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[form, option])


GROUP = "primray.commands"
STAGES = (".usd", ".usda", ".usdc", ".usdz", *OTHER_SUFFIXES)

Table = Mapping[str, tuple[str, str]]


class LazyCommand(TyperCommand):
    """Placeholder of a command in lists, replaced by the command when it is run."""

    def __init__(self, name: str, target: str, help: str) -> None:
        super().__init__(name, help=help)
        self.target = target

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        return loaded(str(self.name), self.target).make_context(info_name, args, parent=parent, **extra)


def loaded(name: str, target: str) -> Any:
    """Return the command of "module:function", or of "module:app" for a command with subcommands."""
    module, _, attribute = target.partition(":")
    found = getattr(import_module(module), attribute)
    if not isinstance(found, typer.Typer):
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        app.command(name)(keeping_inputs(with_options(name, found)))
        found = app
    return naming_values(get_command(found))


class CommandGroup(TyperGroup):
    """Primray's own commands followed by those of other packages, which are looked up only when needed."""

    _is_complete = False

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self.commands:
            self._complete()
        return naming_values(super().get_command(ctx, cmd_name))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        word = args[0] if args else ""
        if word.lower().endswith(STAGES) and self.get_command(ctx, word) is None:
            sentence = f"{word} is a file, not a command: use `primray render {shlex.quote(word)}`"
            raise SettingsError(sentence, code="command")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        self._complete()
        return super().list_commands(ctx)

    def _complete(self) -> None:
        if not self._is_complete:
            self._is_complete = True
            for name, (target, help) in installed().items():
                self.commands.setdefault(name, LazyCommand(name, target, help))


def installed() -> dict[str, tuple[str, str]]:
    """Return the merged command tables of all packages; the first package that has a name wins."""
    from importlib.metadata import entry_points

    commands: dict[str, tuple[str, str]] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        table: Table = entry.load()
        for name, command in table.items():
            commands.setdefault(name, command)
    return commands


_WANTED = re.compile(r"valid (integer|number|float)")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_WITH_UNIT = re.compile(rf"({_NUMBER})\s*([A-Za-z%]+)")
_FACTORS = {"%": 0.01, "k": 1e3, "K": 1e3, "M": 1e6}  # for the suggested value; other units have factor 1


def naming_values(command: Any) -> Any:
    """Return the command, or the group with its commands, with options whose errors quote the refused value."""
    for inner in getattr(command, "commands", {}).values():
        naming_values(inner)
    for param in getattr(command, "params", ()):
        if not isinstance(param.process_value, partial):
            param.process_value = partial(_process, param, param.process_value)
    return command


def _process(param: Any, process: Callable[[Any, Any], Any], ctx: Any, value: Any) -> Any:
    try:
        return process(ctx, value)
    except typer.BadParameter as error:
        typed = [value] if isinstance(value, str) else [*value] if isinstance(value, list | tuple) else []
        if typed and all(isinstance(word, str) for word in typed):
            error.message = _sentence(error.message, typed, param)
        raise


def _sentence(message: str, typed: list[str], param: Any) -> str:
    wanted = _WANTED.search(message)
    if wanted is None:
        shown = " ".join(typed)
        return message if shown in message else f"{shown!r}: {message}"
    is_whole = wanted[1] == "integer"
    bad = next((word for word in typed if not _is_number(word, is_whole)), typed[0])
    form = "a whole number" if is_whole else "a number"
    sentence = f"{bad!r} is not {form}"
    if len(typed) > 1 and param.nargs > 1:
        return f"{sentence}; expected {param.nargs} numbers: {param.metavar}"
    with_unit = _WITH_UNIT.fullmatch(bad)
    if with_unit is not None and _is_number(with_unit[1], is_whole):
        meant = float(with_unit[1]) * _FACTORS.get(with_unit[2], 1)
        return f"{sentence}: write it without a unit, such as {meant:.12g}"
    return f"{sentence}, such as {64 if is_whole else 0.5}"


def _is_number(text: str, is_whole: bool) -> bool:
    try:
        int(text) if is_whole else float(text)
    except ValueError:
        return False
    return True


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
    "explain": explain,
    "merge": merge,
    "inspect": inspect,
    "sheet": sheet,
    "thumbnail": thumbnail,
    "dataset": dataset,
    "compare": compare,
    "pin": pin,
    "verify": verify,
    "relight": relight,
    "sensor": sensor,
    "lidar": lidar,
    "measure": measure,
    "ci": ci,
    "doctor": doctor,
}
for _name, _command in _COMMANDS.items():
    app.command(_name)(keeping_inputs(with_options(_name, _command)))
