"""Constant folding of compositing: blends with a mix, and operators on alpha."""

from __future__ import annotations

from collections.abc import Callable

from .adjustments import mixed
from .kinds import Constants, Fold, Numbers, wide


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
