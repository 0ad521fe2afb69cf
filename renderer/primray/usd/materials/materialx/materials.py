"""Materials of a document as prims below /MaterialX/Materials, each with an interface of its shaders' inputs.

Where two shaders of a material have an input of the same name, the first shader's is in the material's interface, and the
other's on the shader itself. USD has no terminal for the back of a surface.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from .layer_writing import (
    ROOT,
    SHADERS,
    add_reference,
    attribute,
    connect,
    define,
    input_attribute,
    name_of,
    set_schemas,
    usd_identifier,
    write_documentation,
    write_messages,
)
from .node_graphs import NodeGraphs, definition_stack, outputs_of, set_identifier

MATERIALS = ROOT.AppendChild("Materials")
_SHADERS_AT = ROOT.AppendChild("Shaders")
_TERMINALS = {
    "surfaceshader": "surface",
    "volumeshader": "volume",
    "displacementshader": "displacement",
    "lightshader": "light",
}
_BACK = "backsurfaceshader"


def write_materials(layer: Sdf.Layer, document: Any, graphs: NodeGraphs) -> None:
    """Write a document's materials."""
    materials = document.getMaterialNodes()
    for material in materials:
        prim = define(layer, MATERIALS.AppendChild(name_of(material)), "Material")
        set_schemas(prim, ["MaterialXConfigAPI"])
        attribute(prim, "config:mtlx:version", Sdf.ValueTypeNames.String).default = document.getVersionString()
        write_documentation(prim, material)
        _Material(layer, document, graphs, prim.path, material).write()
        write_messages(prim, graphs.notes_of(prim.path))
    for material in materials:
        inherited = document.getNode(material.getAttribute("inherit")) if material.getAttribute("inherit") else None
        if inherited is not None and inherited.getName() != material.getName():
            prim = layer.GetPrimAtPath(MATERIALS.AppendChild(name_of(material)))
            prim.specializesList.prependedItems.append(MATERIALS.AppendChild(name_of(inherited)))


class _Material:
    """Writer of one material's shaders, each of which is connected to a terminal of its prim."""

    def __init__(self, layer: Sdf.Layer, document: Any, graphs: NodeGraphs, path: Sdf.Path, node: Any) -> None:
        self._layer, self._document, self._graphs, self._path, self._node = layer, document, graphs, path, node
        self._interface: set[str] = set()  # inputs already in the material's interface

    def write(self) -> None:
        for kind in _TERMINALS:
            shaders = self._shaders(kind)
            for shader in shaders[:1]:
                self._write_shader(shader)
            for other in shaders[1:]:
                self._graphs.note(self._path, f"{other.getName()} is another {kind} of the material and has no effect.")
        self._note_back()

    def _shaders(self, kind: str) -> list[Any]:
        """Return the material's shaders of a kind: the one that the input named after the kind leads to, else all others."""
        import MaterialX as mx

        found, named, back = mx.getShaderNodes(self._node, kind), self._connected(kind), self._connected(_BACK)
        return [s for s in found if _is_same(s, named)] or [s for s in found if not _is_same(s, back)]

    def _connected(self, name: str) -> Any:
        given = self._node.getInput(name)
        return given.getConnectedNode() if given is not None else None

    def _note_back(self) -> None:
        back = self._connected(_BACK)
        if back is None or _is_same(back, self._connected("surfaceshader")):
            return
        message = f"{_BACK} = {back.getName()} is not supported: back faces are rendered like front faces."
        self._graphs.note(self._path, message)

    def _write_shader(self, shader: Any) -> None:
        if shader.getNodeDef() is None:
            return
        if shader.getParent().getCategory() == "nodegraph":
            self._of_graph(shader)
        else:
            self._shader(shader).write()

    def _of_graph(self, shader: Any) -> None:
        """Connect a terminal to a shader inside a node graph, together with the nodes that it reads there.

        The graph may implement the material itself, and then has the material's inputs.
        """
        graph = self._graphs.of_name(shader.getParent().getName())
        if graph is None:
            return
        if self._graphs.implementing(self._node.getNodeDef()) is None:
            place = self._graphs.place(graph, self._path)
        else:
            place = self._path.AppendChild(name_of(self._node))
            if not self._layer.GetPrimAtPath(place):
                self._shader(self._node).write()
        at = place.AppendChild(name_of(shader))
        _connect_terminals(define(self._layer, self._path), shader.getNodeDef(), at, own_outputs=True)

    def _shader(self, node: Any) -> _Shader:
        return _Shader(self._layer, self._document, self._graphs, self._path, node, self._interface)


def _is_same(a: Any, b: Any) -> bool:
    return a is not None and b is not None and a.getNamePath() == b.getNamePath()


class _Shader:
    """Writer of one shader of a material, at the top of the document, or of the material itself where a graph implements it."""

    def __init__(
        self, layer: Sdf.Layer, document: Any, graphs: NodeGraphs, material: Sdf.Path, node: Any, interface: set[str]
    ) -> None:
        self._layer, self._document, self._graphs, self._material, self._node = layer, document, graphs, material, node
        self._definition = node.getNodeDef()
        self._interface = interface  # shared with the material's other shaders: inputs in its interface

    def write(self) -> None:
        path = self._material.AppendChild(name_of(self._node))
        custom = self._graphs.implementing(self._definition) is not None
        if custom:
            self._graphs.custom_node(self._node, path)
        else:
            add_reference(define(self._layer, path, "Shader"), self._shared())
        shader, material = define(self._layer, path), define(self._layer, self._material)
        taken = set(self._interface)
        for element in (i for one in definition_stack(self._definition) for i in one.getInputs()):
            if element.getName() not in taken:
                connect(input_attribute(shader, element), input_attribute(material, element).path)
                self._interface.add(element.getName())
        for element in self._node.getInputs():
            self._write_input(element, shader, shader if element.getName() in taken else material)
        _connect_terminals(material, self._definition, path, own_outputs=custom)

    def _write_input(self, element: Any, shader: Sdf.PrimSpec, holder: Sdf.PrimSpec) -> None:
        """Write an input's value where it is held: in the material's interface, or on the shader."""
        made = input_attribute(holder, element)
        self._graphs.write_value(made, element, self._definition, self._material)
        write_documentation(made, element)
        source = self._source(element)
        if source is not None:
            connect(input_attribute(shader, element), self._converted(element, source))

    def _converted(self, element: Any, source: Sdf.Path) -> Sdf.Path:
        factor = self._graphs.factor(element, self._definition, self._material)
        if factor == 1.0:
            return source
        at = self._material.AppendChild(f"{name_of(self._node)}_{usd_identifier(element.getName())}_in_units")
        return self._graphs.multiplied(source, at, element.getType(), factor)

    def _shared(self) -> Sdf.Path:
        """Return the prim with the shader's id and outputs, which all materials with this shader reference."""
        path = _SHADERS_AT.AppendChild(name_of(self._node))
        if not self._layer.GetPrimAtPath(path):
            prim = define(self._layer, path, "Shader")
            set_identifier(prim, self._definition.getName())
            write_documentation(prim, self._node)
            for output in outputs_of(self._definition):
                if output.getType() in SHADERS:
                    attribute(prim, f"outputs:{_TERMINALS[output.getType()]}", Sdf.ValueTypeNames.Token)
        return path

    def _source(self, element: Any) -> Sdf.Path | None:
        """Return what an input is connected to, inside a copy of the graph below the material."""
        output, node, graph = (element.getAttribute(name) for name in ("output", "nodename", "nodegraph"))
        if graph:
            found = self._graphs.of_name(graph)
            if found is None:
                return None
            names = [o.getName() for o in self._document.getChild(graph).getOutputs()]
            chosen = output if output in names else (names or ["out"])[0]
            return self._graphs.place(found, self._material).AppendProperty(f"outputs:{usd_identifier(chosen)}")
        if output and not node:  # an output element at the document's top level
            top = self._document.getOutput(output)
            node, output = (top.getNodeName(), top.getAttribute("output")) if top is not None else ("", "")
        source = self._document.getNode(node) if node else None
        if source is None:
            return None
        names = [o.getName() for o in outputs_of(source.getNodeDef())] or ["out"]
        place = self._graphs.place(self._graphs.of_top(), self._material)
        chosen = output if output in names else names[0]
        return place.AppendChild(name_of(source)).AppendProperty(f"outputs:{usd_identifier(chosen)}")


def _connect_terminals(material: Sdf.PrimSpec, definition: Any, shader: Sdf.Path, *, own_outputs: bool) -> None:
    """Connect the material's terminals to a shader's outputs; with `own_outputs` these have the definition's names."""
    for output in outputs_of(definition):
        if output.getType() not in SHADERS:
            continue
        terminal = _TERMINALS[output.getType()]
        name = f"outputs:{terminal}" if terminal == "light" else f"outputs:mtlx:{terminal}"
        made = attribute(material, name, Sdf.ValueTypeNames.Token)
        connect(made, shader.AppendProperty(f"outputs:{name_of(output) if own_outputs else terminal}"))
