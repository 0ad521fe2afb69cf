"""Readers that convert what users pass for a setting to its stored form, or refuse it with the setting's name.

Strings become enum members, lists and arrays tuples, NumPy's numbers Python's, prims and Sdf.Paths paths. Only the form is
checked here; settings/ checks values.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from typing import Any, TypeVar

from .errors import SettingsError

Reader = Callable[[str, Any], Any]  # (the setting's name, the value passed) -> the value stored

SomeEnum = TypeVar("SomeEnum", bound=Enum)


def refused(name: str, wanted: str, value: object) -> SettingsError:
    shown = repr(value)
    return SettingsError(f"{name} must be {wanted}, not {shown if len(shown) <= 80 else f'{shown[:77]}...'}", where=name)


def optional(read: Reader) -> Reader:
    return lambda name, value: None if value is None else read(name, value)


def whole(name: str, value: Any) -> int:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise refused(name, "a whole number", value)
    return value


def number(name: str, value: Any) -> float:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refused(name, "a number", value)
    return value


def yes_or_no(name: str, value: Any) -> bool:
    value = _plain(value)
    if not isinstance(value, bool):
        raise refused(name, "True or False", value)
    return value


def text(name: str, value: Any) -> str:
    """Return a string; prims, Sdf.Paths and pathlib.Paths are converted."""
    if hasattr(value, "GetPath"):
        value = value.GetPath()
    value = getattr(value, "pathString", value)
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if not isinstance(value, str):
        raise refused(name, "a string", value)
    return str(value)


def texts(name: str, value: Any) -> tuple[str, ...]:
    return tuple(text(name, item) for item in _items(name, "strings", value))


def pair(name: str, value: Any) -> tuple[int, int]:
    items = _items(name, "two whole numbers", value)
    if len(items) != 2:
        raise refused(name, "two whole numbers", value)
    return whole(name, items[0]), whole(name, items[1])


def two_numbers(name: str, value: Any) -> tuple[float, float]:
    items = _items(name, "two numbers", value)
    if len(items) != 2:
        raise refused(name, "two numbers", value)
    return number(name, items[0]), number(name, items[1])


def four_numbers(name: str, value: Any) -> tuple[float, float, float, float]:
    items = _items(name, "four numbers", value)
    if len(items) != 4:
        raise refused(name, "four numbers", value)
    left, bottom, right, top = (number(name, item) for item in items)
    return left, bottom, right, top


def choice(kinds: type[SomeEnum]) -> Callable[[str, Any], SomeEnum]:
    def read(name: str, value: Any) -> SomeEnum:
        try:
            return kinds(value)
        except ValueError:
            known = ", ".join(repr(kind.value) for kind in kinds)
            raise refused(name, f"one of {known}", value) from None

    return read


def _plain(value: Any) -> Any:
    """Return a NumPy scalar as a Python number; other values unchanged."""
    return value.item() if getattr(value, "shape", None) == () and hasattr(value, "item") else value


def _items(name: str, wanted: str, value: Any) -> list[Any]:
    """Return the items of a list; a string is not taken for a list of its characters."""
    if isinstance(value, str):
        raise refused(name, f"a list of {wanted}", value)
    if isinstance(value, Mapping | bytes) or not isinstance(value, Iterable):
        raise refused(name, f"a list of {wanted}", value)
    return sorted(value) if isinstance(value, set | frozenset) else list(value)
