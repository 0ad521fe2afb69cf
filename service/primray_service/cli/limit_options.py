"""`primray serve --limit name=value`: every field of Limits and Quotas by its name; values such as 4G, 90s, 2h, none."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import Field, fields, replace
from typing import Any

from ..limits import Limits, Quotas
from .exits import USAGE, CommandError

_BYTES = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
_COUNTS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9}
_SECONDS = {"": 1, "S": 1, "M": 60, "H": 3600, "D": 86_400}
_VALUE = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]*)")


def limits_of(texts: Sequence[str]) -> tuple[Limits, Quotas]:
    """Return the limits and quotas from the options; CommandError names the faulty option."""
    changes: dict[str, Any] = {}
    known = _fields()
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not equals or name not in known:
            raise CommandError("limit-option", f"--limit {text}: `primray serve --limits` lists all limits", USAGE)
        changes[name] = _parsed(known[name], value.strip(), f"--limit {text}", "limit-option")
    quotas = {field.name for field in fields(Quotas)}
    return (
        replace(Limits(), **{name: value for name, value in changes.items() if name not in quotas}),
        replace(Quotas(), **{name: value for name, value in changes.items() if name in quotas}),
    )


def quota_of(name: str, text: str) -> float | None:
    """Return the value of a quota that has an option of its own, in the units of --limit; None for no limit."""
    return _parsed(_fields()[name], text.strip(), f"--{name.replace('_', '-')} {text}", "quotas")


def lines() -> list[str]:
    """Return a line for each limit, with its default."""
    of_limits = [f"{field.name:22} {value_text(field, getattr(Limits(), field.name))}" for field in fields(Limits)]
    of_quotas = [f"{field.name:22} {value_text(field, getattr(Quotas(), field.name))}" for field in fields(Quotas)]
    return ["Limits", *of_limits, "", "Quotas of a tenant", *of_quotas]


def value_text(field: Field[Any], value: float | None) -> str:
    """Return a value in the form that the option accepts."""
    if value is None:
        return "none"
    for unit, size in sorted(_units(field.name).items(), key=lambda item: -item[1]):
        if unit and value >= size and value % size == 0:
            return f"{value // size:.0f}{unit if _units(field.name) is _BYTES else unit.lower()}"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _fields() -> dict[str, Field[Any]]:
    return {field.name: field for kind in (Limits, Quotas) for field in fields(kind)}


def _units(name: str) -> dict[str, int]:
    if name.endswith("_bytes") and name != "path_bytes":
        return _BYTES
    # "cpu_s_per_day" and "check_cpu_s" are seconds; "requests_per_s" is a count.
    return (
        _SECONDS if (name.endswith("_s") and not name.endswith("_per_s")) or name in ("cpu_s_per_day", "seconds") else _COUNTS
    )


def _parsed(field: Field[Any], text: str, option: str, code: str) -> float | None:
    kind = str(field.type)
    if text.lower() == "none":
        if "None" in kind:
            return None
        raise CommandError(code, f"{option}: this limit cannot be removed", USAGE)
    match = _VALUE.fullmatch(text)
    units = _units(field.name)
    unit = (match[2].upper().removesuffix("IB") if units is _BYTES else match[2].upper()) if match else ""
    if match is None or unit not in units:
        or_none = ", or none" if "None" in kind else ""
        some = ", ".join(f"2{unit if units is _BYTES else unit.lower()}" for unit in units if unit)
        raise CommandError(code, f"{option}: write a number, such as 2 or {some}{or_none}", USAGE)
    value = float(match[1]) * units[unit]
    if not math.isfinite(value) or ("int" in kind and (value != int(value) or value > 2**62)):
        raise CommandError(code, f"{option}: write a whole number", USAGE)
    return int(value) if "int" in kind else value
