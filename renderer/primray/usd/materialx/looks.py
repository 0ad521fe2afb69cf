"""A document's looks and collections: /MaterialX/Looks, /MaterialX/Collections, and /ModelRoot with a variant for each look."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .materials import MATERIALS
from .node_graphs import own
from .writing import ROOT, apply, define, identifier, input_of, name_of, note_ui, refer, set_value

_LOOKS = ROOT.AppendChild("Looks")
_COLLECTIONS = ROOT.AppendChild("Collections")
_MODEL = Sdf.Path("/ModelRoot")
_VARIANT = "LookVariant"


def write_looks(layer: Sdf.Layer, document: Any) -> None:
    collections = _Collections(layer, document)
    looks = own(document, "look")
    for look in looks:
        for assign in look.getMaterialAssigns():
            collections.of_assign(assign)
    for look in looks:
        _Look(layer, document, collections, look).write()
    _write_variants(layer, document, looks)
    model = define(layer, _MODEL)
    variants = Sdf.VariantSetSpec(model, _VARIANT)
    model.variantSetNameList.prependedItems.append(_VARIANT)
    for look in looks:
        variant = Sdf.VariantSpec(variants, name_of(look))
        variant.primSpec.referenceList.prependedItems.append(Sdf.Reference("", _LOOKS.AppendChild(name_of(look))))


class _Collections:
    """Of the document, and of the geometry that assignments name."""

    def __init__(self, layer: Sdf.Layer, document: Any) -> None:
        self._layer, self._document = layer, document
        self._of_geometry: dict[str, str] = {}
        self._schemas: dict[str, None] = {}
        self.any = bool(own(document, "collection"))
        for collection in own(document, "collection"):
            self._write(collection)

    def _write(self, collection: Any) -> None:
        name = name_of(collection)
        includes = self._relationship(name, "includes")
        for other in _listed(collection, "includecollection"):
            if self._document.getCollection(other) is not None:
                includes.targetPathList.prependedItems.append(_COLLECTIONS.AppendProperty(f"collection:{identifier(other)}"))
        prefix = collection.getActiveGeomPrefix()
        for attribute_name, kind in (("includegeom", "includes"), ("excludegeom", "excludes")):
            for path in _listed(collection, attribute_name):
                self._add(name, kind, prefix + path)

    def of_assign(self, assign: Any) -> str:
        """The collection that a material is assigned to; "" for none."""
        if assign.getAttribute("collection"):
            found = self._document.getCollection(assign.getAttribute("collection"))
            return name_of(found) if found is not None else ""
        paths = sorted(set(_listed(assign, "geom")))
        key = ",".join(paths)
        if key and key not in self._of_geometry:
            taken = {name_of(c) for c in own(self._document, "collection")} | set(self._of_geometry.values())
            number = next(n for n in range(1, len(taken) + 2) if f"geom_{n}" not in taken)
            self._of_geometry[key] = name = f"geom_{number}"
            self._relationship(name, "includes")
            for path in paths:
                self._add(name, "includes", assign.getActiveGeomPrefix() + path)
        return self._of_geometry.get(key, "")

    def _add(self, name: str, kind: str, path: str) -> None:
        if Sdf.Path.IsValidPathString(path):
            target = Sdf.Path(path).ReplacePrefix(Sdf.Path.absoluteRootPath, _COLLECTIONS)
            self._relationship(name, kind).targetPathList.prependedItems.append(target)

    def _relationship(self, name: str, kind: str) -> Sdf.RelationshipSpec:
        prim = define(self._layer, _COLLECTIONS)
        self._schemas.setdefault(f"CollectionAPI:{name}")
        apply(prim, list(self._schemas))
        full = f"collection:{name}:{kind}"
        found = prim.relationships.get(full)
        return found if found else Sdf.RelationshipSpec(prim, full, False)


class _Look:
    """One look: its materials, and what they are bound to."""

    def __init__(self, layer: Sdf.Layer, document: Any, collections: _Collections, look: Any) -> None:
        self._layer, self._document, self._collections, self._look = layer, document, collections, look
        self._path = _LOOKS.AppendChild(name_of(look))

    def write(self) -> None:
        prim = define(self._layer, self._path)
        note_ui(prim, self._look)
        if inherited := self._look.getAttribute("inherit"):
            refer(prim, _LOOKS.AppendChild(identifier(inherited)))
        if self._collections.any:
            refer(prim, _COLLECTIONS)
        define(self._layer, self._path.AppendChild("Materials"))
        apply(prim, ["MaterialBindingAPI"])
        order = [name for assign in self._look.getMaterialAssigns() if (name := self._assign(assign, prim))]
        if order:
            prim.propertyOrder = list(dict.fromkeys(order))

    def _assign(self, assign: Any, prim: Sdf.PrimSpec) -> str:
        material = MATERIALS.AppendChild(identifier(assign.getAttribute("material")))
        if not self._layer.GetPrimAtPath(material):
            return ""
        name = self._unused(name_of(assign))
        child = define(self._layer, self._path.AppendChild("Materials").AppendChild(name))
        note_ui(child, assign)
        refer(child, material)
        for chosen in _variants(assign, self._look):
            child.variantSelections[chosen[0]] = chosen[1]
        collection = self._collections.of_assign(assign) if self._collections.any else ""  # else usdMtlx has none either
        relationship = f"material:binding:collection:{name}" if collection else "material:binding"
        binding = prim.relationships.get(relationship) or Sdf.RelationshipSpec(prim, relationship, False)
        where = [self._path.AppendProperty(f"collection:{collection}")] if collection else []
        binding.targetPathList.explicitItems = [*where, child.path]
        return relationship

    def _unused(self, name: str) -> str:
        below = self._path.AppendChild("Materials")
        number, made = 1, name
        while self._layer.GetPrimAtPath(below.AppendChild(made)):
            made, number = f"{name}_{number}", number + 1
        return made


def _write_variants(layer: Sdf.Layer, document: Any, looks: list[Any]) -> None:
    """The variants of a document's own, on the materials that looks choose them for."""
    for look in looks:
        for assign in look.getMaterialAssigns():
            prim = layer.GetPrimAtPath(MATERIALS.AppendChild(identifier(assign.getAttribute("material"))))
            for set_name, variant_name in _variants(assign, look) if prim else ():
                variant_set = document.getVariantSet(set_name)
                variant = variant_set.getVariant(variant_name) if variant_set is not None else None
                if variant is not None:
                    _write_variant(prim, set_name, variant)


def _write_variant(prim: Sdf.PrimSpec, set_name: str, variant: Any) -> None:
    variants = prim.variantSets.get(set_name)
    if not variants:
        variants = Sdf.VariantSetSpec(prim, set_name)
        prim.variantSetNameList.prependedItems.append(set_name)
    if name_of(variant) in variants.variants:
        return
    inside = Sdf.VariantSpec(variants, name_of(variant)).primSpec
    for element in variant.getChildren():
        if element.getCategory() == "input":
            set_value(input_of(inside, element), element, element.getType() in ("color3", "color4"))


def _variants(assign: Any, look: Any) -> list[tuple[str, str]]:
    """Those chosen for an assignment: by itself, else by its look."""
    chosen: dict[str, str] = {}
    for holder in (look, assign):
        for found in holder.getChildren():
            if found.getCategory() == "variantassign":
                chosen[identifier(found.getAttribute("variantset"))] = identifier(found.getAttribute("variant"))
    return list(chosen.items())


def _listed(element: Any, name: str) -> list[str]:
    return [part.strip() for part in element.getAttribute(name).split(",") if part.strip()]
