"""A document's materials as prims below /MaterialX/Materials: each with an interface of all its shaders' inputs."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .node_graphs import NodeGraphs, definition_stack, outputs_of, set_id
from .writing import (
    ROOT,
    SHADERS,
    apply,
    attribute,
    connect,
    define,
    identifier,
    input_of,
    name_of,
    note_ui,
    refer,
    set_value,
)

MATERIALS = ROOT.AppendChild("Materials")
_SHADERS_AT = ROOT.AppendChild("Shaders")
_TERMINALS = {
    "surfaceshader": "surface",
    "displacementshader": "displacement",
    "volumeshader": "volume",
    "lightshader": "light",
}


def write_materials(layer: Sdf.Layer, document: Any, graphs: NodeGraphs) -> None:
    import MaterialX as mx

    materials = document.getMaterialNodes()
    for material in materials:
        prim = define(layer, MATERIALS.AppendChild(name_of(material)), "Material")
        apply(prim, ["MaterialXConfigAPI"])
        attribute(prim, "config:mtlx:version", Sdf.ValueTypeNames.String).default = document.getVersionString()
        note_ui(prim, material)
        for kind in ("surfaceshader", "volumeshader", "displacementshader", "lightshader"):
            for shader in mx.getShaderNodes(material, kind):
                _Shader(layer, document, graphs, prim.path, shader).write()
    for material in materials:
        inherited = document.getNode(material.getAttribute("inherit")) if material.getAttribute("inherit") else None
        if inherited is not None and inherited.getName() != material.getName():
            prim = layer.GetPrimAtPath(MATERIALS.AppendChild(name_of(material)))
            prim.specializesList.prependedItems.append(MATERIALS.AppendChild(name_of(inherited)))


class _Shader:
    """One of a material's."""

    def __init__(self, layer: Sdf.Layer, document: Any, graphs: NodeGraphs, material: Sdf.Path, node: Any) -> None:
        self._layer, self._document, self._graphs, self._material, self._node = layer, document, graphs, material, node
        self._definition = node.getNodeDef()

    def write(self) -> None:
        if self._definition is None:
            return
        path = self._material.AppendChild(name_of(self._node))
        custom = self._graphs.implementing(self._definition) is not None
        if custom:
            self._graphs.custom_node(self._node, path)
        else:
            refer(define(self._layer, path, "Shader"), self._shared())
        shader, material = define(self._layer, path), define(self._layer, self._material)
        for one in definition_stack(self._definition):
            for element in one.getInputs():
                connect(input_of(shader, element), input_of(material, element).path)
        for element in self._node.getInputs():
            made = input_of(material, element)
            set_value(made, element, self._graphs.has_colors(element, self._definition))
            note_ui(made, element)
            source = self._source(element)
            if source is not None:
                connect(input_of(shader, element), source)
        self._connect_outputs(path, custom)

    def _shared(self) -> Sdf.Path:
        """The shader's kind and outputs, which all materials with it refer to."""
        path = _SHADERS_AT.AppendChild(name_of(self._node))
        if not self._layer.GetPrimAtPath(path):
            prim = define(self._layer, path, "Shader")
            set_id(prim, self._definition)
            note_ui(prim, self._node)
            for output in outputs_of(self._definition):
                if output.getType() in SHADERS:
                    attribute(prim, f"outputs:{_TERMINALS[output.getType()]}", Sdf.ValueTypeNames.Token)
        return path

    def _source(self, element: Any) -> Sdf.Path | None:
        """What a graph gives an input, of a copy of the graph inside the material."""
        output, node, graph = (element.getAttribute(name) for name in ("output", "nodename", "nodegraph"))
        if graph:
            found = self._graphs.of_name(graph)
            if found is None:
                return None
            names = [o.getName() for o in self._document.getChild(graph).getOutputs()]
            chosen = output if output in names else (names or ["out"])[0]
            return self._graphs.place(found, self._material).AppendProperty(f"outputs:{identifier(chosen)}")
        if output and not node:  # an output at the document's top
            top = self._document.getOutput(output)
            node, output = (top.getNodeName(), top.getAttribute("output")) if top is not None else ("", "")
        source = self._document.getNode(node) if node else None
        if source is None:
            return None
        names = [o.getName() for o in outputs_of(source.getNodeDef())] or ["out"]
        place = self._graphs.place(self._graphs.of_top(), self._material)
        chosen = output if output in names else names[0]
        return place.AppendChild(name_of(source)).AppendProperty(f"outputs:{identifier(chosen)}")

    def _connect_outputs(self, path: Sdf.Path, custom: bool) -> None:
        material = define(self._layer, self._material)
        for output in outputs_of(self._definition):
            if output.getType() not in SHADERS:
                continue
            terminal = _TERMINALS[output.getType()]
            name = f"outputs:{terminal}" if terminal == "light" else f"outputs:mtlx:{terminal}"
            own = name_of(output) if custom else terminal
            connect(attribute(material, name, Sdf.ValueTypeNames.Token), path.AppendProperty(f"outputs:{own}"))
