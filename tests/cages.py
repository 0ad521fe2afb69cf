"""Small subdivision cages, diced by the core, and a ring refined by the schemes' rules in plain numpy as an oracle."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.described import core_module, look_at

from primray.description import Doubles, Interpolation, Primvar, SubdivisionMesh
from primray.tessellation.dice import Dicing, core_arrays
from primray.tessellation.footprint import Footprint, Pose, Projected

HERE = Pose(np.eye(4), np.zeros(3))
NOWHERE = Footprint(Projected((HERE,), False, 1.0, (-1, 1, -1, 1)), np.zeros((0, 3, 4)), 0.0, np.zeros((0, 3)))


def seen_from(eye: list[float], target: list[float], pixels: float = 400, half: float = 0.5) -> Footprint:
    """One cage in the world's own space before a perspective camera."""
    camera = np.asarray(np.linalg.inv(look_at(eye, target, (0.1, 1, 0.2))), np.float64)
    window = (-half, half, -half, half)
    pose = Pose(camera, np.zeros(3))
    return Footprint(Projected((pose,), False, pixels / (2 * half), window), camera[None, :3].copy(), 0.0, np.zeros((1, 3)))


def cage(points: npt.ArrayLike, faces: list[list[int]], scheme: str = "catmullClark", **more: Any) -> SubdivisionMesh:
    for name in ("crease_lengths", "crease_points", "corner_points", "holes"):
        if name in more:
            more[name] = np.asarray(more[name], np.int32)
    for name in ("crease_sharpnesses", "corner_sharpnesses"):
        if name in more:
            more[name] = np.asarray(more[name], np.float32)
    counts = np.array([len(f) for f in faces], np.int32)
    flat = np.array([v for f in faces for v in f], np.int32)
    return SubdivisionMesh("/cage", scheme, np.asarray(points, np.float32), counts, flat, 0, **more)


def cube(**more: Any) -> SubdivisionMesh:
    points = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return cage(points, faces, **more)


def octahedron(**more: Any) -> SubdivisionMesh:
    points = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    return cage(points, faces, scheme="loop", **more)


def grid(n: int, m: int, height: Any = None, triangles: bool = False, **more: Any) -> SubdivisionMesh:
    """n x m unit squares from (0, 0), their points by rows; `triangles` halves each along (1, 1)."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0)))
    z = np.zeros_like(x) if height is None else height(x, y)
    faces: list[list[int]] = []
    for j in range(m):
        for i in range(n):
            a = j * (n + 1) + i
            b, c, d = a + 1, a + n + 2, a + n + 1
            faces += [[a, b, c], [a, c, d]] if triangles else [[a, b, c, d]]
    return cage(np.stack([x, y, z], axis=1), faces, "loop" if triangles else "catmullClark", **more)


def star(n: int, scheme: str, closed: bool, seed: int, **more: Any) -> SubdivisionMesh:
    """n faces around point 0: spokes 1, 2, ..., then Catmull-Clark's diagonals. Bumpy, but facing +z."""
    rng = np.random.default_rng(seed)
    spokes = n if closed else n + 1
    turn = 2 * np.pi / n if closed else 1.6 * np.pi / n
    quads = scheme == "catmullClark"
    angles = [0.0, *(turn * i for i in range(spokes)), *(turn * (i + 0.5) for i in range(n if quads else 0))]
    radii = [0.0, *[1.0] * spokes, *[1.4] * (n if quads else 0)]
    points = np.stack([np.cos(angles) * radii, np.sin(angles) * radii, np.zeros(len(radii))], axis=1)
    points += 0.15 * rng.normal(size=points.shape)
    ring = [(1 + i, 1 + (i + 1) % spokes) for i in range(n)]
    faces = [[0, a, 1 + spokes + i, b] if quads else [0, a, b] for i, (a, b) in enumerate(ring)]
    return cage(points, faces, scheme, **more)


def dice(c: SubdivisionMesh, dicing: Dicing, footprint: Footprint = NOWHERE) -> dict[str, Any]:
    made = core_module().dice(core_arrays(c, footprint, dicing))
    assert made is not None
    return {name: getattr(made, name) for name in vars(type(made)) if not name.startswith("_")}


def uniform(c: SubdivisionMesh, level: int) -> dict[str, Any]:
    return dice(c, Dicing(1.0, level, level))


def vertices_of(c: SubdivisionMesh, made: dict[str, Any]) -> npt.NDArray[np.int32]:
    """Of each point of the cage, its number in a cage diced at level 0 (where no primvar moves)."""
    tagged = replace(
        c,
        primvars=(Primvar("id", Interpolation.VARYING, np.arange(len(c.points), dtype=np.float32)[:, None]),),
    )
    ids = uniform(tagged, int(made["level"]))["varying_values"][:, 0]
    out = np.full(len(c.points), -1, np.int32)
    whole = ids == np.round(ids)
    first = np.flatnonzero(whole)[::-1]  # vertices of the cage come before any other
    out[ids[first].astype(int)] = first
    return out


class Ring:
    """A vertex, its spokes and (Catmull-Clark) diagonals, refined by the rules as the papers state them."""

    def __init__(self, c: SubdivisionMesh, n: int, closed: bool, sharp: dict[int, float], tip: float = 0.0) -> None:
        spokes = n if closed else n + 1
        p = c.points.astype(np.float64)
        self.v, self.e, self.f = p[0], p[1 : 1 + spokes], p[1 + spokes :]
        self.closed, self.loop, self.tip = closed, c.scheme == "loop", tip
        self.s = np.zeros(spokes)
        if not closed:
            self.s[[0, -1]] = np.inf
        for spoke, value in sharp.items():
            self.s[spoke] = np.inf if value >= 10 else value

    def step(self) -> None:
        v, e, f, s = self.v, self.e, self.f, self.s
        n = len(e)
        around = np.roll if self.closed else lambda a, k, axis: np.concatenate([a[:1], a[:-1]] if k > 0 else [a[1:], a[-1:]])
        after, before = around(e, -1, 0), around(e, 1, 0)
        if self.loop:
            smooth = 3 / 8 * (v + e) + 1 / 8 * (after + before)
            new_f = f
        else:
            m = len(f)
            new_f = (v + f + e[:m] + (after[:m] if not self.closed else after)) / 4
            left = np.roll(new_f, 1, 0) if self.closed else np.concatenate([new_f[:1], new_f])
            right = new_f if self.closed else np.concatenate([new_f, new_f[-1:]])
            smooth = (v + e + left + right) / 4
        t = np.clip(s, 0, 1)[:, None]
        new_e = (1 - t) * smooth + t * (v + e) / 2
        now, later = self.rule(s, self.tip), self.rule(np.maximum(s - 1, 0), max(self.tip - 1, 0))
        if now == later:
            new_v = self.vertex(now, s, new_f)
        else:
            ends = [x for x in [*s, self.tip] if 0 < x <= 1]
            w = min(1.0, float(np.mean(ends)))
            new_v = w * self.vertex(now, s, new_f) + (1 - w) * self.vertex(later, np.maximum(s - 1, 0), new_f)
        assert n == len(new_e)
        self.v, self.e, self.f = new_v, new_e, new_f
        self.s, self.tip = np.maximum(s - 1, 0), max(self.tip - 1, 0)

    @staticmethod
    def rule(s: Doubles, tip: float) -> str:
        count = int((s > 0).sum())
        return "corner" if tip > 0 or count > 2 else ("crease" if count == 2 else "smooth")

    def vertex(self, rule: str, s: Doubles, new_f: Doubles) -> Doubles:
        v, e, n = self.v, self.e, len(self.e)
        if rule == "corner":
            return v
        if rule == "crease":
            a, b = np.flatnonzero(s > 0)
            return np.asarray(3 / 4 * v + (e[a] + e[b]) / 8)
        if self.loop:
            beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n
            return np.asarray((1 - n * beta) * v + beta * e.sum(axis=0))
        # Catmull and Clark 1978: Q/n + 2R/n + (n - 3)S/n, R the mean of the edges' middles.
        return np.asarray(new_f.mean(axis=0) / n + (v + e).mean(axis=0) / n + (n - 3) / n * v)

    def limit(self, steps: int = 120) -> Doubles:
        for _ in range(steps):
            self.step()
        return self.v
