"""Looks and collections of a document: /MaterialX/Looks, /MaterialX/Collections, and /ModelRoot with a variant per look.

A look binds its materials through collections of its own, in the order that look_assignments.py determines. Messages about
what has no effect are stored in the look's variant, so that they are reported only if the look is selected.

Variants of a document give values to inputs of the materials that a look assigns (MaterialX Geometry Extensions,
"VariantAssign Elements"): a value applies to the inputs of its name, on all shaders of a material or on those that the variant
set names; the last of several values wins. The values are authored on the look's copy of the material, above everything that
it references: a USD variant would be weaker than the material's own values.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .layer_writing import (
    ROOT,
    add_reference,
    define,
    input_attribute,
    name_of,
    set_schemas,
    usd_identifier,
    write_documentation,
    write_messages,
)
from .look_assignments import (
    Assignment,
    GeometryName,
    LookBinding,
    Share,
    geometry_names,
    is_prim_name,
    look_bindings,
    shares_of,
)
from .look_effects import LookEffects, effects_of
from .materials import MATERIALS
from .node_graphs import NodeGraphs, own

_LOOKS = ROOT.AppendChild("Looks")
_COLLECTIONS = ROOT.AppendChild("Collections")
_MODEL = Sdf.Path("/ModelRoot")
_VARIANT = "LookVariant"
_WHOLE = Share(GeometryName(()))
_T = Sdf.ValueTypeNames


def write_looks(layer: Sdf.Layer, document: Any, graphs: NodeGraphs) -> dict[Sdf.Path, LookEffects]:
    """Write all looks; return their effects beside material bindings, by the paths of their variants."""
    collections = _write_collections(layer, document)
    looks = own(document, "look")
    model = define(layer, _MODEL)
    variants = Sdf.VariantSetSpec(model, _VARIANT)
    model.variantSetNameList.prependedItems.append(_VARIANT)
    found: dict[Sdf.Path, LookEffects] = {}
    for look in looks:
        made = _Look(layer, graphs, look, collections)
        made.write()
        effects = effects_of(made.chain, document, made.wrong)
        variant = Sdf.VariantSpec(variants, name_of(look)).primSpec
        variant.referenceList.prependedItems.append(Sdf.Reference("", made.path))
        write_messages(variant, [f"Look {look.getName()}: {message}." for message in made.wrong])
        if effects:
            found[variant.path] = effects
    if chosen := _default_look(document, [look.getName() for look in looks]):
        model.variantSelections[_VARIANT] = usd_identifier(chosen)
    return found


def _default_look(document: Any, looks: list[str]) -> str:
    """Return the look that the first look group with a usable default selects, "" without one."""
    groups = {group.getName(): group for group in own(document, "lookgroup")}
    for first in groups.values():
        name, passed = str(first.getName()), set[str]()
        while name in groups and name not in passed:
            passed.add(name)
            name = str(groups[name].getAttribute("default") or groups[name].getAttribute("active"))
        if name in looks:
            return name
    return ""


def _write_collections(layer: Sdf.Layer, document: Any) -> set[str]:
    """Write the document's collections for use from USD, as far as they can be paths; return their names."""
    names = {name_of(collection): collection for collection in own(document, "collection")}
    for name, collection in names.items():
        prim = define(layer, _COLLECTIONS)
        set_schemas(prim, [f"CollectionAPI:{known}" for known in names])
        for attribute, kind in (("includegeom", "includes"), ("excludegeom", "excludes")):
            found = geometry_names(collection.getAttribute(attribute), collection.getActiveGeomPrefix())
            targets = [one.path(_COLLECTIONS) for one in found if one.is_literal and is_prim_name(one)]
            if attribute == "includegeom":
                others = collection.getAttribute("includecollection").replace(",", " ").split()
                others = [usd_identifier(other) for other in others if document.getCollection(other) is not None]
                targets = [_COLLECTIONS.AppendProperty(f"collection:{other}") for other in others] + targets
            if targets or kind == "includes":
                rel = Sdf.RelationshipSpec(prim, f"collection:{name}:{kind}", False)
                rel.targetPathList.prependedItems = targets
    return set(names)


class _Look:
    """One look with everything that it inherits: its materials, and what they are bound to."""

    def __init__(self, layer: Sdf.Layer, graphs: NodeGraphs, look: Any, collections: set[str]) -> None:
        self._layer, self._graphs, self._look = layer, graphs, look
        self._taken = set(collections)  # collection names in use
        self.path = _LOOKS.AppendChild(name_of(look))
        self.wrong: list[str] = []  # messages about what has no effect
        self.chain = self._inherited()

    def _inherited(self) -> list[Any]:
        """Return the looks that this one consists of, itself last."""
        looks = {look.getName(): look for look in own(self._graphs.document, "look")}
        found, name = [self._look], self._look.getAttribute("inherit")
        while name:
            above = looks.get(name)
            if above is None or any(above.getName() == known.getName() for known in found):
                self.wrong.append(f"it inherits {name}, which is not a look, or inherits itself")
                break
            found.append(above)
            name = above.getAttribute("inherit")
        return found[::-1]

    def write(self) -> None:
        prim = define(self._layer, self.path)
        write_documentation(prim, self._look)
        if self._taken:
            add_reference(prim, _COLLECTIONS)
        define(self._layer, self.path.AppendChild("Materials"))
        assignments = [made for look in self.chain for one in look.getMaterialAssigns() if (made := self._assignment(one))]
        schemas = ["MaterialBindingAPI"]
        try:
            order = [name for bound in look_bindings(assignments) if (name := self._bind(prim, bound, assignments, schemas))]
        except ValueError as error:
            self.wrong.append(str(error))
            order = []
        set_schemas(prim, schemas)
        prim.propertyOrder = order

    def _assignment(self, element: Any) -> Assignment | None:
        """Return an assignment of a copy of its material, None where the material does not exist."""
        name = element.getAttribute("material")
        material = self._graphs.document.getNode(name)
        path = MATERIALS.AppendChild(usd_identifier(name))
        if material is None or not self._layer.GetPrimAtPath(path):
            self.wrong.append(f"materialassign {element.getName()}: there is no material {name}")
            return None
        if element.getAttribute("exclusive") == "false":
            self.wrong.append(f"materialassign {element.getName()} is not exclusive: it is treated as exclusive")
        child = define(self._layer, self._unused(self.path.AppendChild("Materials"), name_of(element)))
        write_documentation(child, element)
        add_reference(child, path)
        assigned = [variant for holder in (*self.chain, element) for variant in own(holder, "variantassign")]
        apply_variants(child, material, assigned, self._graphs, self.wrong)
        document = self._graphs.document
        is_whole = not element.getAttribute("geom") and not element.getAttribute("collection")  # as in usdMtlx
        return Assignment(child.path, (_WHOLE,) if is_whole else shares_of(element, document, self.wrong))

    def _unused(self, below: Sdf.Path, name: str) -> Sdf.Path:
        number, made = 1, name
        while self._layer.GetPrimAtPath(below.AppendChild(made)):
            made, number = f"{name}_{number}", number + 1
        return below.AppendChild(made)

    def _bind(self, prim: Sdf.PrimSpec, bound: LookBinding, assignments: list[Assignment], schemas: list[str]) -> str:
        """Write a binding and return its name.

        A binding of the whole model needs no collection and comes last: its name is "".
        """
        material = assignments[bound.order].what
        if bound.is_whole:
            made = Sdf.RelationshipSpec(prim, "material:binding", False)
            made.targetPathList.explicitItems = [material]
            return ""
        number, name = 1, material.name
        while name in self._taken:
            number += 1
            name = f"{material.name}_{number}"
        self._taken.add(name)
        schemas.append(f"CollectionAPI:{name}")
        self._write_collection(prim, name, bound)
        binding = f"material:binding:collection:{name}"
        made = Sdf.RelationshipSpec(prim, binding, False)
        made.targetPathList.explicitItems = [self.path.AppendProperty(f"collection:{name}"), material]
        return binding

    def _write_collection(self, prim: Sdf.PrimSpec, name: str, bound: LookBinding) -> None:
        """Write the members of a binding's collection: paths where all names are literal, else an expression."""
        if all(one.is_literal for one in (*bound.names, *bound.excludes)):
            for kind, names in (("includes", bound.names), ("excludes", bound.excludes)):
                if names:
                    made = Sdf.RelationshipSpec(prim, f"collection:{name}:{kind}", False)
                    made.targetPathList.explicitItems = [one.path(self.path) for one in names]
            if not bound.below:
                rule = Sdf.AttributeSpec(prim, f"collection:{name}:expansionRule", _T.Token, Sdf.VariabilityUniform)
                rule.default = "explicitOnly"
            return
        included = " + ".join(one.expression(self.path, below=bound.below) for one in bound.names)
        text = " - ".join([included, *(one.expression(self.path) for one in bound.excludes)])
        if not text.isascii():
            self.wrong.append(f"USD cannot express {text.replace(str(self.path), '')}: nothing is bound to it")
            return
        made = Sdf.AttributeSpec(prim, f"collection:{name}:membershipExpression", _T.PathExpression, Sdf.VariabilityUniform)
        made.default = Sdf.PathExpression(text)


def apply_variants(child: Sdf.PrimSpec, material: Any, assigned: list[Any], graphs: NodeGraphs, wrong: list[str]) -> None:
    """Write the values of assigned variants on a prim that references a material; `wrong` receives messages about the rest."""
    for element in assigned:
        found = _variant(element, graphs.document, wrong)
        for value in found.getChildren() if found is not None else ():
            if value.getCategory() == "input":
                _write_value(child, material, found.getParent(), value, graphs)
            elif value.getCategory() == "token":
                wrong.append(f"token {value.getName()} of variant {found.getName()} is not applied")


def _variant(assigned: Any, document: Any, wrong: list[str]) -> Any:
    set_name, name = assigned.getAttribute("variantset"), assigned.getAttribute("variant")
    variant_set = document.getVariantSet(set_name)
    found = variant_set.getVariant(name) if variant_set is not None else None
    if found is None:
        wrong.append(f"variantassign {assigned.getName()}: there is no variant {name} of {set_name}")
    return found


def _write_value(child: Sdf.PrimSpec, material: Any, variant_set: Any, value: Any, graphs: NodeGraphs) -> None:
    """Write a value on the shaders of a material that have the input, replacing its connection."""
    prim = graphs.layer.GetPrimAtPath(MATERIALS.AppendChild(name_of(material)))
    nodes = {name_of(node): node for node in graphs.document.getNodes()}
    for shader in prim.nameChildren:
        node = nodes.get(shader.name)
        given = shader.attributes.get(f"inputs:{name_of(value)}")
        if node is None or not given or not _is_meant(variant_set, node):
            continue
        over = child.nameChildren.get(shader.name) or Sdf.PrimSpec(child, shader.name, Sdf.SpecifierOver)
        made = input_attribute(over, value)
        graphs.write_value(made, value, node.getNodeDef(), prim.path)
        made.connectionPathList.ClearEditsAndMakeExplicit()


def _is_meant(variant_set: Any, node: Any) -> bool:
    """Return whether a variant set applies to a node: it may name nodes or their definitions."""
    definition = node.getNodeDef()
    named = (("node", node.getName()), ("nodedef", definition.getName() if definition is not None else ""))
    listed = [(variant_set.getAttribute(kind).replace(",", " ").split(), name) for kind, name in named]
    return all(not names or name in names for names, name in listed)
