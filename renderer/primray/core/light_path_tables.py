"""Light path expressions of a scene's outputs, as tables of a finite automaton for the core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..aovs import AovRequest, light_paths_of
from .light_upload import LightGroups
from .native import module, raise_primray_error

if TYPE_CHECKING:
    from ..lpe.automaton import Tables


# Light that reaches a diffuse surface or a medium through specular scattering alone (mirror, glossy or refracted, of any
# roughness). Cycles and Arnold remove the same paths where caustics are off.
CAUSTICS = "C.*[DV][GS]+[LO]"


@dataclass(frozen=True)
class Routes:
    """Light path expressions, in the film's order, compiled for the core."""

    expressions: tuple[str, ...]
    members: tuple[int, ...]  # sets of expressions, as bit masks, that one light path may match together
    tables: Any  # the core's RouteTables


def routes_of(requests: Sequence[AovRequest], groups: LightGroups) -> Routes | None:
    """Return the compiled expressions of the requested outputs; None if no output is an expression."""
    expressions = light_paths_of(requests)
    if not expressions:
        return None
    from ..lpe.automaton import build_tables

    made = build_tables(expressions, groups.names)
    try:
        tables = _tables(made)
    except module().CoreError as error:
        raise_primray_error(error)
    return Routes(expressions, made.masks(made.ends_at(groups.others, groups.domes)), tables)


def tables_without_caustics(expressions: Sequence[str], groups: LightGroups) -> Any:
    """Return the core's tables of these expressions, with caustics removed from them and from the picture."""
    from ..lpe.automaton import build_tables

    made = build_tables((*expressions, CAUSTICS), groups.names)
    try:
        return _tables(replace(made, expressions=len(expressions)), leaves_out=len(expressions))
    except module().CoreError as error:
        raise_primray_error(error)


def _tables(made: Tables, leaves_out: int = -1) -> Any:
    """Return the core's tables; light that matches expression `leaves_out` is not part of the picture."""
    return module().RouteTables(
        next=made.next,
        class_of=made.class_of,
        members=made.members,
        expressions=made.expressions,
        counts_straight=made.counts_straight,
        leaves_out=leaves_out,
    )


def missing_groups(routes: Routes, groups: LightGroups) -> list[tuple[str, str, str]]:
    """Return a warning for each light group that an expression names and no light belongs to."""
    from ..lpe.grammar import parse_expression

    named = {
        label: text
        for text in routes.expressions
        for label in sorted(parse_expression(text).labels)
        if label not in groups.names
    }
    return [
        ("light-group", "", f"{text} names the light group {label!r}, which contains no light.")
        for label, text in named.items()
    ]
