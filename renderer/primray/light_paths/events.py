"""What happens to a path, one event after the other from the camera on; and what matches it.

The letters are Open Shading Language's, which UsdRender names: camera C; reflected R, transmitted T or scattered by a medium V,
diffuse D, glossy G, singular S or straight through s; a light L, a surface that glows O, the background B. A dome is a light
and the background.
"""

from __future__ import annotations

from dataclasses import dataclass

WAYS, LOBES, ENDS = "RTV", "DGSs", "LOB"


@dataclass(frozen=True)
class Event:
    kinds: str  # any of these letters stands for it
    lobe: str = ""  # of scattering at surfaces
    label: str = ""  # of a light: its group


CAMERA = Event("C")
# In the core's order (route/route_tables.hpp).
SCATTERINGS = (*(Event(way, lobe) for way in "RT" for lobe in "DGS"), Event("T", "s"), Event("V"))
STRAIGHT = SCATTERINGS.index(Event("T", "s"))
END_KINDS = ("L", "LB", "O")


@dataclass(frozen=True)
class Choice:
    """One of these, or none of them."""

    of: frozenset[str]
    is_negated: bool = False

    def takes(self, values: str | tuple[str, ...]) -> bool:
        return any(value in self.of for value in values) != self.is_negated


@dataclass(frozen=True)
class Pattern:
    """None: whatever there is."""

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
    """Those that any of the patterns matches, or none of them."""

    patterns: tuple[Pattern, ...]
    is_negated: bool = False

    def matches(self, event: Event) -> bool:
        return any(pattern.matches(event) for pattern in self.patterns) != self.is_negated


ANY = Pattern()


def pattern_of(letter: str) -> Pattern:
    """What a letter stands for by itself."""
    if letter == ".":
        return ANY
    chosen = Choice(frozenset(letter))
    return Pattern(lobe=chosen) if letter in LOBES else Pattern(kind=chosen)
