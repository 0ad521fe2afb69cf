"""Table of MaterialX's primitive nodes: the function that compiles each, or the reason that it cannot be computed."""

from __future__ import annotations

from collections.abc import Callable

from .families import (
    adjustments,
    arithmetic,
    bumps,
    channels,
    compositing,
    geometry,
    hextiles,
    images,
    matrices,
    noises,
    physical,
    ramps,
    usd,
)
from .node import Node, Outputs

FAMILIES = (
    adjustments, arithmetic, bumps, channels, compositing, geometry, hextiles, images, matrices, noises, physical, ramps,
    usd,
)  # fmt: skip
NODES: dict[str, Callable[[Node], Outputs]] = {name: f for family in FAMILIES for name, f in family.NODES.items()}

_CLOSURE = "says how light scatters or shines: a surface, not a number"
_TEXT = "is a text, known before rendering"
# Reasons by type of a node's first output.
NO_MEANING = {
    "BSDF": _CLOSURE, "EDF": _CLOSURE, "VDF": _CLOSURE, "surfaceshader": _CLOSURE, "volumeshader": _CLOSURE,
    "lightshader": _CLOSURE, "material": _CLOSURE, "displacementshader": "moves points, before there are any to shade",
    "string": _TEXT, "filename": _TEXT,
}  # fmt: skip
