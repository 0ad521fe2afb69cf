"""Parser of light path expressions (the grammar of Open Shading Language): text to a tree, and the events that it matches.

    alternatives  one|other            a path takes either
    events        C R T V D G S s L O B .   <RD> <[RT]G> <L.'key'>   [LO] [^D]
    repeated      * + ? {2} {1,3} {2,}
    grouped       (...)

Blanks outside of quotes are ignored. The letters are Open Shading Language's, to which UsdRender refers: camera C;
reflection R, transmission T or volume scattering V; diffuse D, glossy G, singular S or straight s; light L, emissive object O,
background B. A dome is both L and B.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from ..aovs import without_prefix
from ..errors import SettingsError

WAYS, LOBES, ENDS = "RTV", "DGSs", "LOB"


@dataclass(frozen=True)
class Event:
    kinds: str  # any of these letters matches it
    lobe: str = ""  # letter of scattering at surfaces
    label: str = ""  # a light's group


CAMERA = Event("C")
# In the core's order (lpe/automaton.hpp).
SCATTERINGS = (*(Event(way, lobe) for way in "RT" for lobe in "DGS"), Event("T", "s"), Event("V"))
STRAIGHT = SCATTERINGS.index(Event("T", "s"))
END_KINDS = ("L", "LB", "O")


@dataclass(frozen=True)
class Choice:
    """A set of letters or labels, or its complement."""

    of: frozenset[str]
    is_negated: bool = False

    def takes(self, values: str | tuple[str, ...]) -> bool:
        return any(value in self.of for value in values) != self.is_negated


@dataclass(frozen=True)
class Pattern:
    """Pattern of one event; None matches anything."""

    kind: Choice | None = None
    lobe: Choice | None = None
    label: Choice | None = None

    def matches(self, event: Event) -> bool:
        return (
            (self.kind is None or self.kind.takes(event.kinds))
            and (self.lobe is None or (event.lobe != "" and self.lobe.takes(event.lobe)))
            and (self.label is None or self.label.takes((event.label,)))
        )


@dataclass(frozen=True)
class Events:
    """Events that match any of the patterns or, negated, none of them."""

    patterns: tuple[Pattern, ...]
    is_negated: bool = False

    def matches(self, event: Event) -> bool:
        return any(pattern.matches(event) for pattern in self.patterns) != self.is_negated


ANY = Pattern()


def pattern_of(letter: str) -> Pattern:
    """Return the pattern of a single letter."""
    if letter == ".":
        return ANY
    chosen = Choice(frozenset(letter))
    return Pattern(lobe=chosen) if letter in LOBES else Pattern(kind=chosen)


LETTERS = "C" + WAYS + LOBES + ENDS
LONGEST = 1024  # characters
MOST_REPEATED = 64
DEEPEST = 64  # parentheses within another


@dataclass(frozen=True)
class Concatenation:
    parts: tuple[Node, ...]


@dataclass(frozen=True)
class Alternatives:
    parts: tuple[Node, ...]


@dataclass(frozen=True)
class Repetition:
    part: Node
    least: int
    most: int | None


Node = Events | Concatenation | Alternatives | Repetition


@dataclass(frozen=True)
class Expression:
    text: str  # without blanks and prefix
    tree: Node
    labels: frozenset[str]  # light groups that it names
    names_straight: bool  # it names straight transmission (s); otherwise those events are skipped


def parse_expression(text: str) -> Expression:
    """Parse an expression; SettingsError with the position of the fault."""
    plain = without_prefix(text)
    if len(plain) > LONGEST:
        raise _error(plain[:40] + "...", f"has more than {LONGEST} characters")
    reader = _Reader(plain)
    tree = reader.alternatives(0)
    if reader.here() is not None:
        reader.fail("a ) without its (" if reader.here() == ")" else f"{reader.here()!r} is unexpected")
    return Expression(plain, tree, frozenset(reader.labels), reader.names_straight)


def _error(text: str, why: str) -> SettingsError:
    return SettingsError(f"the light path expression {text} {why}", where="aovs", code="light-path")


class _Reader:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self.labels: set[str] = set()
        self.names_straight = False

    def here(self) -> str | None:
        return self._text[self._at] if self._at < len(self._text) else None

    def fail(self, why: str, at: int | None = None) -> NoReturn:
        place = (self._at if at is None else at) + 1
        raise _error(self._text or "''", f"cannot be read: at character {place}, {why}")

    def _take(self) -> str:
        letter = self.here()
        if letter is None:
            self.fail("it ends too early")
        self._at += 1
        return letter

    def _takes(self, letter: str) -> bool:
        if self.here() == letter:
            self._at += 1
            return True
        return False

    def alternatives(self, depth: int) -> Node:
        if depth > DEEPEST:
            self.fail(f"more than {DEEPEST} parentheses are open")
        parts = [self._sequence(depth)]
        while self._takes("|"):
            parts.append(self._sequence(depth))
        return parts[0] if len(parts) == 1 else Alternatives(tuple(parts))

    def _sequence(self, depth: int) -> Node:
        parts: list[Node] = []
        while self.here() not in (None, "|", ")"):
            parts.append(self._repeated(depth))
        if not parts:
            self.fail("an event is missing")
        return parts[0] if len(parts) == 1 else Concatenation(tuple(parts))

    def _repeated(self, depth: int) -> Node:
        node = self._one(depth)
        while True:
            if self._takes("*"):
                node = Repetition(node, 0, None)
            elif self._takes("+"):
                node = Repetition(node, 1, None)
            elif self._takes("?"):
                node = Repetition(node, 0, 1)
            elif self._takes("{"):
                node = Repetition(node, *self._counts(self._at - 1))
            else:
                return node

    def _counts(self, opened: int) -> tuple[int, int | None]:
        end = self._text.find("}", self._at)
        if end < 0:
            self.fail("the { has no }", opened)
        first, comma, last = self._text[self._at : end].partition(",")
        if not first.isdecimal() or not (last.isdecimal() or last == ""):
            self.fail("braces hold a number, or two with a comma between", opened)
        least = int(first)
        most = least if not comma else int(last) if last else None
        if most is not None and most < least:
            self.fail("the second number is below the first", opened)
        if max(least, most or 0) > MOST_REPEATED:
            self.fail(f"nothing can be repeated more than {MOST_REPEATED} times by number", opened)
        self._at = end + 1
        return least, most

    def _one(self, depth: int) -> Node:
        if self._takes("("):
            opened = self._at - 1
            node = self.alternatives(depth + 1)
            if not self._takes(")"):
                self.fail("the ( has no )", opened)
            return node
        if self._takes("["):
            return self._set(self._at - 1)
        return Events((self._event(),))

    def _set(self, opened: int) -> Events:
        is_negated = self._takes("^")
        patterns: list[Pattern] = []
        while not self._takes("]"):
            if self.here() is None:
                self.fail("the [ has no ]", opened)
            patterns.append(self._event())
        if not patterns:
            self.fail("brackets hold events", opened)
        return Events(tuple(patterns), is_negated)

    def _event(self) -> Pattern:
        if self._takes("<"):
            return self._detailed(self._at - 1)
        letter = self._take()
        if letter not in LETTERS + ".":
            self._at -= 1
            quoted = "labels are written within an event: <L.'key'>" if letter == "'" else f"{letter!r} is no event"
            self.fail(f"{quoted}; there are {' '.join(LETTERS)} and .")
        self.names_straight |= letter == "s"
        return pattern_of(letter)

    def _detailed(self, opened: int) -> Pattern:
        """Parse the rest of <kind lobe label>; the last two may be missing."""
        kind = self._letters("C" + WAYS + ENDS, "a kind of event")
        lobe = label = None
        if self.here() not in (">", None):
            at = self._at
            lobe = self._letters(LOBES, "a kind of scattering")
            if lobe is not None and kind is not None and not any(kind.takes(way) for way in "RT"):
                self.fail("only surfaces (R and T) have a kind of scattering: write .", at)
            self.names_straight |= lobe is not None and "s" in lobe.of
        if self.here() not in (">", None):
            at = self._at
            label = self._label()
            if label is not None and kind is not None and not any(kind.takes(end) for end in ENDS):
                self.fail("only lights (L, O, B) have labels, their groups", at)
        if not self._takes(">"):
            self.fail("the < has no >", opened)
        return Pattern(kind, lobe, label)

    def _letters(self, allowed: str, what: str) -> Choice | None:
        if self._takes("."):
            return None
        if not self._takes("["):
            return Choice(frozenset(self._letter(allowed, what)))
        opened, is_negated = self._at - 1, self._takes("^")
        found: set[str] = set()
        while not self._takes("]"):
            if self.here() is None:
                self.fail("the [ has no ]", opened)
            found.add(self._letter(allowed, what))
        if not found:
            self.fail("brackets hold letters", opened)
        return Choice(frozenset(found), is_negated)

    def _letter(self, allowed: str, what: str) -> str:
        letter = self._take()
        if letter not in allowed:
            self.fail(f"{letter!r} is not {what}, which are {' '.join(allowed)}", self._at - 1)
        return letter

    def _label(self) -> Choice | None:
        if self._takes("."):
            return None
        if not self._takes("["):
            return Choice(frozenset([self._quoted()]))
        opened, is_negated = self._at - 1, self._takes("^")
        found: set[str] = set()
        while not self._takes("]"):
            if self.here() is None:
                self.fail("the [ has no ]", opened)
            found.add(self._quoted())
        if not found:
            self.fail("brackets hold labels", opened)
        return Choice(frozenset(found), is_negated)

    def _quoted(self) -> str:
        opened = self._at
        if not self._takes("'"):
            self.fail("a label is written in quotes: 'key'")
        end = self._text.find("'", self._at)
        if end < 0:
            self.fail("the label's quote does not end", opened)
        label = self._text[self._at : end]
        self._at = end + 1
        self.labels.add(label)
        return label
