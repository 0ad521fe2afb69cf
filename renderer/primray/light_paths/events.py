"""Events of a light path, from the camera to the light, and patterns that match them.

The letters are Open Shading Language's, which UsdRender refers to: camera C; reflection R, transmission T or volume scattering
V; diffuse D, glossy G, singular S or straight s; light L, emissive object O, background B. A dome is both L and B.
"""

from __future__ import annotations

from dataclasses import dataclass

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
