"""Nodes of the shaded point: position, normal, tangents, primvars, coordinate spaces; and of time."""

from __future__ import annotations

from ....description.pattern_reads import COLOR_PRIMVAR, primvar_of_set
from ..node import Node
from ..program import Value

OBJECT = {"object", "model"}
TRANSFORMS = ("point_object", "point_world", "vector_object", "vector_world", "normal_object", "normal_world")


def _in_space(n: Node, kind: str, value: Value, source: str, target: str) -> Value:
    """Transform a value between spaces; any name but the object's own means world space."""
    if (source in OBJECT) == (target in OBJECT):
        return value
    n.around.object_space = True
    name = f"{kind}_{'object' if target in OBJECT else 'world'}"
    return n.program.apply("transform", value, width=3, data=TRANSFORMS.index(name))


def position(n: Node) -> Value:
    in_object = n.text("space", "object") in OBJECT
    n.around.object_space |= in_object
    return n.program.apply("position", width=3, data=n.shifted(int(in_object)))


def normal(n: Node) -> Value:
    return _in_space(n, "normal", n.program.apply("normal", width=3), "world", n.text("space", "object"))


def _along(n: Node, name: str) -> Value:
    data = n.around.primvar(primvar_of_set(n.whole("index")))
    along = n.program.apply(name, width=3, data=data)
    moved = _in_space(n, "vector", along, "world", n.text("space", "object"))
    return moved if moved is along else n.program.normalize(moved)


def tangent(n: Node) -> Value:
    return _along(n, "tangent")


def bitangent(n: Node) -> Value:
    return _along(n, "bitangent")


def viewdirection(n: Node) -> Value:
    view = n.program.apply("view", width=3)
    moved = _in_space(n, "vector", view, "world", n.text("space", "world"))
    return moved if moved is view else n.program.normalize(moved)


def _primvar(n: Node, name: str, default: Value, width: int) -> Value:
    return n.program.apply("primvar", default, width=width, data=n.shifted(n.around.primvar(name)))


def texcoord(n: Node) -> Value:
    p = n.program
    st = _primvar(n, primvar_of_set(n.whole("index")), p.constant(0.0, 0.0), 2)
    return st if n.width == 2 else p.pack([st, p.constant(0.0)])


def geomcolor(n: Node) -> Value:
    p = n.program
    zero = p.constant(*[0.0] * n.width)
    return _primvar(n, COLOR_PRIMVAR, zero, n.width)


def geompropvalue(n: Node) -> Value:
    return _primvar(n, n.text("geomprop"), n["default"], n.width)


def transformpoint(n: Node) -> Value:
    return _in_space(n, "point", n["in"], n.text("fromspace"), n.text("tospace"))


def transformvector(n: Node) -> Value:
    return _in_space(n, "vector", n["in"], n.text("fromspace"), n.text("tospace"))


def transformnormal(n: Node) -> Value:
    return _in_space(n, "normal", n["in"], n.text("fromspace"), n.text("tospace"))


def frame(n: Node) -> Value:
    return n.program.constant(n.around.frame())


def time(n: Node) -> Value:
    return n.program.constant(n.around.frame()) / n["fps"]


GEOMETRY_NODES = {
    "position": position, "normal": normal, "tangent": tangent, "bitangent": bitangent, "viewdirection": viewdirection,
    "texcoord": texcoord, "geomcolor": geomcolor, "geompropvalue": geompropvalue, "transformpoint": transformpoint,
    "transformvector": transformvector, "transformnormal": transformnormal, "frame": frame, "time": time,
}  # fmt: skip
