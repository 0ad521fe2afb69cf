"""Nodes of selection: conditions, channels, type conversion. Booleans are 1 and 0."""

from __future__ import annotations

from ..node import Node
from ..program import Value


def ifgreater(n: Node) -> Value:
    return _chosen(n, n.program.less(n["value2"], n["value1"]))


def ifgreatereq(n: Node) -> Value:
    return _chosen(n, n.program.not_above(n["value2"], n["value1"]))


def ifequal(n: Node) -> Value:
    return _chosen(n, n.program.apply("equal", n["value1"], n["value2"]))


def _chosen(n: Node, condition: Value) -> Value:
    """Return one of two inputs; the condition itself where the node has none."""
    return n.program.select(condition, n["in1"], n["in2"]) if n.has("in1") else condition


def and_(n: Node) -> Value:
    return n["in1"] * n["in2"]


def or_(n: Node) -> Value:
    return n.program.apply("max", n["in1"], n["in2"])


def not_(n: Node) -> Value:
    return 1.0 - n["in"]


def same(n: Node) -> Value:
    """Return the input: converted in type at most, or not at all."""
    return n["in"]


def constant(n: Node) -> Value:
    return n["value"]


def combine(n: Node) -> Value:
    return n.program.pack([n[name] for name in ("in1", "in2", "in3", "in4") if n.has(name)])


def extract(n: Node) -> Value:
    """Return a component of a vector or a row of a matrix; indices out of range are clamped."""
    p, v = n.program, n["in"]
    count, width = (v.width, 1) if v.width <= 4 else ((3, 3) if v.width == 9 else (4, 4))
    parts = [v.part(i * width, width) for i in range(count)]
    index = n["index"]
    if (known := index.constant) is not None:
        return parts[min(max(int(known[0]), 0), count - 1)]
    chosen = parts[-1]
    for i in range(count - 2, -1, -1):
        chosen = p.select(p.less(index, i + 0.5), parts[i], chosen)
    return chosen


NODES = {
    "ifgreater": ifgreater, "ifgreatereq": ifgreatereq, "ifequal": ifequal, "and": and_, "or": or_, "not": not_,
    "convert": same, "dot": same, "constant": constant, "combine2": combine, "combine3": combine, "combine4": combine,
    "extract": extract,
}  # fmt: skip
