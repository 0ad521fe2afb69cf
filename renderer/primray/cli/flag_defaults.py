"""Flags of commands that have a default of their own."""

from __future__ import annotations

from copy import copy
from typing import Any, get_args

from typer.models import OptionInfo


def with_own_default(flag: Any) -> OptionInfo:
    """The option of a flag, with the command's own default in the help."""
    [option] = get_args(flag)[1:]
    own: OptionInfo = copy(option)
    own.show_default = True
    return own
