"""Differences between what pixels were made of and what is there now."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Difference:
    """A difference to what a picture or a data set was made with.

    `kind`: input, setting, version, isa, or pixels; of pinned pictures also attestation, lock, scene and picture (its file).
    """

    kind: str
    what: str  # the file, the key, the package, the prim, or the pixels
    before: Any
    now: Any

    def __str__(self) -> str:
        return f"{self.kind} {self.what}: {_shown(self.before)} when it was made, {_shown(self.now)} now"

    def as_json(self) -> dict[str, Any]:
        return {"kind": self.kind, "what": self.what, "before": self.before, "now": self.now}


def _shown(value: Any) -> str:
    text = "not there" if value is None else value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 70 else f"{text[:67]}..."


def differences_between(kind: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Difference]:
    """Yield what has another value in the second mapping, or is in one of them only."""
    for name in dict.fromkeys([*before, *now]):
        if before.get(name) != now.get(name):
            yield Difference(kind, name, before.get(name), now.get(name))
