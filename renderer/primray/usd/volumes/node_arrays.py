"""Evaluation of a pattern on arrays: fields' values at many voxels in, colours or numbers out, in double precision.

Values are arrays (n, width), or (1, width) where they are the same at all voxels. Nodes that depend on a surface, images and
noise are not evaluated: UnusableShaderError names them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...color.color_space import ColorSpace
from ...color.spectrum import black_body, rgb_of
from ...description import NodeOutput, Operand, PatternNode
from ..materials.materialx.definitions import WIDTHS, definition
from .coefficients import UnusableShaderError

Inputs = Mapping[str, Any]  # arrays, or texts
_COLDEST, _HOTTEST, _TEMPERATURES = 800.0, 25000.0, 600  # the range of MaterialX's black bodies
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class NodeArrays:
    """The nodes of one pattern at the voxels of `values`: fields by name."""

    def __init__(self, nodes: list[PatternNode], values: Mapping[str, Doubles], space: ColorSpace) -> None:
        self._nodes, self._values, self._space = nodes, values, space
        self._made: dict[int, Doubles] = {}

    def of(self, operand: Operand) -> Doubles:
        """Return the values (n, width) of an operand."""
        if isinstance(operand, tuple):
            return np.array([operand], np.float64)
        if not isinstance(operand, NodeOutput):
            raise UnusableShaderError(f"{operand!r} is no number")
        for number in range(operand.node + 1) if operand.node not in self._made else ():
            if number not in self._made and number in self._needed(operand.node):
                self._made[number] = self._node(self._nodes[number])
        return self._made[operand.node]

    def _needed(self, node: int) -> set[int]:
        found: set[int] = set()
        left = [node]
        while left:
            number = left.pop()
            if number not in found:
                found.add(number)
                left += [v.node for _, v in self._nodes[number].inputs if isinstance(v, NodeOutput)]
        return found

    def _node(self, node: PatternNode) -> Doubles:
        shown = node.signature or node.category
        found = definition(node.signature)
        if node.type not in WIDTHS or node.type.startswith("matrix") or (found is not None and len(found.outputs) > 1):
            raise UnusableShaderError(f"{shown} cannot be evaluated at voxels")
        if node.category == "geompropvalue":
            return self._field(node)
        inputs = {name: self._input(value) for name, value in node.inputs}
        if node.category == "blackbody":
            return _black_bodies(inputs["temperature"], self._space)
        rule = RULES.get(node.category)
        if rule is None:
            raise UnusableShaderError(f"{shown} cannot be evaluated at voxels")
        with np.errstate(all="ignore"):
            made = rule({**inputs, "": WIDTHS[node.type]})
        return made if made.shape[1] == WIDTHS[node.type] else np.broadcast_to(made, (len(made), WIDTHS[node.type]))

    def _input(self, value: Operand) -> Any:
        return (
            self._made[value.node]
            if isinstance(value, NodeOutput)
            else np.array([value])
            if isinstance(value, tuple)
            else value
        )

    def _field(self, node: PatternNode) -> Doubles:
        inputs, width = dict(node.inputs), WIDTHS[node.type]
        values = self._values.get(str(inputs["geomprop"]))
        if values is None:
            return self._input(inputs["default"])  # type: ignore[no-any-return]
        if values.shape[1] == 1:
            return np.broadcast_to(values, (len(values), width))
        return values[:, :width]


@cache
def _table(space: ColorSpace) -> tuple[Doubles, Doubles]:
    """Return temperatures, and the colours (N, 3) of black bodies of luminance 1."""
    kelvin = np.geomspace(_COLDEST, _HOTTEST, _TEMPERATURES)
    colors = [rgb_of(black_body(float(k)), space) for k in kelvin]
    return kelvin, np.maximum(np.array(colors), 0.0)


def _black_bodies(temperature: Doubles, space: ColorSpace) -> Doubles:
    kelvin, colors = _table(space)
    return np.stack([np.interp(temperature[:, 0], kelvin, colors[:, c]) for c in range(3)], axis=1)


Rule = Callable[[Inputs], Doubles]


def _each(function: Callable[..., Any], *names: str) -> Rule:
    return lambda inputs: np.asarray(function(*(inputs[name] for name in names)), np.float64)


def _divide(a: Doubles, b: Doubles) -> Doubles:
    return np.where(b != 0, a / np.where(b != 0, b, 1.0), 0.0)


def _mix(fg: Doubles, bg: Doubles, mix: Doubles) -> Doubles:
    return bg * (1.0 - mix) + fg * mix


def _remap(x: Doubles, low: Doubles, high: Doubles, out_low: Doubles, out_high: Doubles) -> Doubles:
    return out_low + _divide((x - low) * (out_high - out_low), high - low)


def _smoothstep(x: Doubles, low: Doubles, high: Doubles) -> Doubles:
    t = np.clip(_divide(x - low, high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _norm(x: Doubles) -> Doubles:
    return np.asarray(np.linalg.norm(x, axis=1, keepdims=True), np.float64)


def _joined(*parts: Doubles) -> Doubles:
    count = max(map(len, parts))
    return np.concatenate([np.broadcast_to(part, (count, part.shape[1])) for part in parts], axis=1)


def _combine(inputs: Inputs) -> Doubles:
    return _joined(*(inputs[name] for name in ("in1", "in2", "in3", "in4") if name in inputs))


def _extract(inputs: Inputs) -> Doubles:
    index = inputs["index"]
    if len(index) != 1 or not 0 <= int(index[0, 0]) < inputs["in"].shape[1]:
        raise UnusableShaderError("the index of a channel varies, or is not one of a channel")
    return inputs["in"][:, int(index[0, 0])][:, None]  # type: ignore[no-any-return]


def _convert(inputs: Inputs) -> Doubles:
    """Return a value with the width of the output: one number is repeated; alpha is 1, a missing component of a vector 0."""
    given, width = inputs["in"], inputs[""]
    if given.shape[1] == 1:
        return np.broadcast_to(given, (len(given), width))
    if given.shape[1] < width:
        more = width - given.shape[1]
        given = _joined(given, np.full((1, more), float(given.shape[1] == 3)))
    return given[:, :width]  # type: ignore[no-any-return]


def _luminance(inputs: Inputs) -> Doubles:
    given = inputs["in"]
    weights = inputs.get("lumacoeffs", LUMINANCE[None])
    grey = (given[:, :3] * weights[:, :3]).sum(axis=1, keepdims=True)
    return np.concatenate([np.repeat(grey, 3, axis=1), given[:, 3:]], axis=1)


def _choice(holds: Callable[[Doubles, Doubles], npt.NDArray[np.bool_]]) -> Rule:
    return lambda i: np.asarray(np.where(holds(i["value1"], i["value2"]), i["in1"], i["in2"]), np.float64)


def _blend(of: Callable[[Doubles, Doubles], Doubles]) -> Rule:
    return lambda i: _mix(of(i["fg"], i["bg"]), i["bg"], i["mix"])


RULES: dict[str, Rule] = {
    "add": _each(np.add, "in1", "in2"),
    "subtract": _each(np.subtract, "in1", "in2"),
    "multiply": _each(np.multiply, "in1", "in2"),
    "divide": _each(_divide, "in1", "in2"),
    "modulo": _each(lambda a, b: a - b * np.floor(_divide(a, b)), "in1", "in2"),
    "power": _each(np.power, "in1", "in2"),
    "min": _each(np.minimum, "in1", "in2"),
    "max": _each(np.maximum, "in1", "in2"),
    "atan2": _each(np.arctan2, "iny", "inx"),
    "clamp": _each(lambda x, low, high: np.minimum(np.maximum(x, low), high), "in", "low", "high"),
    "invert": _each(lambda x, amount: amount - x, "in", "amount"),
    "absval": _each(np.abs, "in"),
    "sign": _each(np.sign, "in"),
    "floor": _each(np.floor, "in"),
    "ceil": _each(np.ceil, "in"),
    "round": _each(lambda x: np.floor(x + 0.5), "in"),
    "fract": _each(lambda x: x - np.floor(x), "in"),
    "sin": _each(np.sin, "in"),
    "cos": _each(np.cos, "in"),
    "tan": _each(np.tan, "in"),
    "asin": _each(np.arcsin, "in"),
    "acos": _each(np.arccos, "in"),
    "sqrt": _each(np.sqrt, "in"),
    "ln": _each(np.log, "in"),
    "exp": _each(np.exp, "in"),
    "magnitude": _each(_norm, "in"),
    "normalize": _each(lambda x: _divide(x, _norm(x)), "in"),
    "dotproduct": _each(lambda a, b: (a * b).sum(axis=1, keepdims=True), "in1", "in2"),
    "constant": _each(np.asarray, "value"),
    "dot": _each(np.asarray, "in"),
    "and": _each(lambda a, b: (a != 0) & (b != 0), "in1", "in2"),
    "or": _each(lambda a, b: (a != 0) | (b != 0), "in1", "in2"),
    "not": _each(lambda a: a == 0, "in"),
    "mix": _each(_mix, "fg", "bg", "mix"),
    "remap": _each(_remap, "in", "inlow", "inhigh", "outlow", "outhigh"),
    "smoothstep": _each(_smoothstep, "in", "low", "high"),
    "luminance": _luminance,
    "combine2": _combine,
    "combine3": _combine,
    "combine4": _combine,
    "extract": _extract,
    "convert": _convert,
    "ifgreater": _choice(np.greater),
    "ifgreatereq": _choice(np.greater_equal),
    "ifequal": _choice(np.equal),
    "plus": _blend(np.add),
    "minus": _blend(lambda f, b: b - f),
    "difference": _blend(lambda f, b: np.abs(f - b)),
    "screen": _blend(lambda f, b: 1.0 - (1.0 - f) * (1.0 - b)),
    "inside": _each(np.multiply, "in", "mask"),
    "outside": _each(lambda x, mask: x * (1.0 - mask), "in", "mask"),
}
