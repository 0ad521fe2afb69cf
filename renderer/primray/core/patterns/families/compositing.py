"""Nodes that composite colours; RGBA is premultiplied."""

from __future__ import annotations

from ..node import Node
from ..program import Value

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


NODES = {
    "mix": mix, "plus": plus, "minus": minus, "difference": difference, "screen": screen, "burn": burn, "dodge": dodge,
    "over": over, "in": in_, "out": out, "mask": mask, "matte": matte, "disjointover": disjointover, "inside": inside,
    "outside": outside, "premult": premult, "unpremult": unpremult,
}  # fmt: skip
