"""What prims of one type with the same schemas and the same authored names have in common, decided once for all of them.

A stage of a million prims has some dozens of such kinds: what need not be asked of a kind is asked of none of its prims.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pxr import Usd

from ..querying.guarded import property_names, type_and_schemas
from .applied_schemas import UNDERSTOOD
from .bindings import binding_names, is_collection
from .context import Context
from .foreign_names import NameSet
from .notes import is_noted
from .renderer_attributes import LEFT_OUT
from .resolve import hands_down, names_that_count


class PropertyNames(set[frozenset[str]]):
    """What prims have authored, each set of names once."""


@dataclass
class PrimKind(NameSet):
    """`names` are the authored properties, `count` and `first_path` say which prims have been met."""

    type_name: str = ""
    schemas: list[str] = field(default_factory=list)  # those applied
    taken_as: str = ""  # what the adapter table takes it for: "shape", "light", or "" for neither
    left_out: bool = False  # a render pass leaves it out, not what is below it
    has_transform: bool = False
    hands_down: bool = False  # something else than what is above it
    handed_names: frozenset[str] = frozenset()  # properties that count for what it hands down
    is_noted: bool = False  # diagnostics may have something to say of it
    bindings: tuple[str, ...] = ()  # its properties that bind materials

    @property
    def foreign_schemas(self) -> set[str]:
        """Those of other programs, without names of instances."""
        return {schema.split(":")[0] for schema in self.schemas} - UNDERSTOOD


class KindsMet(list[PrimKind]):
    """Those of the prims that the walk passed."""


KindKey = tuple[str, tuple[str, ...], tuple[str, ...]]


class PrimKinds:
    """The kinds of prims that were met, in that order."""

    def __init__(self, ctx: Context, taken_as: Mapping[str, str]) -> None:
        self._ctx = ctx
        self._taken_as = taken_as
        self.found: dict[KindKey, PrimKind] = {}
        self.by_collection = False  # some bind materials by a collection

    def of(self, prim: Usd.Prim, path: str) -> PrimKind:
        name, schemas = type_and_schemas(prim)
        key = (name, tuple(property_names(prim)), tuple(schemas))
        kind = self.found.get(key)
        if kind is None:
            kind = self.found[key] = self._made(prim, path, key)
        kind.count += 1
        return kind

    def _made(self, prim: Usd.Prim, path: str, key: KindKey) -> PrimKind:
        name, (names, schemas) = str(key[0]), (frozenset(map(str, key[1])), list(map(str, key[2])))
        left_out, bindings, handed = LEFT_OUT in names, binding_names(names), names_that_count(prim, names)
        taken_as = "" if left_out else self._taken_as.get(name, "")
        self.by_collection |= any(map(is_collection, bindings))
        return PrimKind(
            names,
            path,
            type_name=name,
            schemas=schemas,
            taken_as=taken_as,
            left_out=left_out,
            has_transform="xformOpOrder" in names,
            hands_down=hands_down(handed, schemas, self._ctx),
            handed_names=handed,
            is_noted=is_noted(prim, name, schemas, names, taken_as),
            bindings=bindings,
        )
