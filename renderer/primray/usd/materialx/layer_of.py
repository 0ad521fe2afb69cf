"""Conversion of a document to a layer's content, as USD's plugin usdMtlx lays it out, with a default prim."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .look.effects import Effects, mark
from .look.looks import write_looks
from .materials import write_materials
from .node_graphs import NodeGraphs, own
from .writing import ROOT


def write_layer(document: Any, layer: Sdf.Layer, meters_per_unit: float) -> dict[Sdf.Path, Effects]:
    """Write a document to an empty layer, for a stage with this metersPerUnit.

    Returns what its looks do beside binding materials, by the paths of their variants.
    """
    effects: dict[Sdf.Path, Effects] = {}
    with Sdf.ChangeBlock():
        space = document.getActiveColorSpace()
        if space:
            layer.pseudoRoot.SetInfo("customLayerData", {"colorSpace": space})
        graphs = NodeGraphs(layer, document, meters_per_unit)
        graphs.of_definitions()
        write_materials(layer, document, graphs)
        if own(document, "look"):
            effects = write_looks(layer, document, graphs)
            mark(layer, effects)
        if layer.GetPrimAtPath(ROOT):
            layer.pseudoRoot.SetInfo("defaultPrim", ROOT.name)
    return effects
