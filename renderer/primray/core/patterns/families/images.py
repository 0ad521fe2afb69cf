"""Nodes that read images. (0, 0) is an image's lower left corner; cubic filters are replaced by linear ones."""

from __future__ import annotations

from collections.abc import Sequence

from ..node import FOOTPRINT_SHIFTS, NO_SHIFT, Node
from ..program import Value


def offsets(n: Node) -> list[Value]:
    """Return the differences of the coordinates over the pixel's footprint, in two directions."""
    return [n.read("texcoord", shift) - n.read("texcoord", NO_SHIFT) for shift in FOOTPRINT_SHIFTS]


def texel(n: Node, image: int, at: Value, off: Sequence[Value], width: int, default: Value) -> Value:
    """Return the image's value at coordinates, filtered over the footprint that the offsets span."""
    return n.program.apply("image", at, at + off[0], at + off[1], default, width=width, data=image)


def image(n: Node) -> Value:
    file, default = n.file("file"), n["default"]
    number = None if file is None else n.around.image(file, n.width, n)
    if number is None:
        return default
    at = n["texcoord"]
    found = texel(n, number, at, offsets(n), n.width, default)
    for component, mode in enumerate(("uaddressmode", "vaddressmode")):
        if n.text(mode) == "constant":
            p, x = n.program, at[component]
            found = p.select(p.not_above(0.0, x) * p.not_above(x, 1.0), found, default)
    return found


NODES = {"image": image}
