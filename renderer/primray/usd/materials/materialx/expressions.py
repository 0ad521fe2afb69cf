"""Pattern graphs under construction: library nodes are expanded, constants folded, equal nodes merged.

An operand is a tuple of numbers, a text, a file, or the output of an existing node. Nodes for the inputs of a hair fibre fold
where all their inputs are constant; otherwise they remain nodes that the core evaluates (formulas: d'Eon et al. 2011 for
melanin, Chiang et al. 2016 for the rest, as the library's node documentation describes them).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

from ....description import NodeOutput, Operand, PatternNode, TextureFile
from .constant_folding import folded
from .definitions import WIDTHS, Definition, FromInterface, FromStep, definition, graph

MOST_NODES = 20_000  # in one material
DEEPEST = 32  # nesting of definitions
_FILES = ("image", "hextiledimage", "hextilednormalmap")

_GIVEN = -1  # index of a pseudo-node whose outputs are the given inputs

Outputs = Mapping[str, Operand]


class TooManyNodesError(Exception):
    """The graph of a material exceeds MOST_NODES."""


@dataclass
class Expressions:
    """The pattern graph of one material, under construction."""

    nodes: list[PatternNode] = field(default_factory=list)
    _known: dict[tuple[object, ...], Outputs] = field(default_factory=dict)

    def node(self, name: str, inputs: Mapping[str, Operand], path: str = "") -> Outputs:
        """Return the outputs of a library node for these inputs, the others at their defaults; KeyError for unknown nodes."""
        found = definition(name)
        if found is None:
            raise KeyError(name)
        defaults = found.defaults
        given = {key: value for key, value in inputs.items() if key in defaults}
        if graph(name) is None:
            return self._primitive(found, {**defaults, **given}, path)
        left = _residual_of(name, frozenset(given))
        made: list[Outputs] = []
        for step in left.steps:
            values = [_actual(o, given, made) if type(o) is NodeOutput else o for o in step.operands]
            made.append(self._primitive(step.definition, dict(zip(step.names, values, strict=True)), path))
        actual = ((key, _actual(o, given, made) if type(o) is NodeOutput else o) for key, o in left.outputs)
        return {key: value for key, value in actual if value is not None}

    def expanded(self, found: Definition, inputs: Mapping[str, Operand], depth: int = 0) -> Outputs:
        """Return the outputs of a library node, its implementation graph expanded to primitives."""
        implementation = graph(found.name)
        if implementation is None or depth > DEEPEST:
            return self._primitive(found, {**found.defaults, **inputs}, "")
        made: list[Outputs] = []
        for step in implementation.steps:
            inner = definition(step.definition)
            given: dict[str, Operand] = {}
            for key, source in step.inputs:
                value = _operand(source, inputs, found, made)
                if value is not None:
                    given[key] = value
            made.append(self.expanded(inner, given, depth + 1) if inner else {})
        outputs = {key: _operand(source, inputs, found, made) for key, source in implementation.outputs}
        return {key: value for key, value in outputs.items() if value is not None}

    def _primitive(self, found: Definition, inputs: dict[str, Operand | None], path: str) -> Outputs:
        """Return the outputs of a primitive; `inputs`: all that it has, in the definition's order."""
        name = found.outputs[0][0]
        if found.category in _FILES:
            if not _is_file(inputs.get("file")):
                default = inputs.get("default")
                return {name: default} if default is not None else {}
            if "layer" in inputs:
                inputs = _with_layer(inputs)
        simple = _without_node(found, inputs)
        if simple is not None:
            return {name: simple}
        key = (found.name, *inputs.values())
        outputs = self._known.get(key)
        if outputs is None:
            index = len(self.nodes)
            if index >= MOST_NODES:
                raise TooManyNodesError
            given = tuple([pair for pair in inputs.items() if pair[1] is not None])
            self.nodes.append(PatternNode(found.category, found.type, found.name, given, path))  # type: ignore[arg-type]
            outputs = self._known[key] = {output: NodeOutput(index, output) for output, _ in found.outputs}
        return outputs

    def primitive(self, category: str, kind: str, signature: str, inputs: Mapping[str, Operand], path: str = "") -> NodeOutput:
        """Return the output of a primitive that needs no library definition; it is not folded."""
        key = (category, kind, *inputs.items())
        outputs = self._known.get(key)
        if outputs is None:
            if len(self.nodes) >= MOST_NODES:
                raise TooManyNodesError
            outputs = self._known[key] = {"out": NodeOutput(len(self.nodes))}
            self.nodes.append(PatternNode(category, kind, signature, tuple(inputs.items()), path))
        made = outputs["out"]
        assert isinstance(made, NodeOutput)
        return made

    def width(self, value: Operand) -> int:
        """Return the number of components of an operand; 0 where it is not numeric."""
        if isinstance(value, tuple):
            return len(value)
        if not isinstance(value, NodeOutput):
            return 0
        if value.output == "out":
            return WIDTHS.get(self.nodes[value.node].type, 0)
        found = definition(self.nodes[value.node].signature)
        return found.output_widths.get(value.output, 0) if found else 0

    def apply(self, name: str, **inputs: Operand) -> Operand:
        """Return the first output of a library node."""
        return next(iter(self.node(name, inputs).values()))


@dataclass(frozen=True)
class _Step:
    """A primitive with all inputs of its definition, in order."""

    definition: Definition
    names: tuple[str, ...]
    operands: tuple[Operand | None, ...]


@dataclass(frozen=True)
class _Residual:
    """The primitives that remain of a library node for a set of given inputs, the others being at their defaults.

    Operands of the node _GIVEN refer to the given inputs, by name.
    """

    steps: tuple[_Step, ...]
    outputs: tuple[tuple[str, Operand], ...]


@cache
def _residual_of(name: str, given: frozenset[str]) -> _Residual:
    """Return what remains of a library node, cached by node and given inputs: most of a large graph folds away."""
    found = definition(name)
    assert found is not None
    trial = Expressions()
    outputs = trial.expanded(found, {key: NodeOutput(_GIVEN, key) for key in sorted(given)})
    steps = []
    for node in trial.nodes:
        own = definition(node.signature)
        assert own is not None
        operands = {**dict.fromkeys(own.defaults), **dict(node.inputs)}
        steps.append(_Step(own, tuple(operands), tuple(operands.values())))
    return _Residual(tuple(steps), tuple(outputs.items()))


def _actual(operand: NodeOutput, given: Mapping[str, Operand], made: list[Outputs]) -> Operand | None:
    """Return the operand that a step's operand refers to."""
    return given[operand.output] if operand.node == _GIVEN else made[operand.node].get(operand.output)


def _without_node(found: Definition, inputs: Mapping[str, Operand | None]) -> Operand | None:
    """Return a node's value where it needs no node (an operand passed through, or folded constants), else None."""
    rule = _RULES.get(found.category)
    if rule is not None:
        simple = rule(found, inputs)
        if simple is not None:
            return simple
    return folded(found, inputs)


def _is_file(value: object) -> bool:
    return (isinstance(value, TextureFile) and value.path != "") or (isinstance(value, NodeOutput) and value.node == _GIVEN)


def _with_layer(inputs: dict[str, Operand | None]) -> dict[str, Operand | None]:
    """Return a file node's inputs with its layer moved into the file, where it belongs."""
    name, read = inputs["layer"], inputs["file"]
    if not isinstance(name, str) or not name or not isinstance(read, TextureFile):
        return inputs
    return {**inputs, "file": replace(read, layer=name), "layer": ""}


def _operand(source: object, inputs: Mapping[str, Operand], found: Definition, made: list[Outputs]) -> Operand | None:
    """Return the operand for a source in a definition's graph."""
    if type(source) is FromStep:
        return made[source.step].get(source.output)
    if type(source) is FromInterface:
        value = inputs.get(source.name)
        return found.defaults.get(source.name) if value is None else value
    return source  # type: ignore[return-value]


_Rule = Callable[[Definition, Mapping[str, Operand | None]], Operand | None]


def _all(value: object, number: float) -> bool:
    return type(value) is tuple and value.count(number) == len(value)


def _as_wide(found: Definition, name: str, inputs: Mapping[str, Operand | None]) -> Operand | None:
    """Return an input if it has as many components as the node's output, else None."""
    return inputs.get(name) if name in found.as_wide else None


def _neutral(number: float, *, either: bool) -> _Rule:
    """Return the rule of an operation whose input `in2` (or `either` input) has a neutral element."""

    def rule(found: Definition, inputs: Mapping[str, Operand | None]) -> Operand | None:
        if _all(inputs.get("in2"), number):
            return _as_wide(found, "in1", inputs)
        return _as_wide(found, "in2", inputs) if either and _all(inputs.get("in1"), number) else None

    return rule


def _product(found: Definition, inputs: Mapping[str, Operand | None]) -> Operand | None:
    if found.type.startswith("matrix"):
        return None
    if _all(inputs.get("in1"), 0.0) or _all(inputs.get("in2"), 0.0):
        return (0.0,) * (found.width or 1)
    return _neutral(1.0, either=True)(found, inputs)


def _mixture(found: Definition, inputs: Mapping[str, Operand | None]) -> Operand | None:
    for number, name in ((0.0, "bg"), (1.0, "fg")):
        if _all(inputs.get("mix"), number):
            return _as_wide(found, name, inputs)
    return inputs.get("fg") if inputs.get("fg") == inputs.get("bg") else None


def _choice(holds: Callable[[float, float], bool]) -> _Rule:
    def rule(found: Definition, inputs: Mapping[str, Operand | None]) -> Operand | None:
        a, b = inputs.get("value1"), inputs.get("value2")
        if not isinstance(a, tuple) or not isinstance(b, tuple) or "in1" not in inputs:
            return None
        return inputs.get("in1" if holds(a[0], b[0]) else "in2")

    return rule


def _same(name: str) -> _Rule:
    return lambda _found, inputs: inputs.get(name)


_RULES: dict[str, _Rule] = {
    "multiply": _product,
    "divide": _neutral(1.0, either=False),
    "add": _neutral(0.0, either=True),
    "subtract": _neutral(0.0, either=False),
    "power": _neutral(1.0, either=False),
    "mix": _mixture,
    "ifgreater": _choice(lambda a, b: a > b),
    "ifgreatereq": _choice(lambda a, b: a >= b),
    "ifequal": _choice(lambda a, b: a == b),
    "constant": _same("value"),
    "dot": _same("in"),
}


HairInputs = Mapping[str, Operand]
_LEAST_COLOR, _LEAST_ROUGHNESS, _LEAST_LEFT = (1e-3,), (1e-3,), (1e-4,)


def _sum_of(e: Expressions, values: list[Operand]) -> Operand:
    total = values[0]
    for value in values[1:]:
        total = e.apply("ND_add_float", in1=total, in2=value)
    return total


def _product_of(e: Expressions, a: Operand, b: Operand) -> Operand:
    return e.apply("ND_multiply_float", in1=a, in2=b)


def _polynomial(e: Expressions, x: Operand, terms: Mapping[int, float]) -> Operand:
    """Return the sum of factors times powers of x."""
    powers: list[Operand] = []
    for power, factor in terms.items():
        value = (1.0,) if power == 0 else e.apply("ND_power_float", in1=x, in2=(float(power),))
        powers.append(_product_of(e, value, (factor,)))
    return _sum_of(e, powers)


def _absorption_from_color(e: Expressions, given: HairInputs) -> dict[str, Operand]:
    divisor = _polynomial(e, given["azimuthal_roughness"], {0: 5.969, 1: -0.215, 2: 2.532, 3: -10.73, 4: 5.574, 5: 0.245})
    color = e.apply("ND_convert_color3_vector3", **{"in": given["color"]})
    inside = e.apply("ND_clamp_vector3FA", **{"in": color, "low": _LEAST_COLOR, "high": (1.0,)})
    root = e.apply("ND_divide_vector3FA", in1=e.apply("ND_ln_vector3", **{"in": inside}), in2=divisor)
    return {"absorption": e.apply("ND_multiply_vector3", in1=root, in2=root)}


def _absorption_from_melanin(e: Expressions, given: HairInputs) -> dict[str, Operand]:
    left = e.apply("ND_subtract_float", in1=(1.0,), in2=given["melanin_concentration"])
    kept = e.apply("ND_max_float", in1=left, in2=_LEAST_LEFT)
    melanin = _product_of(e, e.apply("ND_ln_float", **{"in": kept}), (-1.0,))
    red = given["melanin_redness"]
    parts = (
        ("eumelanin_color", e.apply("ND_subtract_float", in1=(1.0,), in2=red)),
        ("pheomelanin_color", red),
    )
    found = []
    for name, share in parts:
        color = e.apply("ND_convert_color3_vector3", **{"in": given[name]})
        absorbed = e.apply("ND_ln_vector3", **{"in": e.apply("ND_max_vector3FA", in1=color, in2=(1e-6,))})
        by = _product_of(e, _product_of(e, melanin, share), (-1.0,))
        found.append(e.apply("ND_multiply_vector3FA", in1=absorbed, in2=by))
    total = e.apply("ND_add_vector3", in1=found[0], in2=found[1])
    return {"absorption": e.apply("ND_max_vector3FA", in1=total, in2=(0.0,))}


def _roughness(e: Expressions, given: HairInputs) -> dict[str, Operand]:
    def inside(value: Operand) -> Operand:
        return e.apply("ND_clamp_float", **{"in": value, "low": _LEAST_ROUGHNESS, "high": (1.0,)})

    width = _polynomial(e, inside(given["longitudinal"]), {1: 0.726, 2: 0.812, 20: 3.7})
    scale = _polynomial(e, inside(given["azimuthal"]), {1: 0.265, 2: 1.194, 22: 5.372})
    made = {}
    for lobe, factor in (("R", (1.0,)), ("TT", given["scale_TT"]), ("TRT", given["scale_TRT"])):
        wide = _product_of(e, width, factor)
        made[f"roughness_{lobe}"] = e.apply("ND_combine2_vector2", in1=_product_of(e, wide, wide), in2=scale)
    return made


_HAIR_NODES: dict[str, Callable[[Expressions, HairInputs], dict[str, Operand]]] = {
    "ND_chiang_hair_absorption_from_color": _absorption_from_color,
    "ND_deon_hair_absorption_from_melanin": _absorption_from_melanin,
    "ND_chiang_hair_roughness": _roughness,
}


def is_hair_node(name: str) -> bool:
    return name in _HAIR_NODES


def hair_node(e: Expressions, name: str, given: HairInputs) -> Outputs:
    """Return the outputs of a hair node; `given`: all of its inputs."""
    if all(isinstance(value, tuple) for value in given.values()):
        return _HAIR_NODES[name](e, given)
    return e.node(name, given)
