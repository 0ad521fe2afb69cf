"""Evaluation of networks of another renderer's nodes: the table of its nodes, and the inputs that a node's rule reads.

A network may also contain USD's and MaterialX's nodes, which are evaluated as everywhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ....description import Operand
from ..authored import INPUT
from ..materialx.definitions import WIDTHS, InputDefinition
from ..materialx.expressions import Expressions, Outputs
from ..models.open_pbr import NORMAL, KnownSurface, Reader
from ..network import Constant, Node, as_numbers
from ..node_values import DEEPEST, NodeValues
from ..usd_nodes import USD_NODES

ANY = object()  # instead of a neutral value: the input has no effect on an image, whatever its value
_COMPONENTS = {2: "xy", 3: "rgbxyz", 4: "rgba"}
_KINDS = {1: "float", 2: "vector2", 3: "color3", 4: "color4"}


@dataclass(frozen=True)
class Vocabulary:
    """The supported shaders of one renderer, by their ids."""

    renderer: str
    kind_of: Callable[[Node], str]  # the node's key in the tables, "" for other renderers' nodes
    surfaces: Mapping[str, Callable[[RendererInputs], KnownSurface | None]]
    nodes: Mapping[str, Callable[[RendererInputs], Operand | Outputs | None]]
    neutral: Mapping[str, object]  # inputs that no rule reads, and the value at which they have no effect, or ANY
    colors_shine: bool = False  # whether a colour node may be bound as a surface, which emits its colour


@dataclass
class RendererNodeValues(NodeValues):
    """Evaluation of one material's network.

    `used`: the nodes that its surface reads, in the order in which they are reached.
    """

    vocabulary: Vocabulary = field(kw_only=True)
    used: list[RendererInputs] = field(default_factory=list)

    def inputs_read(self, node: Node) -> RendererInputs:
        """Return the inputs of a node, which count as used from here on."""
        made = RendererInputs(node, self)
        self.used.append(made)
        return made

    def surface(self, shader: Node) -> KnownSurface | None:
        """Return the surface that a shader describes, None for unknown shaders."""
        kind = self.vocabulary.kind_of(shader)
        read = self.vocabulary.surfaces.get(kind)
        if shader.path in self._above or len(self._above) >= DEEPEST:
            return None
        if read is None:
            if not self.vocabulary.colors_shine or kind not in self.vocabulary.nodes:
                return None
            shining = self.output(shader, 3, shader, shader.output, is_color=True)
            return None if shining is None else KnownSurface(unlit=True, emission=shining)
        self._above.append(shader.path)
        made = read(self.inputs_read(shader))
        self._above.pop()
        return made

    def output(self, source: Node, width: int, reader: Node, name: str, *, is_color: bool = False) -> Operand | None:
        """Return a node's output as `width` numbers: all of it, or the channel that the output's name says."""
        rule = self.vocabulary.nodes.get(self.vocabulary.kind_of(source))
        if rule is None:
            return super().output(_by_own_output(source, width), width, reader, name, is_color=is_color)
        outputs = self._evaluated(source, rule, reader, name)
        if outputs is None:
            return None
        value = outputs.get(source.output)
        if value is None:
            value = self._channel(outputs[""], _channel_name(source.output)) if "" in outputs else None
        if value is None:
            source.warn("shader-connection", f"{source.id} has no output {source.output}.")
            return None
        return self._fitted(value, width, reader, name)

    def _evaluated(
        self, source: Node, rule: Callable[[RendererInputs], Operand | Outputs | None], reader: Node, name: str
    ) -> Outputs | None:
        """Return the outputs of a node's rule by name, "" being the whole value; alpha is a separate evaluation."""
        key = (source.path, _channel_name(source.output) == "a")
        if key in self._made:
            return self._made[key]
        if source.path in self._above or len(self._above) >= DEEPEST:
            why = "depends on itself" if source.path in self._above else f"depends on a chain of more than {DEEPEST} nodes"
            reader.warn("shader-connection", f"{name} {why}: its default is used.", INPUT + name)
            return None
        self._above.append(source.path)
        made = rule(self.inputs_read(source))
        self._above.pop()
        self._made[key] = made if made is None or isinstance(made, Mapping) else {"": made}
        return self._made[key]

    def _channel(self, value: Operand, channel: str) -> Operand:
        has = self.expressions.width(value)
        if not channel or has == 1:
            return value
        index = "rgba".find(channel) if channel in "rgba" else "xyz".find(channel)
        if index >= has:
            return (1.0,) if channel == "a" else (0.0,)
        return self.expressions.apply(f"ND_extract_{_KINDS[has]}", **{"in": value, "index": (float(index),)})

    def given_as(self, node: Node, wanted: InputDefinition) -> Operand:
        """Return the value of an input, with components that are connected one by one (`inputs:NAME:r`) replaced."""
        whole = super().given_as(node, wanted)
        width = WIDTHS.get(wanted.type, 0)
        found: dict[int, Operand] = {}
        for letter in _COMPONENTS.get(width, ""):
            attribute = node.shader.attribute(f"{INPUT}{wanted.name}:{letter}")
            if (value := self._given(attribute, InputDefinition(wanted.name, "float", (0.0,)), node)) is not None:
                found["rgba".find(letter) if letter in "rgba" else "xyz".find(letter)] = value
        if not found:
            return whole
        parts = [found.get(i, self._channel(whole, "rgba"[i])) for i in range(width)]
        inputs = {f"in{i + 1}": part for i, part in enumerate(parts)}
        return self.expressions.apply(f"ND_combine{width}_{_KINDS[width]}", **inputs)

    def constant(self, source: Constant, wanted: InputDefinition, node: Node) -> Operand | None:
        """Return a constant as the input's type; colours with and without alpha are converted to each other."""
        values = as_numbers(source.value)
        width = WIDTHS.get(wanted.type, 0)
        if values is not None and (len(values), width) in ((4, 3), (3, 4)):
            source = replace(source, value=(*values, 1.0)[:width])
        return super().constant(source, wanted, node)


def _by_own_output(source: Node, width: int) -> Node:
    """Return a USD node with an output that it has, where another renderer's network names one that it lacks ("out")."""
    found = USD_NODES.get(source.id)
    if found is None or source.output in found.output_widths:
        return source
    channel = _channel_name(source.output)
    colors = channel if channel in found.output_widths else "rgb" if width > 1 else "r"
    return replace(source, output=colors if "rgb" in found.output_widths else found.outputs[0][0])


def _channel_name(output: str) -> str:
    """Return the letter of the channel that an output names ("r", "out:r"), "" for a whole value."""
    last = output.rpartition(":")[2]
    return last if len(last) == 1 and last in "rgbaxyz" else ""


@dataclass
class RendererInputs:
    """The inputs of one node.

    `asked`: names that a rule has read; `lost`: those that cannot be read; `near`: those that are approximated.
    """

    node: Node
    values: RendererNodeValues
    asked: set[str] = field(default_factory=set)
    lost: set[str] = field(default_factory=set)
    near: set[str] = field(default_factory=set)

    @property
    def e(self) -> Expressions:
        return self.values.expressions

    @property
    def kind(self) -> str:
        return self.values.vocabulary.kind_of(self.node)

    @property
    def reader(self) -> Reader:
        """A Reader without inputs, for helpers that surface models share."""
        return Reader({}, self.e)

    @property
    def wants_alpha(self) -> bool:
        return _channel_name(self.node.output) == "a"

    def number(self, name: str, default: float = 0.0) -> Operand:
        return self.operand(name, "float", (default,))

    def color(self, name: str, *default: float) -> Operand:
        return self.operand(name, "color3", default * 3 if len(default) == 1 else default)

    def vector(self, name: str, *default: float) -> Operand:
        return self.operand(name, "vector3", default * 3 if len(default) == 1 else default)

    def alpha(self, name: str, default: float = 1.0) -> Operand:
        """Return the fourth channel of a colour."""
        four = self.operand(name, "color4", (0.0, 0.0, 0.0, default))
        return self.e.apply("ND_extract_color4", **{"in": four, "index": (3.0,)})

    def operand(self, name: str, kind: str, default: tuple[float, ...]) -> Operand:
        self.asked.add(name)
        return self.values.given_as(self.node, InputDefinition(name, kind, default))

    def constants(self, name: str, *default: float) -> tuple[float, ...]:
        """Return an input's constants, as many as the default has; a connected input is lost."""
        source = self.source(name)
        if isinstance(source, Constant):
            kinds = {1: "float", 2: "vector2", 3: "vector3", 4: "vector4"}
            made = self.values.constant(source, InputDefinition(name, kinds[len(default)], default), self.node)
            return made if isinstance(made, tuple) else default
        if isinstance(source, Node):
            self.lost.add(name)
        return default

    def is_on(self, name: str, default: bool = False) -> bool:
        return self.constants(name, float(default))[0] != 0

    def text(self, name: str, default: str = "") -> str:
        source = self.source(name)
        if isinstance(source, Constant) and isinstance(source.value, str):
            return source.value
        if isinstance(source, Node):
            self.lost.add(name)
        return default

    def choice(self, name: str, choices: tuple[str, ...], default: str) -> str:
        """Return one of the choices, authored by name or number; any other value is lost."""
        source = self.source(name)
        if source is None:
            return default
        said: Any = source.value if isinstance(source, Constant) else None
        if isinstance(said, str) and said in choices:
            return said
        if isinstance(said, (int, float)) and 0 <= said < len(choices):
            return choices[int(said)]
        self.lost.add(name)
        return default

    def listed(self, name: str, width: int) -> list[tuple[float, ...]]:
        """Return the elements of an array, each of `width` numbers; empty where it is no such array."""
        source = self.source(name)
        if source is None:
            return []
        try:
            found = [as_numbers(one) for one in source.value] if isinstance(source, Constant) else []
        except TypeError:
            found = []
        made = [one for one in found if one is not None and len(one) == width]
        if not made or len(made) != len(found):
            self.lost.add(name)
            return []
        return made

    def source(self, name: str) -> Constant | Node | None:
        """Return what gives an input its value, None where nothing does."""
        self.asked.add(name)
        return self.node.source(name)

    def shader(self, name: str) -> Node | None:
        """Return the shader that an input of closures is connected to."""
        source = self.source(name)
        return source if isinstance(source, Node) else None

    def normal(self, name: str) -> Operand:
        """Return a world-space normal; without a connection the shape's own, which zero means in these renderers."""
        value = self.vector(name, 0.0)
        if isinstance(value, tuple):
            if any(value):
                self.lost.add(name)
            return NORMAL
        return value

    def left_out(self) -> Iterable[str]:
        """Return the names of authored inputs that have an effect in their renderer and none here."""
        names = {name.partition(":")[0] for name in self.node.shader.inputs}
        rest = self.values.vocabulary.neutral
        return self.lost | {name for name in names - self.asked if name not in rest or not self._is_at(name, rest[name])}

    def _is_at(self, name: str, rest: object) -> bool:
        if rest is ANY:
            return True
        found = self.node.source(name)
        if not isinstance(found, Constant):
            return found is None
        return found.value == rest or as_numbers(found.value) == rest
