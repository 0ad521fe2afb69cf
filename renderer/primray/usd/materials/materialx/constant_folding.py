"""Constant folding of primitive nodes in double precision: arithmetic, channels, adjustments, compositing.

Nodes that depend on the shading point, and those rarely constant (noise, matrices), are not folded. A folding maps inputs,
tuples of numbers by name, and the output's width to the output's numbers.
"""

from __future__ import annotations

import colorsys
import math
import operator
from collections.abc import Callable, Mapping

from .definitions import Definition

Numbers = tuple[float, ...]
Constants = dict[str, Numbers]
Fold = Callable[[Constants, int], Numbers]


def wide(value: Numbers, width: int) -> Numbers:
    """Return a value repeated to `width` components where it has one."""
    return value * width if len(value) == 1 else value


def each(function: Callable[..., float], *names: str) -> Fold:
    """Return the folding of a function applied to each component of these inputs."""

    def fold(inputs: Constants, width: int) -> Numbers:
        given = [inputs[name] for name in names]
        return tuple(map(function, *[value * width if len(value) == 1 else value for value in given]))

    return fold


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


def mixed(fg: float, bg: float, mix: float) -> float:
    return bg * (1.0 - mix) + fg * mix


def _remap(x: float, inlow: float, inhigh: float, outlow: float, outhigh: float) -> float:
    return outlow + (x - inlow) * (outhigh - outlow) / (inhigh - inlow)


def _smoothstep(x: float, low: float, high: float) -> float:
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def _luminance(inputs: Constants, width: int) -> Numbers:
    grey = sum(a * b for a, b in zip(inputs["in"][:3], inputs["lumacoeffs"], strict=False))
    return ((grey,) * 3 + inputs["in"][3:])[:width]


def _to_hsv(inputs: Constants, _width: int) -> Numbers:
    r, g, b = inputs["in"][:3]
    return (*colorsys.rgb_to_hsv(r, g, b), *inputs["in"][3:])


def _from_hsv(inputs: Constants, _width: int) -> Numbers:
    h, s, v = inputs["in"][:3]
    return (*colorsys.hsv_to_rgb(h - h // 1, s, v), *inputs["in"][3:])


ADJUSTMENTS: dict[str, Fold] = {
    "mix": each(mixed, "fg", "bg", "mix"),
    "remap": each(_remap, "in", "inlow", "inhigh", "outlow", "outhigh"),
    "smoothstep": each(_smoothstep, "in", "low", "high"),
    "luminance": _luminance,
    "rgbtohsv": _to_hsv,
    "hsvtorgb": _from_hsv,
}


def _combine(inputs: Constants, _width: int) -> Numbers:
    return tuple(x for name in ("in1", "in2", "in3", "in4") for x in inputs.get(name, ()))


def _extract(inputs: Constants, _width: int) -> Numbers:
    return (inputs["in"][int(inputs["index"][0])],)


def _convert(inputs: Constants, width: int) -> Numbers:
    """Return a number converted to `width` components: one is repeated; alpha is 1, a missing vector component 0."""
    given = inputs["in"]
    if len(given) == 1:
        return given * width
    filled = (*given, *((1.0,) if len(given) == 3 else (0.0,) * (width - len(given))))
    return filled[:width]


CHANNELS: dict[str, Fold] = {
    "combine2": _combine,
    "combine3": _combine,
    "combine4": _combine,
    "extract": _extract,
    "convert": _convert,
}


def _blend(of: Callable[[float, float], float]) -> Fold:
    """Return the folding of a blend of foreground and background, mixed with the background."""

    def fold(inputs: Constants, width: int) -> Numbers:
        fg, bg, mix = (wide(inputs[name], width) for name in ("fg", "bg", "mix"))
        return tuple(mixed(of(f, b), b, m) for f, b, m in zip(fg, bg, mix, strict=True))

    return fold


def _burn(f: float, b: float) -> float:
    return 0.0 if abs(f) < 1e-8 else 1.0 - (1.0 - b) / f


def _dodge(f: float, b: float) -> float:
    return 0.0 if abs(1.0 - f) < 1e-8 else b / (1.0 - f)


def _screen(f: float, b: float) -> float:
    return 1.0 - (1.0 - f) * (1.0 - b)


def _premult(inputs: Constants, _width: int) -> Numbers:
    r, g, b, a = inputs["in"]
    return (r * a, g * a, b * a, a)


def _unpremult(inputs: Constants, _width: int) -> Numbers:
    r, g, b, a = inputs["in"]
    return (r / a, g / a, b / a, a) if a else (r, g, b, a)


def _masked(by: Callable[[float], float]) -> Fold:
    return lambda inputs, _width: tuple(x * by(inputs["mask"][0]) for x in inputs["in"])


COMPOSITING: dict[str, Fold] = {
    "plus": _blend(lambda f, b: f + b),
    "minus": _blend(lambda f, b: b - f),
    "difference": _blend(lambda f, b: abs(f - b)),
    "burn": _blend(_burn),
    "dodge": _blend(_dodge),
    "screen": _blend(_screen),
    "premult": _premult,
    "unpremult": _unpremult,
    "inside": _masked(lambda mask: mask),
    "outside": _masked(lambda mask: 1.0 - mask),
}


_FOLDS: dict[str, Fold] = {**ARITHMETIC, **CHANNELS, **ADJUSTMENTS, **COMPOSITING}


def folded(node: Definition, inputs: Mapping[str, object]) -> Numbers | None:
    """Return the value of a node whose inputs are all numbers; None where it is unknown or not finite."""
    fold = _FOLDS.get(node.category)
    width = node.width
    if fold is None or not width or len(node.outputs) > 1:
        return None
    for value in inputs.values():
        if type(value) is not tuple:
            return None
    try:
        made = fold(inputs, width)  # type: ignore[arg-type]
    except (ArithmeticError, ValueError, KeyError, IndexError):
        return None
    return made if len(made) == width and all(map(math.isfinite, made)) else None
