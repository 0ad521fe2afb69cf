"""Constant folding of combine, extract and convert."""

from __future__ import annotations

from .kinds import Constants, Fold, Numbers


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
