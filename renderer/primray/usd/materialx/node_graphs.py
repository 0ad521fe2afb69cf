"""A document's node graphs, and the nodes at its top, as prims below /MaterialX/NodeGraphs.

A node of the file's own that a graph implements is a prim that refers to that graph, so that each has its own inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Sdf

from .growth import fault
from .writing import (
    RAW,
    ROOT,
    connect,
    define,
    identifier,
    input_of,
    name_of,
    note_input_ui,
    note_ui,
    refer,
    set_value,
    typed_attribute,
)

GRAPHS = ROOT.AppendChild("NodeGraphs")
_IMAGE_COLORS = ("color3", "color4")


def definition_stack(definition: Any) -> list[Any]:
    """A nodedef and those that it inherits from, the furthest first."""
    found: list[Any] = []
    document = definition.getDocument()
    while definition is not None and all(definition.getName() != known.getName() for known in found):
        found.append(definition)
        inherited = definition.getAttribute("inherit")
        definition = document.getNodeDef(inherited) if inherited else None
    return found[::-1]


def own(document: Any, category: str) -> list[Any]:
    """The document's children of a category, without those of the library."""
    return [child for child in document.getChildren() if child.getCategory() == category]


def has_colors(element: Any, definition: Any) -> bool:
    """Return whether a value may have a colour space: colours, and the file of an image of colours."""
    if element.getType() == "filename":
        return any(o.getType() in _IMAGE_COLORS for o in outputs_of(definition))
    return element.getType() in _IMAGE_COLORS


class NodeGraphs:
    """Writes graphs to a layer as they are asked for."""

    def __init__(self, layer: Sdf.Layer, document: Any) -> None:
        self.layer, self._document = layer, document
        self._written: set[str] = set()
        self._graphs = {graph.getName(): graph for graph in own(document, "nodegraph")}
        self._definitions = {definition.getName() for definition in own(document, "nodedef")}
        if wrong := fault(self._graphs, self._definitions):
            raise ValueError(wrong)

    def implementing(self, definition: Any) -> Any:
        """The document's graph that implements a nodedef, None where it has none."""
        if definition is None or definition.getName() not in self._definitions:
            return None
        found = definition.getImplementation()
        return self._graphs.get(found.getName()) if found is not None else None

    def of_definitions(self) -> None:
        """Those that implement nodedefs of the document, by the nodedefs' names."""
        for graph in self._graphs.values():
            if self.implementing(definition := graph.getNodeDef()) is not None:
                self._definition(definition)

    def _definition(self, definition: Any) -> Sdf.Path:
        path = GRAPHS.AppendChild(name_of(definition))
        graph = self.implementing(definition)
        if str(path) not in self._written:
            self._written.add(str(path))
            self._write(graph, path, definition)
        return path

    def of_name(self, name: str) -> Sdf.Path | None:
        """A graph of the document."""
        graph = self._graphs.get(name)
        if graph is None:
            return None
        if self.implementing(definition := graph.getNodeDef()) is not None:
            return self._definition(definition)
        path = GRAPHS.AppendChild(name_of(graph))
        if str(path) not in self._written:
            self._written.add(str(path))
            self._write(graph, path, None)
        return path

    def of_top(self) -> Sdf.Path:
        """Of the nodes that are in no graph."""
        if str(GRAPHS) not in self._written:
            self._written.add(str(GRAPHS))
            define(self.layer, GRAPHS, "NodeGraph")
            _Nodes(self, GRAPHS, self._document).write(
                [n for n in self._document.getNodes() if n.getType() not in ("material", "surfaceshader")]
            )
        return GRAPHS

    def _write(self, graph: Any, path: Sdf.Path, definition: Any) -> None:
        prim = define(self.layer, path, "NodeGraph")
        note_ui(prim, graph)
        for interface in (*(definition_stack(definition) if definition is not None else ()), graph):
            for element in interface.getInputs():
                made = input_of(prim, element)
                set_value(made, element, self._interface_has_colors(element, graph))
                note_input_ui(made, element)
        nodes = _Nodes(self, path, graph)
        nodes.write(graph.getNodes())
        for element in graph.getInputs():
            nodes.join(input_of(prim, element), element)
        for output in graph.getOutputs():
            made = typed_attribute(prim, f"outputs:{name_of(output)}", output.getType())
            note_ui(made, output)
            nodes.join(made, output)

    def has_colors(self, element: Any, definition: Any) -> bool:
        """Return whether a node's input may have a colour space; the file of a node of the document's own is what reads it."""
        graph = self.implementing(definition) if element.getType() == "filename" else None
        return has_colors(element, definition) if graph is None else self._interface_has_colors(element, graph)

    def _interface_has_colors(self, element: Any, graph: Any) -> bool:
        """Return whether an input of a graph's interface may have one: a file, where a node of the graph reads its colours."""
        if element.getType() != "filename":
            return has_colors(element, None)
        return any(
            self.has_colors(given, node.getNodeDef())
            for node in graph.getNodes()
            for given in node.getInputs()
            if given.getType() == "filename" and given.getAttribute("interfacename") == element.getName()
        )

    def place(self, source: Sdf.Path, below: Sdf.Path) -> Sdf.Path:
        """A prim below another that refers to a graph elsewhere: connections do not lead out of what holds them."""
        path = below.AppendChild(source.name)
        refer(define(self.layer, path), source)
        return path

    def custom_node(self, node: Any, path: Sdf.Path) -> bool:
        """Write the node as a reference to the graph of the document that implements it; False where none does."""
        definition = node.getNodeDef()
        if self.implementing(definition) is None:
            return False
        prim = define(self.layer, path)
        refer(prim, self._definition(definition))
        for element in node.getInputs():
            set_value(input_of(prim, element), element, self.has_colors(element, definition))
        return True


class _Nodes:
    """Those of one graph, or of the document's top."""

    def __init__(self, graphs: NodeGraphs, path: Sdf.Path, container: Any) -> None:
        self._graphs, self._path, self._container = graphs, path, container
        self._names = {node.getName() for node in container.getNodes()}

    def write(self, nodes: list[Any]) -> None:
        for node in nodes:
            self._node(node)

    def _node(self, node: Any) -> None:
        path = self._path.AppendChild(name_of(node))
        definition = node.getNodeDef()
        if self._graphs.custom_node(node, path):
            prim = define(self._graphs.layer, path)
        else:
            prim = define(self._graphs.layer, path, "Shader")
            self._primitive(node, definition, prim)
        note_ui(prim, node)
        for element in node.getInputs():
            self.join(input_of(prim, element), element)

    def _primitive(self, node: Any, definition: Any, prim: Sdf.PrimSpec) -> None:
        if definition is not None:
            set_id(prim, definition)
        for element in node.getInputs():
            made = input_of(prim, element)
            colors = has_colors(element, definition)
            set_value(made, element, colors)
            if element.getType() == "filename" and not colors:  # whatever else reads the file by the graph's interface
                made.SetInfo("colorSpace", RAW)
            note_input_ui(made, element)
        for output in outputs_of(definition):
            note_ui(typed_attribute(prim, f"outputs:{name_of(output)}", output.getType()), output)

    def join(self, made: Sdf.AttributeSpec, element: Any) -> None:
        """Connect what an input or output element says that it is connected to."""
        if interface := element.getAttribute("interfacename"):
            connect(made, self._path.AppendProperty(f"inputs:{identifier(interface)}"))
        elif node := element.getAttribute("nodename"):
            source = self._node_output(node, element.getAttribute("output"))
            if source is not None:
                connect(made, source)
        elif graph := element.getAttribute("nodegraph"):
            found = self._graphs.of_name(graph)
            if found is not None and found != self._path:
                output = element.getAttribute("output") or "out"
                connect(made, self._graphs.place(found, self._path).AppendProperty(f"outputs:{identifier(output)}"))

    def _node_output(self, name: str, output: str) -> Sdf.Path | None:
        node = self._container.getNode(name)
        if node is None:
            return None
        names = [name_of(found) for found in outputs_of(node.getNodeDef())] or ["out"]
        chosen = identifier(output) if output and identifier(output) in names else names[0]
        return self._path.AppendChild(name_of(node)).AppendProperty(f"outputs:{chosen}")


def set_id(prim: Sdf.PrimSpec, definition: Any) -> None:
    Sdf.AttributeSpec(prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform).default = definition.getName()


def outputs_of(definition: Any) -> Iterator[Any]:
    seen: set[str] = set()
    for one in definition_stack(definition) if definition is not None else ():
        for output in one.getOutputs():
            if output.getName() not in seen:
                seen.add(output.getName())
                yield output
