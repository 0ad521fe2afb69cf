"""Constant folding of arithmetic by component, of vector operations, and of logic."""

from __future__ import annotations

import math
import operator

from .kinds import Constants, Fold, Numbers, each


def _divide(a: float, b: float) -> float:
    return a / b


def _modulo(a: float, b: float) -> float:
    return a - b * math.floor(a / b)


def _sign(a: float) -> float:
    return float((a > 0) - (a < 0))


def _round(a: float) -> float:
    return math.floor(a + 0.5)


def _fract(a: float) -> float:
    return a - math.floor(a)


def _clamp(a: float, low: float, high: float) -> float:
    return min(max(a, low), high)


def _invert(a: float, amount: float) -> float:
    return amount - a


def _power(a: float, b: float) -> float:
    return math.pow(a, b)


def _magnitude(inputs: Constants, _width: int) -> Numbers:
    return (math.hypot(*inputs["in"]),)


def _normalize(inputs: Constants, _width: int) -> Numbers:
    length = math.hypot(*inputs["in"])
    return tuple(x / length for x in inputs["in"])


def _dot(inputs: Constants, _width: int) -> Numbers:
    return (sum(map(operator.mul, inputs["in1"], inputs["in2"])),)


def _cross(inputs: Constants, _width: int) -> Numbers:
    (a, b, c), (d, e, f) = inputs["in1"], inputs["in2"]
    return (b * f - c * e, c * d - a * f, a * e - b * d)


def _same(name: str) -> Fold:
    return lambda inputs, _width: inputs[name]


def _is_and(inputs: Constants, _width: int) -> Numbers:
    return (float(inputs["in1"][0] != 0 and inputs["in2"][0] != 0),)


def _is_or(inputs: Constants, _width: int) -> Numbers:
    return (float(inputs["in1"][0] != 0 or inputs["in2"][0] != 0),)


def _is_not(inputs: Constants, _width: int) -> Numbers:
    return (float(inputs["in"][0] == 0),)


ARITHMETIC: dict[str, Fold] = {
    "add": each(operator.add, "in1", "in2"),
    "subtract": each(operator.sub, "in1", "in2"),
    "multiply": each(operator.mul, "in1", "in2"),
    "divide": each(_divide, "in1", "in2"),
    "modulo": each(_modulo, "in1", "in2"),
    "power": each(_power, "in1", "in2"),
    "min": each(min, "in1", "in2"),
    "max": each(max, "in1", "in2"),
    "atan2": each(math.atan2, "iny", "inx"),
    "clamp": each(_clamp, "in", "low", "high"),
    "invert": each(_invert, "in", "amount"),
    "absval": each(abs, "in"),
    "sign": each(_sign, "in"),
    "floor": each(math.floor, "in"),
    "ceil": each(math.ceil, "in"),
    "round": each(_round, "in"),
    "fract": each(_fract, "in"),
    "sin": each(math.sin, "in"),
    "cos": each(math.cos, "in"),
    "tan": each(math.tan, "in"),
    "asin": each(math.asin, "in"),
    "acos": each(math.acos, "in"),
    "sqrt": each(math.sqrt, "in"),
    "ln": each(math.log, "in"),
    "exp": each(math.exp, "in"),
    "magnitude": _magnitude,
    "normalize": _normalize,
    "dotproduct": _dot,
    "crossproduct": _cross,
    "constant": _same("value"),
    "dot": _same("in"),
    "and": _is_and,
    "or": _is_or,
    "not": _is_not,
}
