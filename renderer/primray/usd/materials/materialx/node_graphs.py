"""Node graphs of a document, and the nodes at its top level, as prims below /MaterialX/NodeGraphs.

A custom node that a graph implements is a prim that references that graph, so that each node has its own inputs. A value in
another unit than its node expects is converted as it is written; a connected input is multiplied by an additional node.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Sdf

from .document_marks import DEFAULT_NODE
from .layer_writing import (
    GEOMPROP_NODES,
    RAW,
    ROOT,
    GeometricProperties,
    Tokens,
    UnitError,
    Units,
    add_reference,
    connect,
    define,
    input_attribute,
    name_of,
    set_value,
    typed_attribute,
    usd_identifier,
    write_documentation,
    write_input_documentation,
)

GRAPHS = ROOT.AppendChild("NodeGraphs")
_GEOMETRIC_COLORS = (*GEOMPROP_NODES, "geomcolor")
_COLORS = ("color3", "color4")
_IN_UNITS = ("float", "vector2", "vector3", "vector4")  # types whose values can be converted by a multiplication node


def definition_stack(definition: Any) -> list[Any]:
    """Return a nodedef and those that it inherits from, the most distant first."""
    found: list[Any] = []
    document = definition.getDocument()
    while definition is not None and all(definition.getName() != known.getName() for known in found):
        found.append(definition)
        inherited = definition.getAttribute("inherit")
        definition = document.getNodeDef(inherited) if inherited else None
    return found[::-1]


def expected_input(definition: Any, name: str) -> Any:
    """Return the input of a nodedef or of one that it inherits from, None for an unknown name."""
    stack = definition_stack(definition) if definition is not None else []
    return next((found for one in reversed(stack) if (found := one.getInput(name)) is not None), None)


def own(document: Any, category: str) -> list[Any]:
    """Return the document's children of a category, without those of the library."""
    return [child for child in document.getChildren() if child.getCategory() == category]


def has_colors(element: Any, definition: Any) -> bool:
    """Return whether a value may have a colour space: colours, and the files of images of colours."""
    if element.getType() == "filename":
        return any(o.getType() in _COLORS for o in outputs_of(definition))
    return element.getType() in _COLORS


class NodeGraphs:
    """Writer of node graphs to a layer, on demand."""

    def __init__(self, layer: Sdf.Layer, document: Any, meters_per_unit: float) -> None:
        self.layer, self.document = layer, document
        self._units = Units(document, meters_per_unit)
        self._notes: dict[Sdf.Path, list[str]] = {}  # by path of the graph or material
        self._parts: dict[Sdf.Path, set[Sdf.Path]] = {}  # graphs that a graph or a material references
        self._written: set[str] = set()
        self._graphs = {graph.getName(): graph for graph in own(document, "nodegraph")}
        self._definitions = {definition.getName() for definition in own(document, "nodedef")}
        self._with_tokens: dict[tuple[str, Tokens], Sdf.Path] = {}  # one graph of a definition per set of token values
        self.properties = GeometricProperties(document)
        if wrong := expansion_fault(self._graphs, self._definitions):
            raise ValueError(wrong)

    def implementing(self, definition: Any) -> Any:
        """Return the document's graph that implements a nodedef, None where it has none."""
        if definition is None or definition.getName() not in self._definitions:
            return None
        found = definition.getImplementation()
        return self._graphs.get(found.getName()) if found is not None else None

    def of_definitions(self) -> None:
        """Write the graphs that implement nodedefs of the document, under the nodedefs' names."""
        for graph in self._graphs.values():
            if self.implementing(definition := graph.getNodeDef()) is not None:
                self._definition(definition)

    def _definition(self, definition: Any, tokens: Tokens = ()) -> Sdf.Path:
        path = self._path_of(definition, tokens)
        graph = self.implementing(definition)
        if str(path) not in self._written:
            self._written.add(str(path))
            self._write(graph, path, definition, tokens)
        return path

    def _path_of(self, definition: Any, tokens: Tokens) -> Sdf.Path:
        """Return the path of a definition's graph, one for each set of values that nodes give its tokens.

        USD cannot compose file names from parts, so each set of token values needs a graph of its own.
        """
        path = GRAPHS.AppendChild(name_of(definition))
        if not tokens:
            return path
        key = (definition.getName(), tokens)
        if key not in self._with_tokens:
            taken = {*map(usd_identifier, (*self._graphs, *self._definitions)), *(p.name for p in self._with_tokens.values())}
            name = f"{path.name}_tokens_{len(self._with_tokens) + 1}"
            while name in taken:
                name += "_"
            self._with_tokens[key] = GRAPHS.AppendChild(name)
        return self._with_tokens[key]

    def of_name(self, name: str) -> Sdf.Path | None:
        """Return the path of a graph of the document, written if it was not, None for an unknown name."""
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
        """Return the path of the graph of the nodes that are in no graph."""
        if str(GRAPHS) not in self._written:
            self._written.add(str(GRAPHS))
            define(self.layer, GRAPHS, "NodeGraph")
            _Nodes(self, GRAPHS, self.document).write(
                [n for n in self.document.getNodes() if n.getType() not in ("material", "surfaceshader")]
            )
        return GRAPHS

    def _write(self, graph: Any, path: Sdf.Path, definition: Any, tokens: Tokens = ()) -> None:
        prim = define(self.layer, path, "NodeGraph")
        write_documentation(prim, graph)
        nodes = _Nodes(self, path, graph, tokens)
        for interface in (*(definition_stack(definition) if definition is not None else ()), graph):
            for element in interface.getInputs():
                made = input_attribute(prim, element)
                # A definition's defaults are in its own units.
                factor = self._factor(element, _reader(element, graph), path) if interface is graph else 1.0
                set_value(made, element, self._interface_has_colors(element, graph), factor, tokens)
                nodes.set_default(made, element)
                write_input_documentation(made, element)
        nodes.write(graph.getNodes())
        for element in graph.getInputs():
            nodes.join(input_attribute(prim, element), element)
        for output in graph.getOutputs():
            made = typed_attribute(prim, f"outputs:{name_of(output)}", output.getType())
            write_documentation(made, output)
            nodes.join(made, output)

    def has_colors(self, element: Any, definition: Any) -> bool:
        """Return whether a node's input may have a colour space; a custom node's file, if its graph reads it as colours."""
        graph = self.implementing(definition) if element.getType() == "filename" else None
        return has_colors(element, definition) if graph is None else self._interface_has_colors(element, graph)

    def _interface_has_colors(self, element: Any, graph: Any) -> bool:
        """Return whether an input of a graph's interface may have a colour space; a file, if a node reads it as colours."""
        if element.getType() != "filename":
            return has_colors(element, None)
        return any(
            self.has_colors(given, node.getNodeDef())
            for node in graph.getNodes()
            for given in node.getInputs()
            if given.getType() == "filename" and given.getAttribute("interfacename") == element.getName()
        )

    def place(self, source: Sdf.Path, below: Sdf.Path) -> Sdf.Path:
        """Return a prim below another that references a graph elsewhere; the graph itself if it is there already.

        Connections cannot lead out of the prim that encapsulates them.
        """
        path = below.AppendChild(source.name)
        if path == source:
            return source
        self._parts.setdefault(below, set()).add(source)
        add_reference(define(self.layer, path), source)
        return path

    def custom_node(self, node: Any, path: Sdf.Path, tokens: Tokens = ()) -> bool:
        """Write a node as a reference to the document's graph that implements it; return False where none does.

        `tokens`: those of the graph that the node is in.
        """
        definition = node.getNodeDef()
        if self.implementing(definition) is None:
            return False
        prim = define(self.layer, path)
        source = self._definition(definition, _tokens_of(node, tokens))
        self._parts.setdefault(path.GetParentPath(), set()).add(source)
        add_reference(prim, source)
        for element in node.getInputs():
            self.write_value(input_attribute(prim, element), element, definition, path.GetParentPath(), tokens)
        return True

    def write_value(self, made: Sdf.AttributeSpec, element: Any, definition: Any, of: Sdf.Path, tokens: Tokens = ()) -> None:
        """Write the value of a node's input in the unit that the node expects; `of`: the graph or material it belongs to."""
        factor = self.factor(element, definition, of)
        set_value(made, element, self.has_colors(element, definition), factor, tokens)

    def factor(self, element: Any, definition: Any, of: Sdf.Path) -> float:
        """Return the factor from a node input's unit to the unit that the node expects; 1, reported, where it is unknown."""
        if not element.hasAttribute("unit"):
            return 1.0
        return self._factor(element, expected_input(definition, element.getName()), of)

    def _factor(self, element: Any, expected: Any, of: Sdf.Path) -> float:
        try:
            return self._units.factor(element, expected)
        except UnitError as error:
            self.note(of, f"{element.getNamePath()}: {error}. Its unit is not converted.")
            return 1.0

    def note(self, of: Sdf.Path, message: str) -> None:
        """Store a message about a graph or material, to be reported for each material that uses it."""
        self._notes.setdefault(of, []).append(message)

    def notes_of(self, material: Sdf.Path) -> list[str]:
        """Return the messages about a material and everything that it references."""
        if not self._notes:
            return []
        found, waiting = [material], [material]
        while waiting:
            parts = self._parts.get(waiting.pop(), set()).difference(found)
            found += sorted(parts)
            waiting += parts
        return [message for path in found for message in self._notes.get(path, ())]

    def multiplied(self, source: Sdf.Path, path: Sdf.Path, kind: str, factor: float) -> Sdf.Path:
        """Return the output of a node, created at `path`, that multiplies floats or vectors by a factor."""
        prim = define(self.layer, path, "Shader")
        name = "ND_multiply_float" if kind == "float" else f"ND_multiply_{kind}FA"
        set_identifier(prim, name)
        connect(typed_attribute(prim, "inputs:in1", kind), source)
        typed_attribute(prim, "inputs:in2", "float").default = factor
        typed_attribute(prim, "outputs:out", kind)
        return path.AppendProperty("outputs:out")


class _Nodes:
    """Writer of the nodes of one graph, or of the document's top level."""

    def __init__(self, graphs: NodeGraphs, path: Sdf.Path, container: Any, tokens: Tokens = ()) -> None:
        self._graphs, self._path, self._container, self._tokens = graphs, path, container, tokens
        self._prims = {name_of(node) for node in container.getNodes()}

    def write(self, nodes: list[Any]) -> None:
        for node in nodes:
            self._node(node)

    def _node(self, node: Any) -> None:
        path = self._path.AppendChild(name_of(node))
        definition = node.getNodeDef()
        if self._graphs.custom_node(node, path, self._tokens):
            prim = define(self._graphs.layer, path)
        else:
            read = self._read_factor(node, definition)
            at = path if read == 1.0 else self._unused(f"{path.name}_as_read")
            prim = define(self._graphs.layer, at, "Shader")
            self._primitive(node, definition, prim)
            if read != 1.0:
                self._graphs.multiplied(at.AppendProperty("outputs:out"), path, node.getType(), read)
        write_documentation(prim, node)
        for element in node.getInputs():
            if made := prim.attributes.get(f"inputs:{name_of(element)}"):
                self.join(made, element, definition)
        if prim.path != path and (default := prim.attributes.get("inputs:default")):
            self._divide(default, node.getType(), read)

    def set_default(self, made: Sdf.AttributeSpec, element: Any) -> None:
        """Write a node that gives an input of the graph's interface its default geometric property.

        The node is named in the input's metadata and not connected to it, so that a value authored for the input wins.
        """
        if not (name := element.getAttribute("defaultgeomprop")):
            return
        path = self._unused(f"{made.name.removeprefix('inputs:')}_by_default")
        self._graphs.properties.write(define(self._graphs.layer, path, "Shader"), name, element.getType())
        made.SetInfo("customData", {DEFAULT_NODE: path.name})

    def _primitive(self, node: Any, definition: Any, prim: Sdf.PrimSpec) -> None:
        if self._property(node, definition, prim):
            return
        if definition is not None:
            set_identifier(prim, definition.getName())
        if node.getCategory() in _GEOMETRIC_COLORS and node.getType() in _COLORS:
            self._note_color_space(node)
        for element in node.getInputs():
            made = input_attribute(prim, element)
            self._graphs.write_value(made, element, definition, self._path, self._tokens)
            if element.getType() == "filename" and not has_colors(element, definition):
                made.SetInfo("colorSpace", RAW)  # even if another node reads the file as colours through the graph's interface
            write_input_documentation(made, element)
        for output in outputs_of(definition):
            write_documentation(typed_attribute(prim, f"outputs:{name_of(output)}", output.getType()), output)

    def _property(self, node: Any, definition: Any, prim: Sdf.PrimSpec) -> bool:
        """Write a node that reads a property which the document derives from another; return False for all other nodes."""
        given = node.getInput("geomprop") if node.getCategory() in GEOMPROP_NODES else None
        if given is None or not self._graphs.properties.has_own:
            return False
        if given.hasAttribute("interfacename") and self._container.getNodeDef() is None:
            given = given.getInterfaceInput() or given
        elif not given.getValueString():
            self._graphs.note(self._path, f"{given.getNamePath()} is taken as the name of a primvar, not of a geompropdef.")
        name = given.getValueString()
        if not self._graphs.properties.is_own(name):
            return False
        self._graphs.properties.write(prim, name, node.getType())
        return True

    def _note_color_space(self, node: Any) -> None:
        """Report colour spaces on geometric colours, which have no effect: primvars are read in the space that USD says."""
        for element in (node, node.getInput("geomprop")):
            if element is not None and element.hasAttribute("colorspace"):
                space = element.getAttribute("colorspace")
                self._graphs.note(self._path, f"{element.getNamePath()} has the colour space {space!r}, which has no effect.")

    def _read_factor(self, node: Any, definition: Any) -> float:
        """Return the unit factor for numbers that a node reads from a file, or from a geometric property with a unit."""
        files = [element for element in node.getInputs() if element.getType() == "filename" and element.hasAttribute("unit")]
        if files and node.getType() not in _IN_UNITS:
            self._graphs.note(
                self._path, f"{files[0].getNamePath()} has a unit, but its node does not output a float or vector."
            )
            return 1.0
        if files:
            return self._graphs.factor(files[0], definition, self._path)
        named = node.getInput("geomprop") if node.getCategory() == "geompropvalue" else None
        found = self._graphs.document.getGeomPropDef(named.getValueString()) if named is not None else None
        return 1.0 if found is None else self._graphs.factor(found, None, self._path)

    def _divide(self, default: Sdf.AttributeSpec, kind: str, factor: float) -> None:
        """Divide a node's default by the factor that multiplies its output: the default is in the expected unit already."""
        if default.default is not None:
            default.default = default.default / factor
        if sources := default.connectionPathList.explicitItems:
            at = self._unused(f"{default.owner.name}_default")
            connect(default, self._graphs.multiplied(sources[0], at, kind, 1 / factor))

    def _unused(self, name: str) -> Sdf.Path:
        """Return a path that no node of the document has."""
        while name in self._prims or self._graphs.layer.GetPrimAtPath(self._path.AppendChild(name)):
            name += "_"
        return self._path.AppendChild(name)

    def join(self, made: Sdf.AttributeSpec, element: Any, definition: Any = None) -> None:
        """Write the connection of an input or output element, converted from the unit that the element names."""
        self._connect(made, element)
        if not element.hasAttribute("unit") or element.getType() not in _IN_UNITS or not made.connectionPathList.explicitItems:
            return
        factor = self._graphs.factor(element, definition, self._path)
        if factor != 1.0:
            source, at = (
                made.connectionPathList.explicitItems[0],
                self._unused(f"{made.owner.name}_{element.getName()}_in_units"),
            )
            connect(made, self._graphs.multiplied(source, at, element.getType(), factor))

    def _connect(self, made: Sdf.AttributeSpec, element: Any) -> None:
        if interface := element.getAttribute("interfacename"):
            connect(made, self._path.AppendProperty(f"inputs:{usd_identifier(interface)}"))
        elif node := element.getAttribute("nodename"):
            source = self._node_output(node, element.getAttribute("output"))
            if source is not None:
                connect(made, source)
        elif graph := element.getAttribute("nodegraph"):
            found = self._graphs.of_name(graph)
            if found is not None and found != self._path:
                output = element.getAttribute("output") or "out"
                connect(made, self._graphs.place(found, self._path).AppendProperty(f"outputs:{usd_identifier(output)}"))

    def _node_output(self, name: str, output: str) -> Sdf.Path | None:
        node = self._container.getNode(name)
        if node is None:
            return None
        names = [name_of(found) for found in outputs_of(node.getNodeDef())] or ["out"]
        chosen = usd_identifier(output) if output and usd_identifier(output) in names else names[0]
        return self._path.AppendChild(name_of(node)).AppendProperty(f"outputs:{chosen}")


def _reader(element: Any, graph: Any) -> Any:
    """Return the input that determines the unit of a graph's interface input, None where no node has one."""
    for node in graph.getNodes():
        for given in node.getInputs():
            if given.getAttribute("interfacename") == element.getName():
                expected = given if given.hasAttribute("unit") else expected_input(node.getNodeDef(), given.getName())
                if expected is not None and expected.hasAttribute("unit"):
                    return expected
    return None


def _tokens_of(node: Any, outer: Tokens) -> Tokens:
    """Return the values that a node gives to tokens of its graph; `outer`: tokens of the graph that contains the node."""
    found = {}
    for token in node.getTokens():
        text = dict(outer).get(token.getAttribute("interfacename"), token.getValueString())
        for name, value in outer:
            text = text.replace(f"[{name}]", value)
        found[token.getName()] = text
    return tuple(sorted(found.items()))


def set_identifier(prim: Sdf.PrimSpec, name: str) -> None:
    """Set the id of a shader prim to a definition's name."""
    Sdf.AttributeSpec(prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform).default = name


def outputs_of(definition: Any) -> Iterator[Any]:
    """Yield the outputs of a definition and of those that it inherits from, without duplicates."""
    seen: set[str] = set()
    for one in definition_stack(definition) if definition is not None else ():
        for output in one.getOutputs():
            if output.getName() not in seen:
                seen.add(output.getName())
                yield output


MOST_NODES = 100_000  # nodes of one expanded graph


def expansion_fault(graphs: dict[str, Any], definitions: set[str]) -> str:
    """Return what is wrong with a document's graphs: one refers to itself, or exceeds MOST nodes; "" if nothing is."""
    holds = {name: _referenced_graphs(graph, graphs, definitions) for name, graph in graphs.items()}
    sizes: dict[str, int] = {}
    for first in graphs:
        waiting = [(first, iter(holds[first]))]
        above = {first}
        while waiting:
            name, others = waiting[-1]
            other = next((o for o in others if o not in sizes), None)
            if other is None:
                sizes[name] = len(graphs[name].getNodes()) + sum(sizes[o] for o in holds[name])
                waiting.pop()
                above.discard(name)
                if sizes[name] > MOST_NODES:
                    return f"its graph {name} has more than {MOST_NODES:,} nodes when it is expanded"
            elif other in above:
                return f"its graph {other} refers to itself"
            else:
                above.add(other)
                waiting.append((other, iter(holds[other])))
    return ""


def _referenced_graphs(graph: Any, graphs: dict[str, Any], definitions: set[str]) -> list[str]:
    """Return the names of the document's graphs that a graph refers to, once per reference: by nodes and by inputs."""
    found = []
    for node in graph.getNodes():
        definition = node.getNodeDef()
        if definition is not None and definition.getName() in definitions:
            implementation = definition.getImplementation()
            if implementation is not None and implementation.getName() in graphs:
                found.append(implementation.getName())
    named: set[str] = set()
    for element in (graph, *graph.getNodes()):
        named |= {i.getAttribute("nodegraph") for i in element.getInputs()}
    return found + [name for name in sorted(named) if name in graphs and name != graph.getName()]
