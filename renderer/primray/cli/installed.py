"""Commands added by other packages, such as the render service, through the entry-point group `primray.commands`.

An entry point names a table of name -> ("module:function", one line of help), in a module that imports nothing heavy.
The function's module is imported when its command is used; `--help` shows the lines of the table.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from ..errors import SettingsError
from ..other_formats import SUFFIXES as OTHER_SUFFIXES
from .named_values import naming_values

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
        app.command(name)(found)
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
