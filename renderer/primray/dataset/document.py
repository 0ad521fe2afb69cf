"""A YAML document with the place of each value, for errors that name line and key; Python's own dicts and lists alike.

Keys that are unknown, twice there or missing are refused, and so are values of another kind.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import SettingsError, did_you_mean

CODE = "dataset-config"
MOST_LEVELS, MOST_VALUES = 64, 1_000_000


@dataclass(frozen=True)
class Entry:
    """A value of a document. `value`: a scalar, or Entries in a list or by key. `key`: its place, as in "vary.lamp.to"."""

    value: Any
    key: str
    file: str
    line: int | None

    @property
    def where(self) -> str:
        """File, line and key, as far as they are known."""
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return ": ".join(part for part in (place, self.key) if part)

    def fault(self, message: str) -> SettingsError:
        return SettingsError(message, where=self.where, code=CODE)

    @property
    def plain(self) -> Any:
        """The value without places."""
        if isinstance(self.value, dict):
            return {key: entry.plain for key, entry in self.value.items()}
        return [entry.plain for entry in self.value] if isinstance(self.value, list) else self.value

    def items(self) -> Mapping[str, Entry]:
        if not isinstance(self.value, dict):
            raise self.fault(f"it must have keys and values, not {_said(self.value)}")
        return self.value

    def fields(self, required: Sequence[str] = (), optional: Sequence[str] = ()) -> Mapping[str, Entry]:
        """Return the values by key; refuse other keys than these, and a required one that is missing."""
        found, known = self.items(), (*required, *optional)
        for name, entry in found.items():
            if name not in known:
                raise entry.fault(f"unknown key {name!r}; {did_you_mean(name, known, f'the keys are {_listed(known)}')}")
        for name in required:
            if name not in found:
                raise self.fault(f"the key {name!r} is missing")
        return found

    def entries(self) -> list[Entry]:
        """Return the values of a list; one that is no list is a list of it."""
        return self.value if isinstance(self.value, list) else [self]

    def text(self) -> str:
        if not isinstance(self.value, str):
            raise self.fault(f"it must be text, not {_said(self.value)}")
        return self.value

    def texts(self) -> list[str]:
        found = [entry.text() for entry in self.entries()]
        if not found:
            raise self.fault("the list is empty")
        return found

    def one_of(self, names: Sequence[str]) -> str:
        name = self.text()
        if name not in names:
            raise self.fault(f"{name!r} is not known; {did_you_mean(name, names, f'it is one of {_listed(names)}')}")
        return name

    def number(self, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number in a range; YAML 1.1 reads 1e3 as text, which is a number here."""
        found = self.value
        if isinstance(found, str):
            try:
                found = float(found)
            except ValueError:
                raise self.fault(f"it must be a number, not {_said(found)}") from None
        if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
            raise self.fault(f"it must be a number, not {_said(self.value)}")
        if not low <= found <= high:
            raise self.fault(f"{found:g} is not {_range(low, high)}")
        return float(found)

    def whole(self, low: int = -(2**63), high: int = 2**63 - 1) -> int:
        if isinstance(self.value, bool) or not isinstance(self.value, int):
            raise self.fault(f"it must be a whole number, not {_said(self.value)}")
        if not low <= self.value <= high:
            raise self.fault(f"{self.value} is not {_range(low, high)}")
        return self.value

    def flag(self) -> bool:
        if not isinstance(self.value, bool):
            raise self.fault(f"it must be true or false, not {_said(self.value)}")
        return self.value

    def numbers(self, count: int) -> tuple[float, ...]:
        found = self.entries()
        if not isinstance(self.value, list) or len(found) != count:
            raise self.fault(f"it must be a list of {count} numbers, not {_said(self.plain)}")
        return tuple(entry.number() for entry in found)


def _range(low: float, high: float) -> str:
    if math.isinf(high) or high >= 2**62:
        return f"{low:g} or more"
    return f"{high:g} or less" if math.isinf(low) or low <= -(2**62) else f"from {low:g} to {high:g}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))


def _said(value: Any) -> str:
    if isinstance(value, dict):
        return "keys and values"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "nothing" if value is None else repr(value)


def read_text(path: Path) -> str:
    """Return a file's text; SettingsError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
        raise SettingsError(f"it cannot be read: {reason}", where=str(path), code=CODE) from None


def document_of_text(text: str, file: str) -> Entry:
    """Return the document of a YAML text; SettingsError, with its line, where it is none."""
    try:
        import yaml
    except ImportError:
        raise SettingsError(
            "reading YAML needs PyYAML: pip install 'primray[dataset]'", where=file, code="dataset-missing"
        ) from None

    loader = yaml.SafeLoader(text)
    try:
        root = loader.get_single_node()
        if root is None:
            raise SettingsError("the document is empty", where=file, code=CODE)
        return _Reading(loader, file).entry(root, "")
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = file if mark is None else f"{file}:{mark.line + 1}"
        raise SettingsError(f"it is no YAML: {getattr(error, 'problem', error)}", where=place, code=CODE) from None
    finally:
        loader.dispose()


class _Reading:
    """Makes entries of the nodes of one document; aliases of one anchor are as many values as they are written."""

    def __init__(self, loader: Any, file: str) -> None:
        self._loader, self._file = loader, file
        self._values = 0
        self._depth = 0

    def entry(self, node: Any, key: str) -> Entry:
        line = node.start_mark.line + 1
        self._values += 1
        # An anchor that holds an alias of itself never ends; some that hold each other are more than any memory has.
        if self._depth == MOST_LEVELS or self._values > MOST_VALUES:
            what = f"{MOST_LEVELS} levels" if self._depth == MOST_LEVELS else f"{MOST_VALUES} values"
            raise Entry(None, "", self._file, line).fault(f"there are more than {what}; an alias (*) may hold itself")
        self._depth += 1
        found = Entry(self._value(node, key), key, self._file, line)
        self._depth -= 1
        return found

    def _value(self, node: Any, key: str) -> Any:
        import yaml

        if isinstance(node, yaml.MappingNode):
            return self._fields(node, key)
        if isinstance(node, yaml.SequenceNode):
            return [self.entry(each, f"{key}[{k}]") for k, each in enumerate(node.value)]
        value = self._loader.construct_object(node, deep=True)
        # A date, which YAML 1.1 makes of 2026-01-01, is text.
        return value if isinstance(value, str | bool | int | float | None) else node.value

    def _fields(self, node: Any, key: str) -> dict[str, Entry]:
        import yaml

        found: dict[str, Entry] = {}
        for name_node, value_node in node.value:
            name = name_node.value if isinstance(name_node, yaml.ScalarNode) else ""
            place = Entry(name, _joined(key, name), self._file, name_node.start_mark.line + 1)
            if not name:
                raise place.fault("a key must be text")
            if name in found:
                raise place.fault(f"the key {name!r} is there twice, first in line {found[name].line}")
            made = self.entry(value_node, place.key)
            found[name] = Entry(made.value, made.key, self._file, place.line)
        return found


def document_of_values(values: Any, name: str = "config", key: str = "") -> Entry:
    """Return the document of Python's own values."""
    if isinstance(values, Mapping):
        return Entry({str(k): document_of_values(v, name, _joined(key, str(k))) for k, v in values.items()}, key, name, None)
    if isinstance(values, list | tuple):
        items = [document_of_values(each, name, f"{key}[{k}]") for k, each in enumerate(values)]
        return Entry(items, key, name, None)
    if hasattr(values, "tolist"):  # NumPy's scalars and arrays
        return document_of_values(values.tolist(), name, key)
    if isinstance(values, Path):
        return Entry(str(values), key, name, None)
    return Entry(values, key, name, None)


def _joined(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def differing_keys(one: Any, other: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the places at which two plain documents differ, in order, with both values (None: not there)."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in [*one, *(name for name in other if name not in one)]:
            yield from differing_keys(one.get(name), other.get(name), _joined(key, name))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from differing_keys(a, b, f"{key}[{k}]")
    elif one != other or type(one) is not type(other):
        yield key, one, other
