"""Kinds of prims: what prims of one type with the same schemas and the same authored names have in common, computed once.

A stage of a million prims has some dozens of such kinds: a question answered by the kind is not asked of each prim.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pxr import Usd

from ..stage.reads import property_names, type_and_schemas
from .bindings import binding_names, is_collection
from .context import Context
from .inheritance import effective_names, hands_down
from .notes import NameSet, is_noted
from .schemas import LEFT_OUT, UNDERSTOOD


@dataclass
class PrimKind(NameSet):
    """A kind of prims: `names` are the authored properties, `count` and `first_path` tell which prims of it have been found."""

    type_name: str = ""
    schemas: list[str] = field(default_factory=list)  # those applied
    taken_as: str = ""  # its adapter's table: "shape", "light", or "" for neither
    left_out: bool = False  # a render pass excludes it, but not the prims below it
    has_transform: bool = False
    hands_down: bool = False  # it may change the state that it inherits
    handed_names: frozenset[str] = frozenset()  # properties that may change it
    is_noted: bool = False  # it may have diagnostics
    bindings: tuple[str, ...] = ()  # its properties that bind materials

    @property
    def foreign_schemas(self) -> set[str]:
        """Schemas of other programs, without instance names."""
        return {schema.split(":")[0] for schema in self.schemas} - UNDERSTOOD


KindKey = tuple[str, tuple[str, ...], tuple[str, ...]]


class PrimKinds:
    """The kinds of prims that have been found, in order."""

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
        left_out, bindings, handed = LEFT_OUT in names, binding_names(names), effective_names(prim, names)
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
