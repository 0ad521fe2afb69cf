"""Light path expressions as text: what can be read, and what is said of what cannot."""

from __future__ import annotations

import pytest

from primray.aovs import is_light_path, requests_of, without_prefix
from primray.errors import SettingsError
from primray.lpe.automaton import MOST_EXPRESSIONS, check_expressions
from primray.lpe.grammar import LONGEST, MOST_REPEATED, parse_expression
from primray.settings import RenderSettings


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "character 1, an event is missing"),
        ("C<RD", "character 2, the < has no >"),
        ("C<RX>L", "character 4, 'X' is not a kind of scattering, which are D G S s"),
        ("C<XD>L", "character 3, 'X' is not a kind of event"),
        ("C<LD>", "character 4, only surfaces (R and T) have a kind of scattering"),
        ("C<RD'floor'>L", "character 5, only lights (L, O, B) have labels"),
        ("C'key'", "character 2, labels are written within an event: <L.'key'>"),
        ("C.*<L.'key>", "character 7, the label's quote does not end"),
        ("C)", "character 2, a ) without its ("),
        ("C(RD", "character 2, the ( has no )"),
        ("C[LO", "character 2, the [ has no ]"),
        ("C[]L", "character 2, brackets hold events"),
        ("C<[]D>L", "character 3, brackets hold letters"),
        ("C.{2", "character 3, the { has no }"),
        ("C.{2,1}L", "character 3, the second number is below the first"),
        ("C.{x}L", "character 3, braces hold a number"),
        (f"C.{{{MOST_REPEATED + 1}}}L", "character 3, nothing can be repeated more than 64 times"),
        ("C|", "character 3, an event is missing"),
        ("*C", "character 1, '*' is no event"),
        ("Cx", "character 2, 'x' is no event; there are C R T V D G S s L O B and ."),
        ("unoccluded;C.*L", "character 1, 'u' is no event"),
        ("(" * 70 + "C", "more than 64 parentheses are open"),
        ("C" + "." * LONGEST, f"has more than {LONGEST} characters"),
    ],
)
def test_what_cannot_be_read_is_said_with_its_place(text: str, why: str) -> None:
    with pytest.raises(SettingsError) as refused:
        parse_expression(text)
    assert refused.value.code == "light-path"
    assert refused.value.where == "aovs"
    assert why in refused.value.message


@pytest.mark.parametrize("text", ["RD", "C", "CC", "CD", "C<VD>L", "CL.", "[^C]L", "C<L.[^'a']><L.>"])
def test_what_no_path_can_match_is_refused(text: str) -> None:
    with pytest.raises(SettingsError) as refused:
        check_expressions([text])
    assert refused.value.code == "light-path"


def test_expressions_that_need_too_much_are_refused() -> None:
    for texts in (["C(.{40}){40}L"], ["C(.{1,60}D){60}L"], [f"C.{{{n}}}L" for n in range(MOST_EXPRESSIONS + 1)]):
        with pytest.raises(SettingsError, match=r"256 states|32 of one"):
            check_expressions(texts)
    check_expressions([f"C.{{{n}}}L" for n in range(MOST_EXPRESSIONS)])


def test_blanks_and_prefixes_are_left_out_but_for_labels() -> None:
    assert without_prefix(" color lpe:C .* <L.'key light'>") == "C.*<L.'key light'>"
    assert parse_expression("LPE: C<RD> L").text == "C<RD>L"
    assert parse_expression("C.*<L.['a' 'b']>").labels == {"a", "b"}
    assert parse_expression("C<Ts>*L").names_straight
    assert not parse_expression("C<T.>*<L.'sun'>").names_straight


def test_which_names_of_outputs_are_meant_for_expressions() -> None:
    assert all(map(is_light_path, ["C<RD>L", "C.*[LO]", "CB", "C*", "CD+L", "lpe:anything"]))
    assert not any(map(is_light_path, ["C", "Ci", "Cs", "crypto_object", "depth", "primvar:C<RD>L", "Color", "CryptoObject"]))
    [found] = requests_of(["lpe: C<RD> L"])
    assert (found.name, found.source) == ("C<RD>L", "lpe:C<RD>L")


def test_settings_refuse_what_is_no_expression() -> None:
    with pytest.raises(SettingsError, match="character 2, the < has no >"):
        RenderSettings(aovs=("C<RD",))
    assert RenderSettings(aovs=("C<RD>L",)).aovs == ("C<RD>L",)
