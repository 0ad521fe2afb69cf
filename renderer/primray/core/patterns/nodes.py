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

_CLOSURE = "describes how a surface scatters or emits light, and has no numeric value"
_TEXT = "is a string, which has no numeric value"
# Reasons by type of a node's first output.
NO_MEANING = {
    "BSDF": _CLOSURE, "EDF": _CLOSURE, "VDF": _CLOSURE, "surfaceshader": _CLOSURE, "volumeshader": _CLOSURE,
    "lightshader": _CLOSURE, "material": _CLOSURE, "displacementshader": "displaces points, which takes place before shading",
    "string": _TEXT, "filename": _TEXT,
}  # fmt: skip
