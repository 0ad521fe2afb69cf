"""Geometric properties that a document names (geompropdef), as nodes that read them.

MaterialX specification, "GeomPropDef Elements": a property is one of the geometry's own (geomprop = position, normal, texcoord
...) in a space or with an index, or else the primvar of its name. The library defines UV0, Nworld and some others.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .documents import library
from .writing import typed_attribute

GEOMPROP_NODES = ("geompropvalue", "geompropvalueuniform")
_SETTINGS = {"space": "string", "index": "integer"}


class GeometricProperties:
    """Geometric properties of a document and of the standard library."""

    def __init__(self, document: Any) -> None:
        self._document = document
        self._own = {found.getName() for found in document.getChildren() if found.getCategory() == "geompropdef"}
        self._own = {name for name in self._own if document.getGeomPropDef(name).getAttribute("geomprop")}
        self.has_own = bool(self._own)

    def is_own(self, name: str) -> bool:
        """Return whether the document derives this property from another."""
        return name in self._own

    def write(self, prim: Sdf.PrimSpec, name: str, kind: str) -> None:
        """Make a prim the node that reads a property, as a value of type `kind` or of the property's own type."""
        found = self._document.getGeomPropDef(name)
        base = found.getAttribute("geomprop") if found is not None else ""
        kinds = [kind] if found is None else [kind, found.getType()]
        known = [f"ND_{base}_{k}" for k in kinds if base and library().getNodeDef(f"ND_{base}_{k}") is not None]
        if known:
            self._set_type(prim, known[0])
            expected = library().getNodeDef(known[0])
            for setting, setting_kind in _SETTINGS.items():
                text = found.getAttribute(setting)
                if text and expected.getActiveInput(setting) is not None:
                    value = int(text) if setting_kind == "integer" and text.isdecimal() else text
                    typed_attribute(prim, f"inputs:{setting}", setting_kind).default = value
        else:
            self._set_type(prim, f"ND_geompropvalue_{kinds[-1]}")
            typed_attribute(prim, "inputs:geomprop", "string").default = base or name

    def _set_type(self, prim: Sdf.PrimSpec, identifier: str) -> None:
        Sdf.AttributeSpec(prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform).default = identifier
        typed_attribute(prim, "outputs:out", identifier.rsplit("_", 1)[1])
