"""Every primitive node of MaterialX's libraries: the function that writes what it computes, or why it computes nothing here."""

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
# By type of a node's first output.
NO_MEANING = {
    "BSDF": _CLOSURE, "EDF": _CLOSURE, "VDF": _CLOSURE, "surfaceshader": _CLOSURE, "volumeshader": _CLOSURE,
    "lightshader": _CLOSURE, "material": _CLOSURE, "displacementshader": "moves points, before there are any to shade",
    "string": _TEXT, "filename": _TEXT,
}  # fmt: skip
