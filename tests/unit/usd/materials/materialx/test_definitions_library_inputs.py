"""Every input of every node of MaterialX's libraries is read, or reported where it is not at rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest
from tests.unit.usd.material_text import material, node, surface_of

from primray.core.patterns.program import Node, Value
from primray.core.patterns.tape_upload import NODES, Graph, UnknownNodeError
from primray.description import NodeOutput, Pattern, PatternNode, TextureFile
from primray.description.shading import GEOMPROPS
from primray.usd.materials.materialx.definitions import CLOSURES, Definition, definition, graph
from primray.usd.materials.materialx.documents import library
from primray.usd.materials.materialx.expressions import Expressions
from primray.usd.materials.node_values import WITHOUT_EFFECT

REMARKS = {("dot", "note")}
WITH_ANOTHER = {("blur", "filtertype")}  # has an effect with an input that has none
BY_TRANSLATION = {"framerange", "frameoffset", "frameendaction", "layer"}  # they choose the file
BY_IMAGES = {"filtertype"}  # read where a tape's images are made
PRIMITIVES = ("geomcolor", "time")
_GIVEN = -1  # in place of a node


def definitions() -> list[Definition]:
    made = [definition(found.getName()) for found in library().getNodeDefs()]
    return [d for d in made if d and d.type not in CLOSURES and not any(i.type in CLOSURES for i in d.inputs)]


def read_by_graph(found: Definition) -> set[str]:
    """The inputs that an output depends on, where nothing is known of any of them."""
    e = Expressions()
    waiting = list(e.expanded(found, {i.name: NodeOutput(_GIVEN, i.name) for i in found.inputs}).values())
    read, seen = set(), set()
    while waiting:
        operand = waiting.pop()
        if isinstance(operand, NodeOutput) and operand.node == _GIVEN:
            read.add(operand.output)
        elif isinstance(operand, NodeOutput) and operand.node not in seen:
            seen.add(operand.node)
            waiting += [value for _, value in e.nodes[operand.node].inputs]
    return read


def test_graphs_read_all_inputs_but_those_that_are_reported() -> None:
    """In both directions: what is reported has no effect indeed."""
    by_graph = [found for found in definitions() if graph(found.name) is not None]
    unread = {(found.category, i.name) for found in by_graph for i in found.inputs if i.name not in read_by_graph(found)}
    ours = {(category, name) for category, names in WITHOUT_EFFECT.items() for name in names}
    assert unread - REMARKS - WITH_ANOTHER == {(category, n) for category, n in ours if category not in PRIMITIVES}


@dataclass
class _Around:
    object_space: bool = False
    read: set[str] = field(default_factory=set)

    def primvar(self, name: str) -> int:
        return 0

    def image(self, file: TextureFile, width: int, node: Node) -> int | None:
        return 0

    def frame(self) -> float:
        return 5.0


class _Spied(Node):
    """A node that remembers which of its inputs are asked for."""

    def text(self, name: str, otherwise: str = "") -> str:
        self.around.read.add(name)  # type: ignore[attr-defined]
        return super().text(name, otherwise)

    def whole(self, name: str, otherwise: int = 0) -> int:
        self.around.read.add(name)  # type: ignore[attr-defined]
        return super().whole(name, otherwise)

    def file(self, name: str) -> TextureFile | None:
        self.around.read.add(name)  # type: ignore[attr-defined]
        return super().file(name)


def unread_by_tape(found: Definition) -> set[str]:
    inputs = tuple((i.name, TextureFile("f", "raw") if i.default is None else i.default) for i in found.inputs)
    own = PatternNode(found.category, found.type, found.name, inputs)
    around = _Around()
    compiled = Graph(Pattern((own,)), around)

    def read(name: str, shift: int) -> Value:
        around.read.add(name)
        operand: Any = dict(inputs)[name]
        if isinstance(operand, tuple):
            return compiled.program.constant(*operand)
        if operand not in GEOMPROPS:
            raise UnknownNodeError(name)
        return compiled._geometry(operand, shift)

    NODES[found.category](_Spied(compiled.program, own, 0, around, read))
    return {name for name, _ in inputs} - around.read


def test_primitives_read_all_inputs_but_those_that_are_reported() -> None:
    left: set[tuple[str, str]] = set()
    for found in definitions():
        if graph(found.name) is None and found.category in NODES and found.width:
            left |= {(found.category, name) for name in unread_by_tape(found)}
    left -= {("image", name) for name in BY_TRANSLATION | BY_IMAGES} | REMARKS
    assert left == {("geomcolor", "index")}
    assert "index" in WITHOUT_EFFECT["geomcolor"]


@pytest.mark.parametrize(
    ("kind", "inputs", "rest"),
    [
        ("ND_blur_color3", "float inputs:size = 0.5", "float inputs:size = 0"),
        ("ND_geomcolor_color3", "int inputs:index = 1", "int inputs:index = 0"),
        ("ND_gltf_colorimage", 'string inputs:uaddressmode = "clamp"', 'string inputs:uaddressmode = "periodic"'),
    ],
)
def test_what_has_no_effect_is_reported_unless_it_is_at_rest(kind: str, inputs: str, rest: str) -> None:
    output = "outcolor" if kind == "ND_gltf_colorimage" else "out"
    fed = f"color3f inputs:emission_color.connect = </m/n.outputs:{output}>"
    for text, codes in ((inputs, {"material-input"}), (rest, set())):
        nodes = node("n", kind, text, f"color3f outputs:{output}")
        found = surface_of(material(fed, nodes, shader="ND_surface_unlit"))[1]
        assert {code for code, path in found if path == "/m/n"} - {"texture-unset"} == codes
