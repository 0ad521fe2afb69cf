"""Signatures that name every field of RenderSettings, for help(), completion and `inspect`.

Type checkers read the same names from SettingsValues.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, signature
from typing import TypeVar

from ..settings import RenderSettings

Function = TypeVar("Function", bound=Callable[..., object])


def naming_settings(function: Function) -> Function:
    """Return the function with its `**values` spelled out in its signature."""
    own = signature(function)
    kept = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    fields = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in signature(RenderSettings).parameters.values()]
    function.__signature__ = own.replace(parameters=[*kept, *fields])  # type: ignore[attr-defined]
    return function
