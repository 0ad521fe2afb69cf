"""Nodes that blend from one value to another over texture coordinates; (0, 0) is the lower left corner."""

from __future__ import annotations

from ..node import Node
from ..program import Value


def ramplr(n: Node) -> Value:
    p = n.program
    return p.mix(n["valuel"], n["valuer"], p.clamp(n["texcoord"][0], 0.0, 1.0))


def ramptb(n: Node) -> Value:
    p = n.program
    return p.mix(n["valueb"], n["valuet"], p.clamp(n["texcoord"][1], 0.0, 1.0))


def splitlr(n: Node) -> Value:
    """Switch values at a sharp edge, which pixel samples antialias."""
    return n.program.select(n.program.not_above(n["center"], n["texcoord"][0]), n["valuer"], n["valuel"])


def splittb(n: Node) -> Value:
    return n.program.select(n.program.not_above(n["center"], n["texcoord"][1]), n["valuet"], n["valueb"])


NODES = {"ramplr": ramplr, "ramptb": ramptb, "splitlr": splitlr, "splittb": splittb}
