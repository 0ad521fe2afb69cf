"""Recipes: materials whose networks differ only in numbers are translated once; later ones repeat that with their own numbers.

The second material whose prims have the same names leaves a recipe: what was read of each prim (schemas, id, properties,
connections, texts), which numbers were read, and the library nodes that were made of them. A material for which all these reads
give the same is translated by making the same nodes. The surface's inputs are read anew each time, since what becomes of them
depends on their values. Nothing is shared where a file, a primvar reader or a diagnostic of the network is involved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pxr import Sdf, Usd

from ...description import NodeOutput, Operand
from ..scene.color_spaces import color_in_rendering_space, scope_at
from ..scene.context import NO_COLOR_SCOPE, Context
from ..stage.reads import connections, has_color_space, property_names, shader_id
from ..stage.values import value
from .authored import AuthoredAttribute, AuthoredPrim, attribute_of
from .materialx.definitions import COLORS, Definition, InputDefinition
from .materialx.expressions import Expressions, Outputs, TooManyNodesError, is_hair_node
from .network import Constant, Network, Node
from .node_values import WITHOUT_EFFECT, NodeValues, as_wide, definition_of
from .translated_material import Material
from .usd_nodes import USD_NODES

MOST = 8  # materials, among those whose prims have the same names, that are to leave a recipe
_NOT_SHARED = frozenset({*WITHOUT_EFFECT, "time", "frame"})  # categories of nodes that read more than their inputs
_LITERAL = -1


@dataclass(frozen=True, slots=True)
class _Attribute:
    """What was read of an attribute: connections (relative to the material), else a number or something else (`fixed`)."""

    name: str
    connections: tuple[str, ...]
    is_number: bool
    has_space: bool  # whether its colour space was asked for; there was none
    fixed: Any


@dataclass(frozen=True, slots=True)
class _Part:
    """What was read of a prim; `path` is relative to the material, None for the material itself."""

    path: Sdf.Path | None
    info: Usd.PrimTypeInfo
    names: list[str]
    id: str | None
    is_below: bool  # whether its parent is not among the parts: its colour space is to be looked at
    attributes: tuple[_Attribute, ...]


@dataclass(frozen=True, slots=True)
class _Call:
    """A library node: inputs are numbers of earlier operands, or literals; `outputs` have their widths."""

    name: str
    inputs: tuple[tuple[str, int, Operand | None], ...]
    path: str | None  # relative to the material; None for nodes that convert between others
    outputs: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Recipe:
    """How a material is translated. Operands are numbered: constants first, then the outputs of calls."""

    parts: tuple[_Part, ...]
    constants: tuple[tuple[int, InputDefinition], ...]  # which number, as what it is read
    calls: tuple[_Call, ...]
    given: tuple[tuple[str, int, Operand | None], ...]  # inputs of the surface shader
    shader: str  # path relative to the material
    definition: Definition

    def material(self, prim: Usd.Prim, ctx: Context) -> Material | None:
        """Return the material of a prim that this is the recipe for, else None."""
        from .models.surface_nodes import material_of

        numbers = self._numbers(prim, ctx)
        made = None if numbers is None else self._constants(numbers, ctx)
        if made is None:
            return None
        path, expressions = ctx.shown(str(prim.GetPath())), Expressions()
        try:
            for call in self.calls:
                inputs = {name: made[at] if at >= 0 else fixed for name, at, fixed in call.inputs}
                outputs = expressions.node(call.name, inputs, "" if call.path is None else path + call.path)  # type: ignore[arg-type]
                if len(outputs) != len(call.outputs):
                    return None
                for name, width in call.outputs:
                    found = outputs.get(name)
                    if found is None or expressions.width(found) != width:
                        return None
                    made.append(found)
            given: Any = {name: made[at] if at >= 0 else fixed for name, at, fixed in self.given}
            material, told = material_of(self.definition, given, expressions, path)
        except TooManyNodesError:
            return None
        if told:
            ctx.warn("material-input", path + self.shader, told)
        return material

    def _numbers(self, prim: Usd.Prim, ctx: Context) -> list[tuple[Any, Usd.Attribute]] | None:
        """Return the values of the attributes that are numbers; None where anything else differs."""
        before, when = str(prim.GetPath()), ctx.when
        found: list[tuple[Any, Usd.Attribute]] = []
        for part in self.parts:
            at = prim if part.path is None else prim.GetPrimAtPath(part.path)
            if not at or at.GetPrimTypeInfo() != part.info:
                return None
            if property_names(at) != part.names:
                return None
            if part.id is not None and _id(at, ctx) != part.id:
                return None
            if part.is_below and scope_at(at.GetParent(), ctx) is not NO_COLOR_SCOPE:
                return None
            for each in part.attributes:  # names and types are equal, so that it exists
                attribute = attribute_of(at, each.name)
                leads = connections(attribute)
                if leads:
                    if [path.pathString for path in leads] != [before + path for path in each.connections]:
                        return None
                    continue
                if each.connections or (each.has_space and has_color_space(attribute)):
                    return None
                own = value(attribute, when)
                if each.is_number:
                    found.append((own, attribute))
                elif type(own) is not type(each.fixed) or own != each.fixed:
                    return None
        return found

    def _constants(self, numbers: list[tuple[Any, Usd.Attribute]], ctx: Context) -> list[Operand] | None:
        made: list[Operand] = []
        for at, wanted in self.constants:
            raw, attribute = numbers[at]
            values = as_wide(raw, wanted)
            if values is None:
                return None
            if wanted.type in COLORS:
                r, g, b = values[:3]
                values = (*color_in_rendering_space((r, g, b), attribute, NO_COLOR_SCOPE, ctx, own=""), *values[3:])
            made.append(values)
        return made


def _id(shader: Usd.Prim, ctx: Context) -> str:
    known = ctx.caches.shader_ids.get(shader.GetPath())
    return shader_id(shader) if known is None else known


class Recording(Expressions):
    """The pattern graph of a material that leaves a recipe: each constant, and each output of a node, is an object of its own,
    by which it is recognized where it is read."""

    def __init__(self) -> None:
        super().__init__()
        self.refused = False  # what cannot be repeated was read
        self.shader: Node | None = None
        self.definition: Definition | None = None
        self.material: Material | None = None
        self.told = ""
        self._is_open = True  # whether nodes are those of the network, not yet of the surface
        self._constants: list[tuple[AuthoredAttribute, InputDefinition]] = []
        self._calls: list[tuple[str, list[tuple[str, Operand]], str, list[tuple[str, Operand]]]] = []
        self._given: dict[str, Operand] = {}
        self._origins: dict[int, tuple[Operand, tuple[bool, int]]] = {}  # by id of the operands, which stay alive here
        self._outputs = 0

    def constant(self, attribute: AuthoredAttribute, wanted: InputDefinition, values: tuple[float, ...]) -> Operand:
        own = (*values,)
        self._origins[id(own)] = own, (True, len(self._constants))
        self._constants.append((attribute, wanted))
        return own

    def node(self, name: str, inputs: Mapping[str, Operand], path: str = "") -> Outputs:
        made = super().node(name, inputs, path)
        if not self._is_open:
            return made
        own = {name: (*found,) if type(found) is tuple else replace(found) if type(found) is NodeOutput else found
               for name, found in made.items()}  # fmt: skip
        self._calls.append((name, list(inputs.items()), path, list(own.items())))
        for found in own.values():
            self.refused |= not isinstance(found, tuple | NodeOutput)
            self._origins[id(found)] = found, (False, self._outputs)
            self._outputs += 1
        return own

    def primitive(self, category: str, kind: str, signature: str, inputs: Mapping[str, Operand], path: str = "") -> NodeOutput:
        self.refused |= self._is_open
        return super().primitive(category, kind, signature, inputs, path)

    def close(self, shader: Node, found: Definition, given: dict[str, Operand]) -> None:
        """Note the surface shader and its inputs, which are all that is read of the network."""
        self._is_open, self.shader, self.definition, self._given = False, shader, found, dict(given)

    def values(self, ctx: Context) -> RecordedValues:
        """Return what evaluates the network."""
        return RecordedValues(ctx, self)

    def recipe(self, network: Network, root: AuthoredPrim, made: Material, ctx: Context) -> Recipe | None:
        """Return the recipe; None where the translation depends on more than a recipe holds."""
        if self.refused or self.shader is None or self.definition is None or made is not self.material:
            return None
        if len(ctx.diagnostics) != bool(self.told):
            return None
        before = root.path.pathString
        read_as_numbers = {id(attribute) for attribute, _ in self._constants}
        order: dict[int, int] = {}
        parts, known = [], {prim.path for prim in network.prims}
        for prim in list(network.prims):
            part = _part(prim, root, known, read_as_numbers, order)
            if part is None or scope_at(prim.prim, ctx) is not NO_COLOR_SCOPE:
                return None
            parts.append(part)
        shown = ctx.shown(before)
        calls = []
        for name, inputs, path, outputs in self._calls:
            if path and not path.startswith(shown + "/"):
                return None
            widths = tuple((output, self.width(made)) for output, made in outputs)
            calls.append(_Call(name, self._numbered(inputs), path[len(shown) :] if path else None, widths))
        return Recipe(
            tuple(parts),
            tuple((order[id(attribute)], wanted) for attribute, wanted in self._constants),
            tuple(calls),
            self._numbered(list(self._given.items())),
            self.shader.path.pathString[len(before) :],
            self.definition,
        )

    def _numbered(self, inputs: list[tuple[str, Operand]]) -> tuple[tuple[str, int, Operand | None], ...]:
        made: list[tuple[str, int, Operand | None]] = []
        for name, operand in inputs:
            origin = self._origins.get(id(operand))
            if origin is None:
                made.append((name, _LITERAL, operand))
            else:
                is_constant, at = origin[1]
                made.append((name, at if is_constant else len(self._constants) + at, None))
        return tuple(made)


def _part(
    prim: AuthoredPrim, root: AuthoredPrim, known: set[Sdf.Path], numbers: set[int], order: dict[int, int]
) -> _Part | None:
    """Return what was read of a prim, None where that cannot be repeated; `order` gets the attributes that are numbers."""
    if prim is not root and not prim.path.HasPrefix(root.path):
        return None
    read = prim.__dict__
    if read.get("module") or read.get("is_principled"):
        return None
    before, attributes = root.path.pathString, []
    for name, attribute in prim.attributes_read.items():
        if attribute is None:
            if name in read.get("names", ()):  # a relationship
                return None
            continue
        asked = attribute.__dict__
        leads = [path.pathString for path in attribute.connections]
        if "layer" in asked or asked.get("default_node") or asked.get("color_space"):
            return None
        if any(not (path.startswith((before + "/", before + "."))) for path in leads):
            return None
        fixed, is_number = asked.get("value"), id(attribute) in numbers
        if is_number:
            order[id(attribute)] = len(order)
        elif not (fixed is None or isinstance(fixed, str | bool | int | float)):
            return None
        relative = tuple(path[len(before) :] for path in leads)
        attributes.append(_Attribute(name, relative, is_number, "color_space" in asked, fixed))
    path = None if prim is root else prim.path.MakeRelativePath(root.path)
    is_below = path is None or prim.path.GetParentPath() not in known
    return _Part(path, prim.prim.GetPrimTypeInfo(), prim.names, read.get("id"), is_below, tuple(attributes))


class RecordedValues(NodeValues):
    """Evaluation of a network that leaves a recipe."""

    def __init__(self, ctx: Context, recording: Recording) -> None:
        super().__init__(ctx, recording)
        self._recording = recording

    def constant(self, source: Constant, wanted: InputDefinition, node: Node) -> Operand | None:
        made = super().constant(source, wanted, node)
        return self._recording.constant(source.attribute, wanted, made) if isinstance(made, tuple) else made

    def _input(self, node: Node, wanted: InputDefinition, found: Definition) -> Operand | None:
        self._recording.refused |= wanted.type == "filename"
        return super()._input(node, wanted, found)

    def _outputs(self, source: Node, reader: Node, name: str, width: int, is_color: bool) -> Outputs | None:
        found = definition_of(source)
        self._recording.refused |= (
            found is None or source.id in USD_NODES or found.category in _NOT_SHARED or is_hair_node(found.name)
        )
        return super()._outputs(source, reader, name, width, is_color)
