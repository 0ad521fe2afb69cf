"""Evaluation of a UsdShade network of MaterialX and USD nodes to operands, through interfaces and node graphs.

Cycles, networks that are too deep, and unknown nodes are reported and count as not connected.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from pxr import Sdf

from ...description import Input, NodeOutput, Operand, Pattern, PatternInput, PrimvarInput, TextureFile
from ..scene.context import Context
from ..scene.notes import note_unknown_schemas
from ..stage.metadata import time_codes_per_second
from .authored import INPUT, AuthoredAttribute
from .materialx.definitions import CLOSURES, COLORS, WIDTHS, Definition, InputDefinition, definition
from .materialx.expressions import MOST_NODES, Expressions, Outputs, TooManyNodesError, hair_node, is_hair_node
from .network import VECTORS, Constant, Node, as_numbers, constant_color
from .surface_inputs import NO_PRIMVAR, Reducer, pruned
from .texture_files import frame_of, texture_file
from .usd_nodes import USD_NODES, is_uv_texture, usd_outputs

DEEPEST = 120  # nodes in a chain of connections
# Inputs by category that neither the library graphs nor the core read: reported unless at their defaults.
WITHOUT_EFFECT: dict[str, tuple[str, ...]] = {
    "blur": ("size",),
    "geomcolor": ("index",),
    "gltf_anisotropy_image": ("operationorder", "uaddressmode", "vaddressmode"),
    "gltf_colorimage": ("operationorder", "uaddressmode", "vaddressmode"),
    "standard_surface_to_UsdPreviewSurface": ("specular", "specular_color"),
    "time": ("fps",),  # "An unused input" (stdlib_defs.mtlx): seconds are the stage's
}


def definition_of(node: Node) -> Definition | None:
    """Return the definition of a node's shader, None where it is unknown."""
    name = node.id
    return definition(name) if name.startswith("ND_") and name not in USD_NODES else USD_NODES.get(name)


@dataclass
class NodeValues:
    """Evaluation of the network of one material."""

    ctx: Context
    expressions: Expressions = field(default_factory=Expressions)
    _made: dict[Sdf.Path | tuple[object, ...], Outputs | None] = field(default_factory=dict)
    _above: list[Sdf.Path] = field(default_factory=list)

    def inputs_of(self, node: Node, found: Definition, beside: frozenset[str] = frozenset()) -> dict[str, Operand]:
        """Return the values of a node's authored inputs, by name.

        `beside`: inputs that the definition does not have, and that the caller reads.
        """
        known = found.by_name
        given: dict[str, Operand] = {}
        for name in node.shader.inputs:
            wanted = known.get(name)
            if name in beside and wanted is None:
                continue
            if wanted is None:
                node.warn("unknown-input", f"{node.id} has no input {name}: it is ignored.", INPUT + name)
            elif wanted.type not in CLOSURES:
                value = self._input(node, wanted, found)
                if value is not None:
                    given[name] = value
        return given

    def _input(self, node: Node, wanted: InputDefinition, found: Definition) -> Operand | None:
        if wanted.type == "filename":
            file = texture_file(node, is_color=found.gives_colors, name=wanted.name)
            return _as_numbers(file) if not found.gives_colors else file
        return self._given(node.shader.attribute(INPUT + wanted.name), wanted, node)

    def _given(self, attribute: AuthoredAttribute | None, wanted: InputDefinition, node: Node) -> Operand | None:
        source = node.network.source(attribute)
        if isinstance(source, Node):
            return self.output(source, WIDTHS.get(wanted.type, 0), node, wanted.name, is_color=wanted.type in COLORS)
        return None if source is None else self.constant(source, wanted, node)

    def given_as(self, node: Node, wanted: InputDefinition) -> Operand:
        """Return the value of a node's input as the type that a definition says, or its default."""
        value = self._given(node.shader.attribute(INPUT + wanted.name), wanted, node)
        default: Operand = "" if wanted.default is None else wanted.default
        return default if value is None else value

    def output(self, source: Node, width: int, reader: Node, name: str, *, is_color: bool = False) -> Operand | None:
        """Return a node's output as `width` numbers, a colour if `is_color`; None, reported, where that is not possible."""
        outputs = self._outputs(source, reader, name, width, is_color)
        value = None if outputs is None else outputs.get(source.output)
        if value is None and outputs and len(outputs) == 1 and source.output in ("out", "result"):
            value = next(iter(outputs.values()))
        if value is not None:
            return self._fitted(value, width, reader, name)
        if outputs is not None:
            source.warn("shader-connection", f"{source.id} has no output {source.output}.")
        if source.id in USD_NODES:
            reader.warn("material-input", f"{name} cannot be read: its default is used.", INPUT + name)
        return None

    def _outputs(self, source: Node, reader: Node, name: str, width: int, is_color: bool) -> Outputs | None:
        path, is_usds = source.path, source.id in USD_NODES
        key = (path, source.output, width, is_color) if is_usds else path
        if key in self._made:
            return self._made[key]
        if path in self._above or len(self._above) >= DEEPEST:
            why = "depends on itself" if path in self._above else f"depends on a chain of more than {DEEPEST} nodes"
            reader.warn("shader-connection", f"{name} {why}: its default is used.", INPUT + name)
            return None
        found = definition_of(source)
        if found is None or found.type in CLOSURES:
            what = source.id or "a shader without id"
            message = f"{name} is connected to {what}, which is not supported: its default is used."
            reader.warn("shader-ignored", message, INPUT + name)
            made = None
        else:
            note_unknown_schemas(source.shader.prim, source.shown, self.ctx)
            self._above.append(path)
            made = (
                usd_outputs(source, partial(self.given_as, source), self.expressions, width, is_color)
                if is_usds
                else self._made_of(found, self.inputs_of(source, found), source)
            )
            self._above.pop()
        self._made[key] = made
        return made

    def _made_of(self, found: Definition, given: dict[str, Operand], source: Node) -> Outputs:
        path = source.path
        for name in WITHOUT_EFFECT.get(found.category, ()):
            if given.get(name, found.defaults[name]) != found.defaults[name]:
                source.warn("material-input", f"{name} of {found.category} has no effect.", INPUT + name)
        if found.category in ("time", "frame"):
            frame_of(source)
            given = {"fps": (time_codes_per_second(self.ctx.stage),)}
        if not is_hair_node(found.name):
            return self.expressions.node(found.name, given, self.ctx.shown(str(path)))
        return hair_node(self.expressions, found.name, {**found.default_operands, **given})

    def constant(self, source: Constant, wanted: InputDefinition, node: Node) -> Operand | None:
        """Return a constant as the input's type, colours in the rendering space; None, reported, where the type differs."""
        if wanted.type not in WIDTHS:
            if isinstance(source.value, str):
                return str(source.value)
            message = f"{wanted.name} = {source.value!r} is not a string: its default is used."
            node.warn("wrong-type", message, INPUT + wanted.name)
            return None
        values = as_wide(source.value, wanted)
        if values is None:
            message = f"{wanted.name} = {source.value!r} is not {WIDTHS[wanted.type]} finite numbers: its default is used."
            node.warn("wrong-type", message, INPUT + wanted.name)
            return None
        return constant_color(values, source, self.ctx) if wanted.type in COLORS else values

    def _fitted(self, value: Operand, width: int, reader: Node, name: str) -> Operand | None:
        """Return a value converted to the width of the input that reads it: one number repeated, or the first of several."""
        has = self.expressions.width(value)
        if has == width:
            return value
        if not width or not has:
            message = f"{name} or what it is connected to is not numeric: its default is used."
            reader.warn("connection-type", message, INPUT + name)
            return None
        if has == 1 and width in (2, 3, 4):
            kind = {2: "vector2", 3: "color3", 4: "color4"}[width]
            return self.expressions.apply(f"ND_convert_float_{kind}", **{"in": value})
        if width == 1 and has in (2, 3, 4):
            reader.warn("connection-type", f"{name} is connected to {has} numbers: the first is used.", INPUT + name)
            kind = {2: "vector2", 3: "color3", 4: "color4"}[has]
            return self.expressions.apply(f"ND_extract_{kind}", **{"in": value, "index": (0.0,)})
        if (has, width) in ((4, 3), (3, 4)):
            return self.expressions.apply(f"ND_convert_color{has}_color{width}", **{"in": value})
        message = f"{name} takes {width} numbers and is connected to {has}: its default is used."
        reader.warn("connection-type", message, INPUT + name)
        return None


def as_wide(raw: object, wanted: InputDefinition) -> tuple[float, ...] | None:
    """Return a value as the finite numbers of an input, one number repeated; None where it is something else."""
    values, width = as_numbers(_flat(raw)), WIDTHS[wanted.type]
    if values is not None and len(values) == 1 and width > 1 and not wanted.type.startswith("matrix"):
        values = values * width
    return None if values is None or len(values) != width else values


def _as_numbers(file: Operand) -> Operand:
    """Return an image file that does not give colours, its texels unconverted unless a colour space is authored."""
    if isinstance(file, TextureFile) and file.color_space == "auto":
        return replace(file, color_space="raw", is_color=False)
    return file


def _flat(value: object) -> object:
    """Return a matrix's rows as one list; other values unchanged."""
    if isinstance(value, (int, float)):
        return float(value)
    if type(value) in VECTORS:
        return value
    try:
        rows = [tuple(row) for row in value]  # type: ignore[attr-defined]
    except TypeError:
        return value
    return [x for row in rows for x in row]


class FedInputs:
    """Evaluation of the connected inputs of one surface."""

    def __init__(self, ctx: Context) -> None:
        self._values = NodeValues(ctx)

    def read(
        self, shader: Node, source: Node, name: str, width: int, *, is_color: bool = False
    ) -> Input | tuple[float, ...] | None:
        """Return an input's value, constant or varying; None, reported, where it cannot be read.

        Normals are in tangent space.
        """
        try:
            value = self._values.output(source, width, shader, name, is_color=is_color)
            if name == "normal":
                return self._normal(value, source)
        except TooManyNodesError:
            message = f"{name} is connected to more than {MOST_NODES:,} nodes: its default is used."
            shader.warn("shader-ignored", message, INPUT + name)
            return None
        if isinstance(value, NodeOutput):
            return Reducer(self._values.expressions.nodes).input(value, width)
        return value if isinstance(value, tuple) else None

    def pattern_of(self, inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
        """Return the pattern that varying inputs read, without unused nodes, and the inputs renumbered."""
        return pruned(self._values.expressions.nodes, inputs)

    def _normal(self, value: Operand | None, source: Node) -> Input | None:
        """Return a normal input: a texture or primvar as it is, else a MaterialX normalmap of the value moved to 0 to 1.

        A normal map without a file leaves the surface's own normal, whatever its fallback is.
        """
        if isinstance(value, tuple):
            faces_out = len(value) == 3 and value[2] > 0 and not is_uv_texture(source.id)
            return PrimvarInput(NO_PRIMVAR, value) if faces_out else None
        if not isinstance(value, NodeOutput):
            return None
        e = self._values.expressions
        reducer = Reducer(e.nodes)
        found = reducer.input(value, 3)
        if not isinstance(found, PatternInput):
            return found
        halved = e.apply("ND_multiply_vector3FA", in1=value, in2=(0.5,))
        mapped = e.apply("ND_normalmap_float", **{"in": e.apply("ND_add_vector3FA", in1=halved, in2=(0.5,))})
        return reducer.normal(mapped) if isinstance(mapped, NodeOutput) else None
