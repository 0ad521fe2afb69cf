"""Data that a pattern reads from outside: primvars of shapes and texture files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from .shading import UV_TEXTURE, NodeOutput, Pattern, PatternNode, PrimvarInput, TextureFile, TextureInput

COLOR_PRIMVAR = "displayColor"  # the primvar that geomcolor reads
# MaterialX's names of geometric properties that an input may have as its default: node category and space.
GEOMPROPS = {
    "UV0": ("texcoord", ""), "Pobject": ("position", "object"), "Pworld": ("position", "world"),
    "Nobject": ("normal", "object"), "Nworld": ("normal", "world"), "Tobject": ("tangent", "object"),
    "Tworld": ("tangent", "world"), "Bobject": ("bitangent", "object"), "Bworld": ("bitangent", "world"),
    "Vworld": ("viewdirection", "world"),
}  # fmt: skip
_BY_SET = {"texcoord": 2, "tangent": 2, "bitangent": 2}  # number of components, of nodes that read a set of texture coordinates
_READS_PRIMVARS = frozenset({*_BY_SET, "geomcolor", "geompropvalue"})
_CHANNELS = {"float": "r", "color4": "rgba", "vector4": "rgba"}


def primvar_of_set(index: int) -> str:
    """Return the primvar of a numbered set of texture coordinates."""
    return "st" if index == 0 else f"st{index}"


def pattern_primvars(pattern: Pattern) -> dict[str, int]:
    """Return the primvars that the pattern reads, with the number of components of each."""
    found: dict[str, int] = {}
    for node in pattern.nodes:
        for name, width in _primvars_of(node):
            found[name] = max(found.get(name, 0), width)
    return found


def pattern_fallbacks(pattern: Pattern, name: str) -> set[tuple[float, ...] | None]:
    """Return the values that nodes use if the primvar is missing; None for one computed by another node."""
    found: set[tuple[float, ...] | None] = set()
    for node in pattern.nodes:
        for width in (width for read, width in _primvars_of(node) if read == name):
            default = dict(node.inputs).get("default", (0.0,) * width) if node.category == "geompropvalue" else (0.0,) * width
            found.add(default if isinstance(default, tuple) else None)
    return found


def _primvars_of(node: PatternNode) -> list[tuple[str, int]]:
    found = [(primvar_of_set(0), 2) for _, v in node.inputs if type(v) is str and GEOMPROPS.get(v, ("", ""))[0] in _BY_SET]
    if node.category not in _READS_PRIMVARS:
        return found
    inputs = dict(node.inputs)
    if node.category in _BY_SET:
        index = inputs.get("index", (0.0,))
        found.append((primvar_of_set(int(index[0]) if isinstance(index, tuple) else 0), 2))
    if node.category == "geomcolor":
        found.append((COLOR_PRIMVAR, 4 if node.type == "color4" else 3))
    name = inputs.get("geomprop")
    if node.category == "geompropvalue" and isinstance(name, str) and name:
        found.append((name, int(node.type[-1]) if node.type[-1].isdigit() else 1))
    return found


def pattern_files(pattern: Pattern) -> dict[TextureFile, set[str]]:
    """Return the files that the pattern reads, with the channels of each, in order of use."""
    found: dict[TextureFile, set[str]] = {}
    for node in pattern.nodes:
        for _, value in node.inputs:
            if isinstance(value, TextureFile) and value.path:
                named = dict(node.inputs)["channels"] if node.category == UV_TEXTURE else None
                channels = named if isinstance(named, str) else _CHANNELS.get(node.type, "rgb")
                found.setdefault(value, set()).update(channels)
    return found


def plain_images(pattern: Pattern | None) -> Iterator[TextureInput]:
    """Yield the pattern's images whose coordinates are a primvar, not computed."""
    for node in pattern.nodes if pattern is not None else ():
        inputs = dict(node.inputs)
        file, name = inputs.get("file"), _coordinates_of(pattern, inputs)
        if isinstance(file, TextureFile) and name:
            yield TextureInput(file, "rgb", PrimvarInput(name, (0.0, 0.0)))


def _coordinates_of(pattern: Pattern | None, inputs: Mapping[str, object]) -> str:
    """Return the primvar with an image's coordinates, or "" if they are computed."""
    given = inputs.get("texcoord", inputs.get("st", "UV0"))
    if isinstance(given, NodeOutput) and pattern is not None:
        node = pattern.nodes[given.node]
        read = _primvars_of(node) if node.category in ("texcoord", "geompropvalue") else []
        return read[0][0] if read and read[0][1] == 2 else ""
    return primvar_of_set(0) if given == "UV0" else ""


def reads_world_space(pattern: Pattern, node: int) -> bool:
    """Return whether a node's outputs depend on the shape's placement in the world."""
    return any(
        type(value) is str and (value == "world" or GEOMPROPS.get(value, ("", ""))[1] == "world")
        for above in nodes_above(pattern, node)
        for _, value in above.inputs
    )


def reads_view(pattern: Pattern, node: int) -> bool:
    """Return whether a node's outputs depend on the direction from which they are seen."""
    return any(
        above.category == "viewdirection"
        or any(type(v) is str and GEOMPROPS.get(v, ("", ""))[0] == "viewdirection" for _, v in above.inputs)
        for above in nodes_above(pattern, node)
    )


def nodes_above(pattern: Pattern, node: int) -> list[PatternNode]:
    """Return the node and all nodes upstream of it."""
    found: set[int] = set()
    left = [node]
    while left:
        number = left.pop()
        if number not in found:
            found.add(number)
            left += [v.node for _, v in pattern.nodes[number].inputs if isinstance(v, NodeOutput)]
    return [pattern.nodes[number] for number in sorted(found)]
