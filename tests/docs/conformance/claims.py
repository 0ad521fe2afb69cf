"""What tests claim about docs/conformance.md, by their mark `conforms`; see conformance.py."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class Proof:
    """A test's claim about a row."""

    row: str
    state: str
    file: str  # relative to the root
    test: str  # without parameters


CLAIMS = pytest.StashKey[list[Proof]]()  # where a run of all tests keeps what they claim


def proofs_of(items: Iterable[pytest.Item]) -> list[Proof]:
    """The claims of collected tests, each once however many parameters it has."""
    found: dict[Proof, None] = {}
    for item in items:
        for mark in item.iter_markers("conforms"):
            state = mark.kwargs.get("state", "honoured")
            file = Path(item.path).relative_to(ROOT).as_posix()
            for row in mark.args:
                found.setdefault(Proof(row, state, file, item.name.partition("[")[0]))
    return list(found)
