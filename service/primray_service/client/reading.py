"""Conversion of JSON into dataclasses by their fields' types. Unknown members are dropped; missing ones take their default.

A field with the metadata REST receives all members that have no field.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Hashable, Mapping
from contextlib import suppress
from datetime import datetime
from functools import cache
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from .errors import UnexpectedAnswer

T = TypeVar("T")


REST = {"rest": True}


def read(kind: type[T], document: Any, where: str = "") -> T:
    """Return a `kind`; UnexpectedAnswer names the member that does not fit."""
    place = where or kind.__name__
    if not isinstance(document, Mapping):
        raise UnexpectedAnswer(f"{place} is not a JSON object")
    hints = _hints(cast(Hashable, kind))
    values: dict[str, Any] = {}
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    for field in fields:
        name = field.name
        if field.metadata.get("rest"):
            values[name] = {other: document[other] for other in document if all(other != each.name for each in fields)}
        elif name in document:
            values[name] = _value(hints[name], document[name], f"{place}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise UnexpectedAnswer(f"{place} has no {name}")
    return kind(**values)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _value(hint: Any, value: Any, where: str) -> Any:
    if hint is Any:
        return value
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        *others, last = (argument for argument in arguments if argument is not type(None))
        for other in others:
            with suppress(UnexpectedAnswer):
                return _value(other, value, where)
        return _value(last, value, where)
    if dataclasses.is_dataclass(hint):
        return read(hint, value, where)  # type: ignore[arg-type]
    if origin is list and isinstance(value, list):
        return [_value(arguments[0], item, f"{where}[{place}]") for place, item in enumerate(value)]
    if origin is tuple and isinstance(value, list) and len(value) == len(arguments):
        return tuple(_value(inner, item, where) for inner, item in zip(arguments, value, strict=True))
    if origin is dict and isinstance(value, dict):
        return {str(name): _value(arguments[1], inner, f"{where}.{name}") for name, inner in value.items()}
    if hint is datetime and isinstance(value, str):
        return _time(value, where)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(hint, type) and origin is None and isinstance(value, hint) and (hint is bool or not isinstance(value, bool)):
        return value
    raise UnexpectedAnswer(f"{where} is not what this client expects ({getattr(hint, '__name__', hint)})")


def _time(text: str, where: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise UnexpectedAnswer(f"{where} is not a time") from None
