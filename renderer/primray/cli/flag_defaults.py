"""Flags for commands that have their own default."""

from __future__ import annotations

from copy import copy
from typing import Any, get_args

from typer.models import OptionInfo


def with_own_default(flag: Any) -> OptionInfo:
    """Return the option of a flag, showing the command's own default in the help."""
    [option] = get_args(flag)[1:]
    own: OptionInfo = copy(option)
    own.show_default = True
    return own
