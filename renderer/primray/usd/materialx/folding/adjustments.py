"""Constant folding of adjustments: mix, remap, smoothstep, luminance, HSV."""

from __future__ import annotations

import colorsys

from .kinds import Constants, Fold, Numbers, each


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
