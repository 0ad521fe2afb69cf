"""The automaton says of every path what a plain reading of the expressions says of it, and has no state too many."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from primray.errors import SettingsError
from primray.lpe.automaton import Automaton, build_automaton, build_tables, end_events
from primray.lpe.grammar import (
    CAMERA,
    SCATTERINGS,
    STRAIGHT,
    Alternatives,
    Concatenation,
    Event,
    Events,
    Node,
    Repetition,
    parse_expression,
)

ENDS = end_events(["", "key", "rim"])
R_D, R_G, R_S, T_D, T_G, T_S, T_STRAIGHT, V = range(8)
LIGHT, DOME, OBJECT = range(3)


def ends_at(node: Node, path: list[Event], at: int) -> set[int]:
    """Where `node` may end in `path` that begins at `at`: the expression read by the letter."""
    if isinstance(node, Events):
        return {at + 1} if at < len(path) and node.matches(path[at]) else set()
    if isinstance(node, Concatenation):
        found = {at}
        for part in node.parts:
            found = {end for begin in found for end in ends_at(part, path, begin)}
        return found
    if isinstance(node, Alternatives):
        return {end for part in node.parts for end in ends_at(part, path, at)}
    assert isinstance(node, Repetition)
    reached, now, times = ({at} if node.least == 0 else set()), {at}, 0
    while now and (node.most is None or times < node.most):
        now = {end for begin in now for end in ends_at(node.part, path, begin)}
        times += 1
        if times >= node.least:
            if now <= reached and times > len(path):
                break
            reached |= now
    return reached


def matches(text: str, scatterings: list[int], end: int) -> bool:
    expression = parse_expression(text)
    seen = [SCATTERINGS[k] for k in scatterings if k != STRAIGHT or expression.names_straight]
    path = [CAMERA, *seen, ENDS[end]]
    return len(path) in ends_at(expression.tree, path, 0)


def said(made: Automaton, scatterings: list[int], end: int) -> int:
    state = 0
    for event in scatterings:
        state = made.next[state][event]
    return made.classes[made.ends[state][end]]


def paths(seed: int, count: int) -> Iterator[tuple[list[int], int]]:
    drawn = random.Random(seed)
    for _ in range(count):
        yield [drawn.randrange(len(SCATTERINGS)) for _ in range(drawn.randrange(6))], drawn.randrange(len(ENDS))


def random_text(drawn: random.Random, depth: int = 0) -> str:
    atoms = [".", "D", "G", "R", "T", "V", "s", "[DS]", "[^D]", "<RD>", "<T.>", "<[RT][^G]>", "L", "[LO]", "<L.'key'>", "B"]
    if depth > 2:
        return drawn.choice(atoms)
    text = "".join(
        drawn.choice([drawn.choice(atoms), f"({random_text(drawn, depth + 1)})"]) for _ in range(drawn.randint(1, 3))
    )
    text += drawn.choice(["", "", "*", "+", "?", "{2}", "{1,2}"])
    return f"{text}|{random_text(drawn, depth + 1)}" if drawn.random() < 0.2 else text


def test_it_agrees_with_a_plain_reading_of_random_expressions() -> None:
    drawn = random.Random(4)
    compared = 0
    for seed in range(60):
        texts = [f"C({random_text(drawn)}).*[LOB]", f"C.*({random_text(drawn)})|C.*"]
        try:
            made = build_automaton([parse_expression(text) for text in texts], ENDS)
        except SettingsError:
            continue
        for scatterings, end in paths(seed, 60):
            expected = sum(1 << e for e, text in enumerate(texts) if matches(text, scatterings, end))
            assert said(made, scatterings, end) == expected, (texts, scatterings, end)
            compared += expected not in (0, 2)
    assert compared > 300


@pytest.mark.parametrize(
    ("text", "yes", "no"),
    [
        ("C<RD>L", [([R_D], LIGHT), ([R_D], DOME)], [([], LIGHT), ([R_G], LIGHT), ([R_D, R_D], LIGHT), ([R_D], OBJECT)]),
        ("C.*[LO]", [([], LIGHT), ([V, T_S, R_D], DOME), ([R_G], OBJECT)], []),
        ("CB", [([], DOME)], [([], LIGHT), ([R_D], DOME)]),
        ("C[LO]", [([], LIGHT), ([], OBJECT), ([], DOME)], [([R_D], LIGHT)]),
        ("CD+L", [([R_D, T_D], LIGHT)], [([R_D, V], LIGHT), ([], LIGHT)]),
        ("C<.[^D]>L", [([T_S], LIGHT), ([R_G], LIGHT)], [([V], LIGHT), ([R_D], LIGHT)]),
        ("C.*<L.'key'>", [([R_D], LIGHT + 3)], [([R_D], LIGHT), ([R_D], LIGHT + 6), ([R_D], OBJECT + 3)]),
        ("C.*<L.[^'key']>", [([R_D], LIGHT), ([], LIGHT + 6)], [([R_D], LIGHT + 3)]),
        ("CS{1,2}L", [([R_S], LIGHT), ([R_S, T_S], LIGHT)], [([R_S, R_S, R_S], LIGHT), ([], LIGHT)]),
        ("C(V|T)*L", [([], LIGHT), ([V, T_G], LIGHT)], [([R_G], LIGHT)]),
    ],
)
def test_what_expressions_mean(text: str, yes: list[tuple[list[int], int]], no: list[tuple[list[int], int]]) -> None:
    made = build_automaton([parse_expression(text)], ENDS)
    assert [said(made, *path) for path in yes] == [1] * len(yes)
    assert [said(made, *path) for path in no] == [0] * len(no)


def test_straight_through_is_seen_by_those_that_name_it() -> None:
    made = build_automaton(
        [
            parse_expression("C<RD>L"),
            parse_expression("C<Ts>*<RD>L"),
            parse_expression("C<RD>s*L"),
            parse_expression("C<T.>*<RD>L"),
        ],
        ENDS,
    )
    assert said(made, [R_D], LIGHT) == 0b1111
    assert said(made, [T_STRAIGHT, R_D], LIGHT) == 0b1011
    assert said(made, [R_D, T_STRAIGHT], LIGHT) == 0b1101


def test_states_that_nothing_tells_apart_are_one() -> None:
    assert len(build_automaton([parse_expression("C.*[LO]")], ENDS).next) == 1
    assert len(build_automaton([parse_expression("C(.|..|...)*[LO]"), parse_expression("C.*L|C.*O")], ENDS).next) == 1
    # Before the first scattering, behind it, and behind any other.
    assert len(build_automaton([parse_expression("C<RD>L"), parse_expression("C(<RD>L|<RD>O)")], ENDS).next) == 3


def test_groups_that_nobody_names_share_a_column() -> None:
    made = build_tables(["C.*<L.'b'>"], ["", "a", "b", "c"])
    [of] = made.class_of
    assert made.members[of].tolist() == [0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0]
    assert made.next.shape == (1, len(SCATTERINGS))
