"""Nodes that composite colours, and nodes of selection: conditions, channels, type conversion.

RGBA is premultiplied. Booleans are 1 and 0.
"""

from __future__ import annotations

from ..program import Node, Value

SMALL = 1e-8  # divisors below it count as 0


def _mixed(n: Node, result: Value) -> Value:
    return n.program.mix(n["bg"], result, n["mix"])


def mix(n: Node) -> Value:
    return _mixed(n, n["fg"])


def plus(n: Node) -> Value:
    return _mixed(n, n["bg"] + n["fg"])


def minus(n: Node) -> Value:
    return _mixed(n, n["bg"] - n["fg"])


def difference(n: Node) -> Value:
    return _mixed(n, n.program.apply("abs", n["bg"] - n["fg"]))


def screen(n: Node) -> Value:
    return _mixed(n, 1.0 - (1.0 - n["fg"]) * (1.0 - n["bg"]))


def burn(n: Node) -> Value:
    p, fg = n.program, n["fg"]
    burnt = _mixed(n, 1.0 - (1.0 - n["bg"]) / fg)
    return p.select(p.less(p.apply("abs", fg), SMALL), 0.0, burnt)


def dodge(n: Node) -> Value:
    p, left = n.program, 1.0 - n["fg"]
    dodged = _mixed(n, n["bg"] / left)
    return p.select(p.less(p.apply("abs", left), SMALL), 0.0, dodged)


def over(n: Node) -> Value:
    return _mixed(n, n["fg"] + n["bg"] * (1.0 - n["fg"][3]))


def in_(n: Node) -> Value:
    return _mixed(n, n["fg"] * n["bg"][3])


def out(n: Node) -> Value:
    return _mixed(n, n["fg"] * (1.0 - n["bg"][3]))


def mask(n: Node) -> Value:
    return _mixed(n, n["bg"] * n["fg"][3])


def matte(n: Node) -> Value:
    p, fg, bg = n.program, n["fg"], n["bg"]
    left = 1.0 - fg[3]
    color = fg.part(0, 3) * fg[3] + bg.part(0, 3) * left
    return _mixed(n, p.pack([color, fg[3] + bg[3] * left]))


def disjointover(n: Node) -> Value:
    p, fg, bg = n.program, n["fg"], n["bg"]
    both, color = fg[3] + bg[3], bg.part(0, 3)
    part = fg.part(0, 3) + color * ((1.0 - fg[3]) / bg[3])
    crowded = p.select(p.less(p.apply("abs", bg[3]), SMALL), 0.0, part)
    rgb = p.select(p.not_above(both, 1.0), fg.part(0, 3) + color, crowded)
    return _mixed(n, p.pack([rgb, p.apply("min", both, 1.0)]))


def inside(n: Node) -> Value:
    return n["in"] * n["mask"]


def outside(n: Node) -> Value:
    return n["in"] * (1.0 - n["mask"])


def premult(n: Node) -> Value:
    c = n["in"]
    return n.program.pack([c.part(0, 3) * c[3], c[3]])


def unpremult(n: Node) -> Value:
    c = n["in"]
    return n.program.pack([c.part(0, 3) / c[3], c[3]])


COMPOSITING_NODES = {
    "mix": mix, "plus": plus, "minus": minus, "difference": difference, "screen": screen, "burn": burn, "dodge": dodge,
    "over": over, "in": in_, "out": out, "mask": mask, "matte": matte, "disjointover": disjointover, "inside": inside,
    "outside": outside, "premult": premult, "unpremult": unpremult,
}  # fmt: skip


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


CHANNEL_NODES = {
    "ifgreater": ifgreater, "ifgreatereq": ifgreatereq, "ifequal": ifequal, "and": and_, "or": or_, "not": not_,
    "convert": same, "dot": same, "constant": constant, "combine2": combine, "combine3": combine, "combine4": combine,
    "extract": extract,
}  # fmt: skip
