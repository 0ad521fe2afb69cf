"""Nodes of the shaded point (position, normal, tangents, primvars, coordinate spaces), of time, and procedural ones upon them.

Procedural nodes are noise, cells, flakes, and ramps over texture coordinates, with (0, 0) at the lower left corner.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ....description.shading import COLOR_PRIMVAR, primvar_of_set
from ..program import Node, Numbers, Outputs, Value

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


# Offset of the second noise of nodes that need one, from MaterialX's library.
NOISE_ASIDE: dict[int, Numbers] = {2: (19, 73), 3: (19, 73, 29)}
FRACTAL_ASIDE: dict[int, Numbers] = {2: (19, 193), 3: (19, 193, 17)}
# Rational fit of the density of flakes, from MaterialX's library (mx_flake).
FLAKE_ABOVE = (-26.19771808, 26.39663835)
FLAKE_BELOW = (85.53857017, -102.35069432, -101.42634862, 118.45082288)


def _coordinates(n: Node) -> Value:
    return n["position"] if n.has("position") else n["texcoord"]


def noise(n: Node) -> Value:
    p, at = n.program, _coordinates(n)
    name = f"noise{at.width}"
    value = p.apply(name, at, width=min(n.width, 3))
    if n.width == 4:
        value = p.pack([value, p.apply(name, at + p.constant(*NOISE_ASIDE[at.width]), width=1)])
    return value * n["amplitude"] + n["pivot"]


def fractal(n: Node) -> Value:
    p, at = n.program, _coordinates(n)
    settings = [n[name] for name in ("octaves", "lacunarity", "diminish")]

    def of(place: Value, width: int) -> Value:
        return p.apply(f"fractal{place.width}", place, *settings, width=width)

    value = of(at, 3 if n.width >= 3 else 1)
    if n.width in (2, 4):
        value = p.pack([value, of(at + p.constant(*FRACTAL_ASIDE[at.width]), 1)])
    return value * n["amplitude"]


def cellnoise(n: Node) -> Value:
    at = _coordinates(n)
    return n.program.apply(f"cell{at.width}", at, width=1)


def worleynoise(n: Node) -> Value:
    """Compute Worley noise: style 1 is the value of the nearest point's cell, any other the distances."""
    p, at, style = n.program, _coordinates(n), n["style"]
    name = f"worley{at.width}"
    if (known := style.constant) is not None:
        return p.apply(name, at, n["jitter"], width=n.width, data=int(known[0] == 1))
    of = [p.apply(name, at, n["jitter"], width=n.width, data=data) for data in (0, 1)]
    return p.select(p.apply("equal", style, 1.0), of[1], of[0])


def _probability(coverage: Value) -> Value:
    x = coverage
    above = (x * FLAKE_ABOVE[0] + FLAKE_ABOVE[1]) * x
    return above / (((x * FLAKE_BELOW[0] + FLAKE_BELOW[1]) * x + FLAKE_BELOW[2]) * x + FLAKE_BELOW[3])


def flake(n: Node) -> dict[str, Value]:
    """Compute flakes: randomly rotated cubes, with normals distributed by GGX for the roughness."""
    p, at = n.program, _coordinates(n)
    place = at if at.width == 3 else p.pack([at, p.constant(0.0)])
    found = p.apply("flake", place / n["size"], _probability(p.clamp(n["coverage"], 0.0, 1.0)), width=4)
    presence, around, height, random = found.components
    tangent = n["roughness"] * n["roughness"] * p.sqrt(height) / p.sqrt(1.0 - height)
    sine = tangent / p.sqrt(1.0 + tangent * tangent)
    angle = around * (2 * math.pi)
    normal = n["tangent"] * (p.apply("cos", angle) * sine) + n["bitangent"] * (p.apply("sin", angle) * sine)
    normal = p.normalize(normal + n["normal"] * p.sqrt(1.0 - sine * sine))
    is_one = p.less(0.0, presence)
    return {
        "id": p.floor(random * 16777215.0),
        "rand": random,
        "presence": presence,
        "flakenormal": p.select(is_one, normal, n["normal"]),
    }


NOISE_NODES: dict[str, Callable[[Node], Outputs]] = {
    "noise2d": noise, "noise3d": noise, "fractal2d": fractal, "fractal3d": fractal, "cellnoise2d": cellnoise,
    "cellnoise3d": cellnoise, "worleynoise2d": worleynoise, "worleynoise3d": worleynoise, "flake2d": flake, "flake3d": flake,
}  # fmt: skip


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


RAMP_NODES = {"ramplr": ramplr, "ramptb": ramptb, "splitlr": splitlr, "splittb": splittb}
