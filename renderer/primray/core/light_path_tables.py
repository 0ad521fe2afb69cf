"""Light path expressions of a scene's outputs, as a finite automaton for the core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..aovs import AovRequest, light_paths_of
from . import compiled
from .light_upload import LightGroups
from .native import raise_primray_error

if TYPE_CHECKING:
    from ..lpe.automaton import Tables


# Light that reaches a diffuse surface or a medium through specular scattering alone (mirror, glossy or refracted, of any
# roughness). Cycles and Arnold remove the same paths where caustics are off.
CAUSTICS = "C.*[DV][GS]+[LO]"


@dataclass(frozen=True)
class LightPathTables:
    """Light path expressions, in the film's order, compiled for the core."""

    expressions: tuple[str, ...]
    members: tuple[int, ...]  # sets of expressions, as bit masks, that one light path may match together
    automaton: compiled.LpeAutomaton


def light_path_tables(requests: Sequence[AovRequest], groups: LightGroups) -> LightPathTables | None:
    """Return the compiled expressions of the requested outputs; None if no output is an expression."""
    expressions = light_paths_of(requests)
    if not expressions:
        return None
    from ..lpe.automaton import build_tables

    made = build_tables(expressions, groups.names)
    try:
        automaton = _automaton(made)
    except compiled.CoreError as error:
        raise_primray_error(error)
    return LightPathTables(expressions, made.masks(made.ends_at(groups.others, groups.domes)), automaton)


def automaton_without_caustics(expressions: Sequence[str], groups: LightGroups) -> compiled.LpeAutomaton:
    """Return the automaton of these expressions, with caustics removed from them and from the picture."""
    from ..lpe.automaton import build_tables

    made = build_tables((*expressions, CAUSTICS), groups.names)
    try:
        return _automaton(replace(made, expressions=len(expressions)), leaves_out=len(expressions))
    except compiled.CoreError as error:
        raise_primray_error(error)


def _automaton(made: Tables, leaves_out: int = -1) -> compiled.LpeAutomaton:
    """Return the core's automaton; light that matches expression `leaves_out` is not part of the picture."""
    return compiled.LpeAutomaton(
        next=made.next,
        class_of=made.class_of,
        members=made.members,
        expressions=made.expressions,
        counts_straight=made.counts_straight,
        leaves_out=leaves_out,
    )


def missing_groups(tables: LightPathTables, groups: LightGroups) -> list[tuple[str, str, str]]:
    """Return a warning for each light group that an expression names and no light belongs to."""
    from ..lpe.grammar import parse_expression

    named = {
        label: text
        for text in tables.expressions
        for label in sorted(parse_expression(text).labels)
        if label not in groups.names
    }
    return [
        ("light-group", "", f"{text} names the light group {label!r}, which contains no light.")
        for label, text in named.items()
    ]
