"""Tables of the automaton for the core, with a column for each kind of end at each of the scene's light groups."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..errors import LimitError, SettingsError
from .automaton import automaton_of, ends_of
from .events import END_KINDS
from .grammar import parse

MOST_EXPRESSIONS = 32
MOST_GROUPS = 300


@dataclass(frozen=True, eq=False)
class Tables:
    """Arrays of the automaton by which the core classifies paths."""

    next: npt.NDArray[np.uint8]  # (S, events): next state
    class_of: npt.NDArray[np.uint8]  # (S, ends): class; three kinds of end per group
    members: npt.NDArray[np.uint32]  # (classes,): expressions as bits
    expressions: int
    counts_straight: bool

    def ends_at(self, lights: Iterable[int], domes: Iterable[int]) -> list[int]:
        """Return the columns that a scene with lights and domes of these groups uses; emissive surfaces are always possible."""
        found = {END_KINDS.index("O")}
        for kind, groups in (("L", lights), ("LB", domes)):
            found |= {group * len(END_KINDS) + END_KINDS.index(kind) for group in groups}
        return sorted(found)

    def masks(self, ends: Sequence[int]) -> tuple[int, ...]:
        """Return the sets of expressions, as bits, that light from these ends may match together."""
        return tuple(np.unique(self.members[self.class_of[:, ends]]).tolist())


def check(texts: Sequence[str]) -> None:
    """Raise SettingsError if texts are not light path expressions, or too many for one render."""
    tables_of(list(dict.fromkeys(texts)), [""])


def tables_of(texts: Sequence[str], groups: Sequence[str]) -> Tables:
    """Return the tables of these expressions for a scene with these light groups, the first of which is "" (no group).

    SettingsError for invalid or too many expressions; LimitError for too many groups.
    """
    if len(texts) > MOST_EXPRESSIONS:
        sentence = f"{len(texts)} light path expressions are more than the {MOST_EXPRESSIONS} of one render"
        raise SettingsError(sentence, where="aovs", code="light-path")
    if len(groups) > MOST_GROUPS:
        raise LimitError(f"{len(groups) - 1} light groups are more than {MOST_GROUPS - 1}", code="light-groups")
    expressions = [parse(text) for text in texts]
    # Groups that no expression names are treated as no group.
    named = ["", *sorted({label for expression in expressions for label in expression.labels} - {""})]
    made = automaton_of(expressions, ends_of(named))
    column = {label: named.index(label) for label in named}
    columns = [column.get(group, 0) * len(END_KINDS) + kind for group in groups for kind in range(len(END_KINDS))]
    return Tables(
        np.array(made.next, np.uint8),
        np.ascontiguousarray(np.array(made.ends, np.uint8)[:, columns]),
        np.array(made.classes, np.uint32),
        len(expressions),
        any(expression.names_straight for expression in expressions),
    )
