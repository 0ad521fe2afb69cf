"""Variants of a document: values that looks give to inputs of the materials that they assign.

MaterialX Geometry Extensions, "VariantAssign Elements": a value applies to the inputs of its name, on all shaders of a
material or on those that the variant set names; the last of several values wins. The values are authored on the look's copy of
the material, above everything that it references: a USD variant would be weaker than the material's own values.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from ..materials import MATERIALS
from ..node_graphs import NodeGraphs
from ..writing import input_of, name_of


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
        made = input_of(over, value)
        graphs.write_value(made, value, node.getNodeDef(), prim.path)
        made.connectionPathList.ClearEditsAndMakeExplicit()


def _is_meant(variant_set: Any, node: Any) -> bool:
    """Return whether a variant set applies to a node: it may name nodes or their definitions."""
    definition = node.getNodeDef()
    named = (("node", node.getName()), ("nodedef", definition.getName() if definition is not None else ""))
    listed = [(variant_set.getAttribute(kind).replace(",", " ").split(), name) for kind, name in named]
    return all(not names or name in names for names, name in listed)
