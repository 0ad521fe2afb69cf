"""Light path expressions to one minimal deterministic automaton, and its tables for the core.

Each expression becomes a nondeterministic automaton (Thompson 1968); the subset construction joins all of them, and equivalent
states are merged (Moore 1956). The tables have a column for each kind of end at each of the scene's light groups.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..errors import LimitError, SettingsError
from .grammar import (
    CAMERA,
    END_KINDS,
    SCATTERINGS,
    STRAIGHT,
    Alternatives,
    Concatenation,
    Event,
    Events,
    Expression,
    Node,
    Repetition,
    parse_expression,
)

MOST_PLACES, MOST_SETS, MOST_STATES = 4096, 4096, 256

Places = frozenset[int]
State = tuple[Places, ...]  # places of each expression's automaton


@dataclass(frozen=True)
class Automaton:
    """Transition tables; paths begin in state 0, after the camera. `classes` are sets of matching expressions, as bits."""

    next: list[list[int]]  # next state by state and scattering
    ends: list[list[int]]  # class by state and end
    classes: list[int]


def end_events(labels: Sequence[str]) -> list[Event]:
    """Return the events that end paths: each kind of end, at lights of each of these groups."""
    return [Event(kind, label=label) for label in labels for kind in END_KINDS]


def build_automaton(expressions: Sequence[Expression], ends: Sequence[Event]) -> Automaton:
    """Return the automaton of all expressions; SettingsError if it is too large, or no path can match an expression."""
    machines = [_Machine(expression) for expression in expressions]
    start: State = tuple(m.after(m.start, CAMERA) for m in machines)
    number = {start: 0}
    states, rows, classes = [start], list[list[int]](), [0]
    outs: list[list[int]] = []
    for state in states:  # grows in the loop
        row = []
        for k, event in enumerate(SCATTERINGS):
            to = tuple(
                places if k == STRAIGHT and not m.expression.names_straight else m.after(places, event)
                for m, places in zip(machines, state, strict=True)
            )
            if to not in number:
                number[to] = len(states)
                states.append(to)
                if len(states) > MOST_SETS:
                    raise _too_large(expressions)
            row.append(number[to])
        rows.append(row)
        masks = [_mask(machines, state, end) for end in ends]
        classes += [mask for mask in dict.fromkeys(masks) if mask not in classes]
        outs.append([classes.index(mask) for mask in masks])
    for e, expression in enumerate(expressions):
        if not any(mask >> e & 1 for mask in classes):
            why = "matches no path: these begin at the camera (C) and end at a light (L), emission (O) or the background (B)"
            raise SettingsError(f"the light path expression {expression.text} {why}", where="aovs", code="light-path")
    rows, outs = _minimal(rows, outs)
    if len(rows) > MOST_STATES or len(classes) > MOST_STATES:
        raise _too_large(expressions)
    return Automaton(rows, outs, classes)


def _mask(machines: Sequence[_Machine], state: State, end: Event) -> int:
    return sum(1 << e for e, (m, places) in enumerate(zip(machines, state, strict=True)) if m.accepts(places, end))


def _too_large(expressions: Sequence[Expression]) -> SettingsError:
    texts = " ".join(expression.text for expression in expressions)[:200]
    sentence = (
        f"the light path expressions {texts} need more than {MOST_STATES} states together: ask for fewer, or simpler ones"
    )
    return SettingsError(sentence, where="aovs", code="light-path")


def _minimal(rows: list[list[int]], outs: list[list[int]]) -> tuple[list[list[int]], list[list[int]]]:
    """Merge equivalent states, numbered by the first of each."""
    of = _numbered([tuple(out) for out in outs])
    while True:
        finer = _numbered([(of[s], *(of[to] for to in row)) for s, row in enumerate(rows)])
        if max(finer) == max(of):
            break
        of = finer
    first = [of.index(k) for k in range(max(of) + 1)]
    return [[of[to] for to in rows[s]] for s in first], [outs[s] for s in first]


def _numbered(keys: Sequence[object]) -> list[int]:
    number: dict[object, int] = {}
    return [number.setdefault(key, len(number)) for key in keys]


class _Machine:
    """Nondeterministic automaton of one expression: places, and transitions by events or without one."""

    def __init__(self, expression: Expression) -> None:
        self.expression = expression
        self._by: list[list[tuple[Events, int]]] = []
        self._free: list[list[int]] = []
        first = self._place()
        self._last = self._add(expression.tree, first)
        self.start = self._closed({first})
        self._known: dict[tuple[Places, Event], Places] = {}

    def after(self, places: Places, event: Event) -> Places:
        if (places, event) not in self._known:
            found = {to for place in places for events, to in self._by[place] if events.matches(event)}
            self._known[places, event] = self._closed(found)
        return self._known[places, event]

    def accepts(self, places: Places, end: Event) -> bool:
        return self._last in self.after(places, end)

    def _place(self) -> int:
        self._by.append([])
        self._free.append([])
        if len(self._by) > MOST_PLACES:
            raise _too_large([self.expression])
        return len(self._by) - 1

    def _add(self, node: Node, at: int) -> int:
        """Add `node`, which begins at the place `at`; return the place after it."""
        if isinstance(node, Events):
            end = self._place()
            self._by[at].append((node, end))
            return end
        if isinstance(node, Concatenation):
            for part in node.parts:
                at = self._add(part, at)
            return at
        if isinstance(node, Alternatives):
            end = self._place()
            for part in node.parts:
                begin = self._place()
                self._free[at].append(begin)
                self._free[self._add(part, begin)].append(end)
            return end
        return self._add_repeated(node, at)

    def _add_repeated(self, node: Repetition, at: int) -> int:
        for _ in range(node.least):
            at = self._add(node.part, at)
        end = self._place()
        if node.most is None:
            again = self._place()
            self._free[at].append(again)
            self._free[self._add(node.part, again)].append(again)
            self._free[again].append(end)
            return end
        for _ in range(node.most - node.least):
            self._free[at].append(end)
            at = self._add(node.part, at)
        self._free[at].append(end)
        return end

    def _closed(self, places: set[int]) -> Places:
        found, left = set(places), list(places)
        while left:
            for to in self._free[left.pop()]:
                if to not in found:
                    found.add(to)
                    left.append(to)
        return frozenset(found)


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


def check_expressions(texts: Sequence[str]) -> None:
    """Raise SettingsError if texts are not light path expressions, or too many for one render."""
    build_tables(list(dict.fromkeys(texts)), [""])


def build_tables(texts: Sequence[str], groups: Sequence[str]) -> Tables:
    """Return the tables of these expressions for a scene with these light groups, the first of which is "" (no group).

    SettingsError for invalid or too many expressions; LimitError for too many groups.
    """
    if len(texts) > MOST_EXPRESSIONS:
        sentence = f"{len(texts)} light path expressions are more than the {MOST_EXPRESSIONS} of one render"
        raise SettingsError(sentence, where="aovs", code="light-path")
    if len(groups) > MOST_GROUPS:
        raise LimitError(f"{len(groups) - 1} light groups are more than {MOST_GROUPS - 1}", code="light-groups")
    expressions = [parse_expression(text) for text in texts]
    # Groups that no expression names are treated as no group.
    named = ["", *sorted({label for expression in expressions for label in expression.labels} - {""})]
    made = build_automaton(expressions, end_events(named))
    column = {label: named.index(label) for label in named}
    columns = [column.get(group, 0) * len(END_KINDS) + kind for group in groups for kind in range(len(END_KINDS))]
    return Tables(
        np.array(made.next, np.uint8),
        np.ascontiguousarray(np.array(made.ends, np.uint8)[:, columns]),
        np.array(made.classes, np.uint32),
        len(expressions),
        any(expression.names_straight for expression in expressions),
    )
