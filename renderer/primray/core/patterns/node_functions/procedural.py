"""Procedural nodes: noise, cells, flakes, and ramps over texture coordinates, with (0, 0) at the lower left corner."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..node import Node, Outputs
from ..program import Numbers, Value

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
