"""Applied schemas of other programs, by how their names begin: which of them could change a picture.

What no row speaks of is unknown, and told as that: nobody has looked at what it means to a picture.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

from .context import Context
from .foreign_names import NameSet

_SIMULATED = "They say how things are simulated; what is drawn stands as it is authored."
_RENDERER = "They are settings of another renderer."
_LABELS = "They are labels."
_HOUDINI = "They speak to Houdini's viewport and editors."
# First letters of schemas that leave the picture as it is, and what they are there for.
_WITHOUT_EFFECT = {
    "Physics": _SIMULATED,
    "Physx": _SIMULATED,
    "PhysX": _SIMULATED,
    "Newton": _SIMULATED,
    "Mjc": _SIMULATED,
    "Isaac": _SIMULATED,
    "Preliminary_Physics": _SIMULATED,
    "Semantics": _LABELS,
    "Houdini": _HOUDINI,
    "Arnold": _RENDERER,
    "Cycles": _RENDERER,
    "Karma": _RENDERER,
    "Moonray": _RENDERER,
    "Typhoon": _RENDERER,
}
# Those among them, or other ones, without which something is missing from the picture; the longest beginning decides.
_CHANGING = {
    "HoudiniApex": "What its rig would deform stands as it is authored.",
    "HoudiniLightBarnDoor": "Barn doors do not shade the light.",
    "HoudiniProcedural": "What its procedural would make is missing.",
    "PhysxDiffuseParticles": "The particles that a simulation would make are missing.",
    "PhysxParticleIsosurface": "The surface that a simulation would make of its particles is missing.",
}


@dataclass(frozen=True)
class Foreign:
    family: str  # how the names begin
    changes_picture: bool
    meaning: str


@cache
def foreign_schema(name: str) -> Foreign | None:
    """The row of a schema, by its name without that of an instance; None where it is unknown."""
    rows = [Foreign(begins, True, text) for begins, text in _CHANGING.items()]
    rows += [Foreign(begins, False, text) for begins, text in _WITHOUT_EFFECT.items()]
    fitting = [row for row in rows if _begins(name, row.family)]
    return max(fitting, key=lambda row: len(row.family), default=None)


def _begins(name: str, family: str) -> bool:
    """Where a new word follows: Mjc is no part of Mjcat."""
    rest = name.removeprefix(family)
    return rest != name and not rest[:1].islower()


def is_without_effect(name: str) -> bool:
    row = foreign_schema(name)
    return row is not None and not row.changes_picture


@dataclass
class _Family:
    first_path: str
    meaning: str
    names: set[str] = field(default_factory=set)
    prims: int = 0


def note_foreign_schemas(sets: Iterable[tuple[NameSet, Iterable[str]]], ctx: Context) -> None:
    """One diagnostic for each family that has no effect, of prims and the schemas applied to them."""
    found: dict[str, _Family] = {}
    for prims, schemas in sets:
        rows = {name: foreign_schema(name) for name in schemas}
        told = {name: row for name, row in rows.items() if row and not row.changes_picture}
        for row in sorted(set(told.values()), key=lambda row: row.family):
            known = found.setdefault(row.family, _Family(prims.first_path, row.meaning))
            known.names |= {name for name, other in told.items() if other == row}
            known.prims += prims.count
    for family in found.values():
        names = sorted(family.names)
        what = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
        on = f"{family.prims:,} prims" if family.prims > 1 else "this prim"
        ctx.warn("foreign-schema", ctx.shown(family.first_path), f"{what} on {on}. {family.meaning}")
