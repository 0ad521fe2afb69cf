"""Node rules that several renderers share: arithmetic, mixtures, channels, and colour adjustments."""

from __future__ import annotations

import itertools

from ....description import Operand
from ..materialx.expressions import Expressions

LUMA = (0.2126, 0.7152, 0.0722)
ONE, ZERO, WHITE, BLACK = (1.0,), (0.0,), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def binary(e: Expressions, operation: str, a: Operand, b: Operand) -> Operand:
    """Return an operation ("add", "multiply" ...) on two colours, channel by channel."""
    return e.apply(f"ND_{operation}_color3", in1=a, in2=b)


def scaled(e: Expressions, color: Operand, by: Operand) -> Operand:
    return e.apply("ND_multiply_color3FA", in1=color, in2=by)


def mixed(e: Expressions, a: Operand, b: Operand, by: Operand) -> Operand:
    return e.apply("ND_mix_color3", bg=a, fg=b, mix=by)


def inverted(e: Expressions, color: Operand) -> Operand:
    return e.apply("ND_invert_color3", **{"in": color, "amount": WHITE})


def channel(e: Expressions, color: Operand, index: int) -> Operand:
    return e.apply("ND_extract_color3", **{"in": color, "index": (float(index),)})


def grey(e: Expressions, value: Operand) -> Operand:
    """Return a number as a colour."""
    return e.apply("ND_convert_float_color3", **{"in": value})


def weighted(e: Expressions, color: Operand, weights: tuple[float, float, float]) -> Operand:
    """Return the sum of a colour's channels times their weights."""
    as_vector = e.apply("ND_convert_color3_vector3", **{"in": color})
    return e.apply("ND_dotproduct_vector3", in1=as_vector, in2=weights)


def with_gamma(e: Expressions, color: Operand, gamma: Operand) -> Operand:
    if gamma == ONE:
        return color
    inverse = e.apply("ND_divide_float", in1=ONE, in2=gamma)
    return e.apply("ND_power_color3FA", in1=e.apply("ND_max_color3FA", in1=color, in2=ZERO), in2=inverse)


def with_saturation(e: Expressions, color: Operand, saturation: Operand) -> Operand:
    """Return a colour mixed with its luminance: 0 is grey, above 1 is more saturated."""
    if saturation == ONE:
        return color
    return mixed(e, grey(e, weighted(e, color, LUMA)), color, saturation)


def with_hue(e: Expressions, color: Operand, shift: Operand) -> Operand:
    """Return a colour with its hue shifted, 1 being once round."""
    if shift == ZERO:
        return color
    amount = e.apply("ND_combine3_vector3", in1=shift, in2=ONE, in3=ONE)
    return e.apply("ND_hsvadjust_color3", **{"in": color, "amount": amount})


def with_contrast(e: Expressions, color: Operand, contrast: Operand, pivot: Operand) -> Operand:
    if contrast == ONE:
        return color
    off = e.apply("ND_subtract_color3FA", in1=color, in2=pivot)
    return e.apply("ND_add_color3FA", in1=scaled(e, off, contrast), in2=pivot)


def exposed(e: Expressions, color: Operand, stops: Operand) -> Operand:
    if stops == ZERO:
        return color
    return scaled(e, color, e.apply("ND_power_float", in1=(2.0,), in2=stops))


def between(e: Expressions, x: Operand, low: float, high: float) -> Operand:
    """Return the position of a number from low (0) to high (1), clamped."""
    span = high - low
    if span <= 0.0:
        return e.apply("ND_ifgreatereq_float", value1=x, value2=(high,), in1=ONE, in2=ZERO)
    gone = e.apply("ND_divide_float", in1=e.apply("ND_subtract_float", in1=x, in2=(low,)), in2=(span,))
    return e.apply("ND_clamp_float", **{"in": gone, "low": ZERO, "high": ONE})


def ramp(e: Expressions, x: Operand, knots: list[tuple[float, Operand, bool]], *, smooth: bool = False) -> Operand:
    """Return a ramp's colour at x; a knot is a position, a colour, and whether it is constant until the next."""
    ordered = sorted(knots, key=lambda knot: knot[0])
    value = ordered[0][1]
    for (low, _, holds), (high, color, _) in itertools.pairwise(ordered):
        if holds:
            at = e.apply("ND_ifgreatereq_float", value1=x, value2=(high,), in1=ONE, in2=ZERO)
        else:
            at = between(e, x, low, high)
            at = e.apply("ND_smoothstep_float", **{"in": at, "low": ZERO, "high": ONE}) if smooth else at
        value = mixed(e, value, color, at)
    return value
