"""Hints for a request that does not fit its model: the member or the value that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from primray.errors import did_you_mean

_QUOTED = re.compile(r"'([^']*)'")
_LONGEST = 100  # of a name or a value that is compared


def hint_of(found: Mapping[str, Any], model: type[BaseModel] | None = None) -> str:
    """Return "; did you mean X?" for one of pydantic's errors, or "" where nothing is near.

    An unknown member is compared with those of its own object; one that belongs to another object of the same request is named
    with the path that it belongs to.
    """
    if found["type"] == "extra_forbidden" and model is not None:
        hint = _member(model, [str(part) for part in found["loc"]])
    elif found["type"] in ("literal_error", "enum") and isinstance(found.get("input"), str):
        expected = _QUOTED.findall(str(found.get("ctx", {}).get("expected", "")))
        hint = did_you_mean(found["input"][:_LONGEST], expected)
    else:
        hint = ""
    return f"; {hint}" if hint else ""


def _member(model: type[BaseModel], place: Sequence[str]) -> str:
    *above, name = place
    known = list(_members(model))
    if hint := did_you_mean(name[:_LONGEST], [path[-1] for path in known if path[:-1] == tuple(above)]):
        return hint
    elsewhere = [".".join(path) for path in known if path[-1] == name]
    return f"did you mean {elsewhere[0]}?" if elsewhere else ""


def _members(model: type[BaseModel], above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the paths of all members, those of objects in objects too."""
    for name, field in model.model_fields.items():
        path = (*above, field.alias or name)
        yield path
        for inner in _models(field.annotation):
            yield from _members(inner, path)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)
