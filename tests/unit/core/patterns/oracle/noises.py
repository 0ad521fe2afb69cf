"""Noise by the hash of Bob Jenkins, at single points of Python numbers: slow, and plain to read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from .numbers import Inputs, Rows

WORD = 0xFFFFFFFF
Point = Sequence[float] | npt.NDArray[np.float64]


def rotl(x: int, k: int) -> int:
    return ((x << k) | (x >> (32 - k))) & WORD


def mix_words(a: int, b: int, c: int) -> tuple[int, int, int]:
    for k in (4, 6, 8, 16, 19, 4):
        a = (a - c) & WORD
        a ^= rotl(c, k)
        c = (c + b) & WORD
        a, b, c = b, c, a
    return a, b, c


def final_words(a: int, b: int, c: int) -> int:
    for k in (14, 11, 25, 16, 4, 14, 24):
        c ^= b
        c = (c - rotl(b, k)) & WORD
        a, b, c = b, c, a
    return b


def hashed(*words: int) -> int:
    """lookup3 of one to five words."""
    start = (0xDEADBEEF + (len(words) << 2) + 13) & WORD
    state = [start] * 3
    for k, word in enumerate(words[:3]):
        state[k] = (state[k] + word) & WORD
    if len(words) > 3:
        state = list(mix_words(*state))
        for k, word in enumerate(words[3:]):
            state[k] = (state[k] + word) & WORD
    return final_words(*state)


def unit(*words: int) -> float:
    return hashed(*words) / WORD


def gradient(h: int, d: Point) -> float:
    if len(d) == 2:
        h &= 7
        u, v = (d[0], d[1]) if h < 4 else (d[1], d[0])
        return (-u if h & 1 else u) + (-2 * v if h & 2 else 2 * v)
    h &= 15
    u = d[0] if h < 8 else d[1]
    v = d[1] if h < 4 else (d[0] if h in (12, 14) else d[2])
    return (-u if h & 1 else u) + (-v if h & 2 else v)


def perlin(p: Point, channel: int = 0) -> float:
    cell = [math.floor(x) for x in p]
    f = [x - c for x, c in zip(p, cell, strict=True)]
    total = 0.0
    for corner in np.ndindex(*[2] * len(p)):
        weight = 1.0
        for t, k in zip(f, corner, strict=True):
            fade = t**3 * (t * (t * 6 - 15) + 10)
            weight *= fade if k else 1 - fade
        h = hashed(*(c + k for c, k in zip(cell, corner, strict=True)))
        total += weight * gradient(h >> 8 * channel, [t - k for t, k in zip(f, corner, strict=True)])
    return total * (0.6616 if len(p) == 2 else 0.9820)


def octaves(p: Point, count: int, lacunarity: float, diminish: float, channel: int = 0) -> float:
    return sum(diminish**k * perlin([x * lacunarity**k for x in p], channel) for k in range(count))


def aside(p: Point, by: Point) -> list[float]:
    return [x + d for x, d in zip(p, by, strict=False)]


def noise_of(p: Point, width: int) -> list[float]:
    found = [perlin(p, c) for c in range(min(width, 3))]
    return [*found, perlin(aside(p, (19, 73, 29)))] if width == 4 else found


def fractal_of(p: Point, width: int, *settings: float) -> list[float]:
    count, lacunarity, diminish = int(settings[0]), settings[1], settings[2]

    def of(place: Point, channel: int = 0) -> float:
        return octaves(place, count, lacunarity, diminish, channel)

    far = aside(p, (19, 193, 17))
    return {1: [of(p)], 2: [of(p), of(far)]}.get(width) or [of(p, c) for c in range(3)] + ([of(far)] if width == 4 else [])


def feature(cell: Sequence[int], jitter: float) -> list[float]:
    return [c + (unit(*cell, k) - 0.5) * jitter + 0.5 for k, c in enumerate(cell)]


def worley_of(p: Point, width: int, jitter: float, style: int) -> list[float]:
    home = [math.floor(x) for x in p]
    cells = [[h + d for h, d in zip(home, step, strict=True)] for step in np.ndindex(*[3] * len(p))]
    cells = [[c - 1 for c in cell] for cell in cells]
    points = [feature(cell, jitter) for cell in cells]
    ranked = sorted((math.dist(p, q), k) for k, q in enumerate(points))
    if style != 1:
        return [d for d, _ in ranked[:width]]
    of = [math.floor(x) for x in points[ranked[0][1]]]
    return [unit(*of)] if width == 1 else [unit(*of, k) for k in range(width)]


def turn(u: Sequence[float]) -> Rows:
    """Arvo's random rotation."""
    theta, phi, z = 2 * math.pi * u[0], 2 * math.pi * u[1], 2 * u[2]
    v = np.array([math.sin(phi) * math.sqrt(z), math.cos(phi) * math.sqrt(z), math.sqrt(max(2 - z, 0))])
    about = np.array([[math.cos(theta), math.sin(theta), 0], [-math.sin(theta), math.cos(theta), 0], [0, 0, 1]])
    return np.asarray((np.outer(v, v) - np.eye(3)) @ about)


def density(x: float) -> float:
    above = -26.19771808 * x * x + 26.39663835 * x
    return above / (85.53857017 * x**3 - 102.35069432 * x * x - 101.42634862 * x + 118.45082288)


def flake_of(p: Point, size: float, roughness: float, coverage: float, frame: Rows) -> dict[str, list[float]]:
    """`frame`: rows tangent, bitangent, normal."""
    q = np.asarray(p) / size
    limit = 1.5 / math.sqrt(3)
    best, seen = 0.0, None
    for step in np.ndindex(3, 3, 3):
        cell = [math.floor(x) + k - 1 for x, k in zip(q, step, strict=True)]
        d = q - np.array(cell) - 0.5
        if d @ d >= 3 * limit * limit or unit(*cell) > density(min(max(coverage, 0), 1)):
            continue
        priority = unit(*cell, 3)
        # The rotation's matrix is transposed: its rows are what multiplies each coordinate.
        inside = np.abs(turn([unit(*cell, k) for k in range(3)]).T @ d) <= limit
        if priority >= best and inside.all():
            best, seen = priority, cell
    if seen is None or best <= 0:
        return {"id": [0.0], "rand": [0.0], "presence": [0.0], "flakenormal": list(frame[2])}
    u, v, random = (unit(*seen, 2, k) for k in range(3))
    slope = roughness**2 * math.sqrt(v / (1 - v))
    local = np.array([slope * math.cos(2 * math.pi * u), slope * math.sin(2 * math.pi * u), 1.0])
    n = (local / np.linalg.norm(local)) @ frame
    return {"id": [math.floor(random * 16777215)], "rand": [random], "presence": [best],
            "flakenormal": list(n / np.linalg.norm(n))}  # fmt: skip


def rows(i: Inputs, f: Callable[[dict[str, Rows]], list[float]]) -> Rows:
    count = len(next(iter(i.values())))
    return np.array([f({name: values[k] for name, values in i.items()}) for k in range(count)])


def of_noises(category: str, i: Inputs, width: int) -> Rows | dict[str, Rows] | None:
    """None where the node is of something else."""
    place = "position" if "position" in i else "texcoord"
    if category.startswith("noise"):
        return rows(i, lambda r: noise_of(r[place], width)) * i["amplitude"] + i["pivot"]
    if category.startswith("fractal"):
        names = ("octaves", "lacunarity", "diminish")
        return rows(i, lambda r: fractal_of(r[place], width, *(r[n][0] for n in names))) * i["amplitude"]
    if category.startswith("cellnoise"):
        return rows(i, lambda r: [unit(*(math.floor(x) for x in r[place]))])
    if category.startswith("worleynoise"):
        return rows(i, lambda r: worley_of(r[place], width, r["jitter"][0], int(r["style"][0])))
    if category.startswith("flake"):
        frames = [np.array([i[n][k] for n in ("tangent", "bitangent", "normal")]) for k in range(len(i["size"]))]
        found = [
            flake_of([*i[place][k], 0.0][:3], i["size"][k, 0], i["roughness"][k, 0], i["coverage"][k, 0], frame)
            for k, frame in enumerate(frames)
        ]
        return {name: np.array([f[name] for f in found]) for name in found[0]}
    return None
