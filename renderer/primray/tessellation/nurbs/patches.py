"""Choice of a patch's grid: intervals are halved while an edge across them covers too many pixels and is not flat. Lengths in
pixels are measured as in the core's dicing of cages (core/subdivision/dicing/footprint.hpp)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...arrays import Doubles, Floats, Ints
from ...description import Interpolation, Mesh, NurbsPatch, PointMotion, Primvar
from ..footprint import EVERYWHERE, OUTSIDE, Footprint
from .evaluation import Bases, Control, Flags, Indices, Lines, across, bases, first_lines, grid_normals, points_of
from .trimming import Tolerance, Trimmed, are_holes, flattened, has_area, off_the_grid, trim_grid, with_lines_through

MOST_POINTS = 1 << 24  # examined per patch: about four million cells
AT_ONCE = 1 << 20
STRAIGHT = float(np.cos(np.radians(1.0)))  # cosine between normals of what counts as flat


@dataclass(frozen=True)
class Fineness:
    pixels: float  # largest edge length
    flatness: float  # largest deviation of flat intervals, in pixels; 0: none count as flat
    levels: int  # number of times an interval may be halved


@dataclass(frozen=True, eq=False)
class Grid:
    u: Lines
    v: Lines
    per_u: float  # largest number of pixels per unit of each parameter
    per_v: float
    is_limited: bool  # edges are longer than requested


def grid_of(controls: Sequence[Control], u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> Grid | None:
    """Return the grid for `controls`, the control points at each time; None if it would have too many points."""
    for level in range(fine.levels + 1):
        if 4 * len(u.at) * len(v.at) > MOST_POINTS:
            return None
        seen = [_IntervalSizes.of(control, u, v, footprint, fine) for control in controls]
        long_u, long_v = (np.max(lengths, axis=0) for lengths in zip(*((s.u, s.v) for s in seen), strict=True))
        bent_u, bent_v = (np.any(flags, axis=0) for flags in zip(*((s.bent_u, s.bent_v) for s in seen), strict=True))
        split_u, split_v = (long_u > fine.pixels) & bent_u & u.is_drawn, (long_v > fine.pixels) & bent_v & v.is_drawn
        is_done = not (split_u.any() or split_v.any())
        if is_done or level == fine.levels:
            return Grid(u, v, _rate(long_u, u), _rate(long_v, v), not is_done)
        u, v = u.split(split_u), v.split(split_v)
    return None


def _rate(lengths: Doubles, lines: Lines) -> float:
    steps = np.diff(lines.at)
    drawn = lines.is_drawn
    return float((lengths[drawn] / steps[drawn]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _IntervalSizes:
    """Largest edge length across each interval, and whether the surface bends there."""

    u: Doubles
    v: Doubles
    bent_u: Flags
    bent_v: Flags

    @staticmethod
    def of(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _IntervalSizes:
        """Return the measures from the grid's points and those halfway between its lines."""
        rows = max(1, AT_ONCE // (4 * len(u.at)))
        cuts = [*range(0, len(v.at) - 1, rows), len(v.at) - 1]
        parts = [_IntervalSizes._of_rows(control, u, v.part(a, b + 1), footprint, fine) for a, b in pairwise(cuts)]
        return _IntervalSizes(
            np.max([p.u for p in parts], axis=0),
            np.concatenate([p.v for p in parts]),
            np.any([p.bent_u for p in parts], axis=0),
            np.concatenate([p.bent_v for p in parts]),
        )

    @staticmethod
    def _of_rows(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _IntervalSizes:
        twice_u, twice_v = _doubled(u), _doubled(v)
        found = control.grid(twice_u.bases(), twice_v.bases())
        points = points_of(found[0])
        long_u = pixels(footprint, points[:, :-1:2], points[:, 2::2]).max(axis=0)
        long_v = pixels(footprint, points[:-1:2], points[2::2]).max(axis=1)
        if fine.flatness == 0:
            return _IntervalSizes(long_u, long_v, np.ones(len(long_u), bool), np.ones(len(long_v), bool))
        normals = grid_normals(control, twice_u, twice_v, found)
        across_u = _bends(points, normals, footprint, fine)
        across_v = _bends(points.swapaxes(0, 1), normals.swapaxes(0, 1), footprint, fine)
        middle, corners = points[1::2, 1::2], points[::2, ::2]
        twist = np.maximum(
            pixels(footprint, middle, (corners[:-1, :-1] + corners[1:, 1:]) / 2),
            pixels(footprint, middle, (corners[1:, :-1] + corners[:-1, 1:]) / 2),
        )
        twisted = (twist > fine.flatness) & u.is_drawn & v.is_drawn[:, None]
        return _IntervalSizes(long_u, long_v, across_u | twisted.any(axis=0), across_v | twisted.any(axis=1))


def _doubled(lines: Lines) -> Lines:
    """Return the lines with one more in every interval, drawn or not."""
    where = np.arange(len(lines.at) - 1)
    return lines.with_lines(where, (lines.at[:-1] + lines.at[1:]) / 2)


def _bends(points: Doubles, normals: Doubles, footprint: Footprint, fine: Fineness) -> Flags:
    """Return the mask (M - 1,) of bent intervals along the second axis, where every other column is a line."""
    a, b, middle = points[:, :-1:2], points[:, 2::2], points[:, 1::2]
    off = pixels(footprint, middle, (a + b) / 2) > fine.flatness
    m, n = normals[:, 1::2], (normals[:, :-1:2], normals[:, 2::2])
    turned = np.logical_or.reduce([(m * each).sum(axis=-1) < STRAIGHT for each in n])
    return np.asarray((off | turned).any(axis=0))


SMALLEST = 1e-300


def pixels(footprint: Footprint, a: Doubles, b: Doubles) -> Doubles:
    """Return the largest number of pixels (...,) that segments from a to b (..., 3) cover in any placement."""
    longest = footprint.density * np.linalg.norm(b - a, axis=-1)
    for view, sweep in zip(footprint.views, footprint.sweeps, strict=True):
        here, there = (points @ view[:, :3].T + view[:, 3] for points in (a, b))
        longest = np.maximum(longest, _lengths_in_view(footprint, here, there, sweep))
    return np.asarray(longest)


def _lengths_in_view(footprint: Footprint, a: Doubles, b: Doubles, sweep: Doubles) -> Doubles:
    camera = footprint.projected
    length = np.linalg.norm(b - a, axis=-1) * camera.pixels_per_unit
    swept = (np.zeros(3), sweep / 2, sweep) if sweep.any() else (np.zeros(3),)
    if not camera.orthographic:
        length = length / np.maximum(np.min([_distance(a - s, b - s) for s in swept], axis=0), SMALLEST)
    if camera.sees_around:
        return np.asarray(length)
    ends = [p - s for s in swept for p in (a, b)]
    left, right, bottom, top = EVERYWHERE if camera.sees_around else camera.window
    depths = [np.ones(p.shape[:-1]) if camera.orthographic else -p[..., 2] for p in ends]
    sides = [
        np.min([left * d - p[..., 0] for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([p[..., 0] - right * d for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([bottom * d - p[..., 1] for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([p[..., 1] - top * d for p, d in zip(ends, depths, strict=True)], axis=0),
        np.zeros(a.shape[:-1]) if camera.orthographic else np.min([-d for d in depths], axis=0),
    ]
    beyond = np.max(sides, axis=0)
    size = max(right - left, top - bottom)
    far = 1.0 if camera.orthographic else np.max([np.linalg.norm(p, axis=-1) for p in ends], axis=0)
    allowed = OUTSIDE * np.maximum(1.0, beyond / np.maximum(size * far, SMALLEST))
    return np.asarray(np.where(beyond > 0, length / allowed, length))


def _distance(a: Doubles, b: Doubles) -> Doubles:
    """Return the distance of segments from the origin."""
    d = b - a
    dd = (d * d).sum(axis=-1)
    t = np.clip(-(a * d).sum(axis=-1) / np.where(dd > 0, dd, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + t[..., None] * d, axis=-1))


FLAT = 1e-7  # of the largest coordinate: closer points are merged where a patch closes or has a pole
CURVE_PIXELS = 0.001  # largest error of trim polylines, per pixel of edge length


@dataclass(frozen=True, eq=False)
class DicedPatch:
    mesh: Mesh  # without triangles if everything is trimmed away
    is_limited: bool
    empty_loops: int


def dice_patches(
    patches: Mapping[int, NurbsPatch],
    prints: Mapping[int, Footprint],
    fine: Fineness,
    most: int,
    made_before: Callable[[int, Fineness], DicedPatch | None] = lambda k, now: None,
) -> tuple[dict[int, DicedPatch], float]:
    """Return the diced patches and the edge length in pixels, which is doubled until all have at most `most` triangles
    together. `made_before` returns what is known of a patch already."""
    pixels = fine.pixels
    while True:
        now, made, total = replace(fine, pixels=pixels), dict[int, DicedPatch](), 0
        for k, patch in patches.items():
            found = made_before(k, now) or dice_patch(patch, prints[k], now)
            if found is None:
                break
            made[k] = found
            total += len(found.mesh.triangles)
            if total > most and pixels < 1e6:
                break
        else:
            return made, pixels
        pixels *= 2


def coarse_mesh(patch: NurbsPatch) -> Mesh:
    """Return the patch tessellated only as finely as its knot spans require."""
    u, v = first_lines(patch.u), first_lines(patch.v)
    return _mesh(patch, [Control.of(patch, patch.points)], u, v, None)


def dice_patch(patch: NurbsPatch, footprint: Footprint, fine: Fineness) -> DicedPatch | None:
    """Return the diced patch, or None if it would have too many points."""
    steps = [patch.points] if patch.motion is None else [patch.points, *patch.motion.points]
    controls = [Control.of(patch, points) for points in steps]
    grid = _grid(patch, controls, footprint, fine)
    if grid is None:
        return None
    if not patch.loops:
        return DicedPatch(_mesh(patch, controls, grid.u, grid.v, None), grid.is_limited, 0)
    tolerance = Tolerance(CURVE_PIXELS * min(fine.pixels, 4.0), grid.per_u, grid.per_v)
    loops = [off_the_grid(flattened(loop, tolerance), patch.u, patch.v) for loop in patch.loops]
    whole = [loop for loop in loops if has_area(loop, patch.u, patch.v)]
    empty = len(loops) - len(whole)
    if not whole:
        return DicedPatch(_empty(patch), grid.is_limited, empty)
    u, v = with_lines_through(whole, grid.u, grid.v)
    cut = trim_grid(whole, u, v, holes=are_holes(whole))
    return DicedPatch(_mesh(patch, controls, u, v, cut), grid.is_limited, empty)


def triangles_of(patch: NurbsPatch, footprint: Footprint, fine: Fineness) -> int:
    """Return the number of triangles from dicing, before trimming."""
    while True:
        grid = _grid(patch, [Control.of(patch, patch.points)], footprint, fine)
        if grid is not None:
            return 2 * (len(grid.u.at) - 1) * (len(grid.v.at) - 1)
        fine = replace(fine, pixels=2 * fine.pixels)


def _grid(patch: NurbsPatch, controls: Sequence[Control], footprint: Footprint, fine: Fineness) -> Grid | None:
    """Return the grid; flat parts are split as well if values vary over them or trim loops cut them."""
    if patch.loops or any(_varies(p) for p in _all_primvars(patch)):
        fine = replace(fine, flatness=0.0)
    return grid_of(controls, first_lines(patch.u), first_lines(patch.v), footprint, fine)


def _varies(primvar: Primvar) -> bool:
    """Return whether the primvar varies within segments."""
    return primvar.interpolation in (Interpolation.POINT, Interpolation.VARYING)


def _all_primvars(patch: NurbsPatch) -> list[Primvar]:
    return [*([patch.colors] if patch.colors is not None else []), *patch.primvars]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Vertices:
    """Vertices of a grid, row by row, followed by those on trim loops."""

    u: Lines
    v: Lines
    u_bases: Bases
    v_bases: Bases
    loop_spans: Indices  # (K, 2) u, v
    loop_at: Doubles  # (K, 2)
    loop_bases: tuple[Bases, Bases]

    @staticmethod
    def of(u: Lines, v: Lines, cut: Trimmed | None) -> _Vertices:
        at = np.zeros((0, 2)) if cut is None else cut.at
        inside = np.zeros((0, 2), np.intp) if cut is None else cut.inside
        spans = np.stack([u.spans[inside[:, 0]], v.spans[inside[:, 1]]], axis=1)
        single = bases(u.direction, spans[:, 0], at[:, 0]), bases(v.direction, spans[:, 1], at[:, 1])
        return _Vertices(u=u, v=v, u_bases=u.bases(), v_bases=v.bases(), loop_spans=spans, loop_at=at, loop_bases=single)

    def surface(self, control: Control) -> tuple[Doubles, Doubles]:
        """Return points and unit normals (N, 3)."""
        found = control.grid(self.u_bases, self.v_bases)
        points = _with_merged_positions(points_of(found[0]), self.u, self.v)
        normals = grid_normals(control, self.u, self.v, found)
        single = control.single(*self.loop_bases)
        crossed, _ = across(*single)
        length = np.linalg.norm(crossed, axis=-1)
        crossed[length == 0] = 0, 0, 1
        turned = crossed / np.where(length > 0, length, 1.0)[:, None]
        return _grid_and_loops(points, points_of(single[0])), _grid_and_loops(normals, turned)

    def values(self, control: Control) -> Doubles:
        return _grid_and_loops(control.values(self.u_bases, self.v_bases), points_of(control.single(*self.loop_bases)[0]))

    def linear(self, rows: Doubles) -> Doubles:
        """Return values (V, U, C) at knot crossings, interpolated bilinearly."""
        (i, s), (j, t) = (_shares(lines, lines.spans, lines.at) for lines in (self.u, self.v))
        grid = _bilinear(rows, i[None, :], j[:, None], s[None, :, None], t[:, None, None])
        (i, s), (j, t) = (_shares(lines, self.loop_spans[:, k], self.loop_at[:, k]) for k, lines in enumerate((self.u, self.v)))
        return _grid_and_loops(grid, _bilinear(rows, i, j, s[:, None], t[:, None]))


def _grid_and_loops(grid: Doubles, single: Doubles) -> Doubles:
    return np.concatenate([grid.reshape(-1, grid.shape[-1]), single])


def _shares(lines: Lines, spans: Indices, at: Doubles) -> tuple[Indices, Doubles]:
    knots = lines.direction.knots
    share = (at - knots[spans]) / (knots[spans + 1] - knots[spans])
    return spans - (lines.direction.order - 1), share


def _bilinear(rows: Doubles, i: Indices, j: Indices, s: Doubles, t: Doubles) -> Doubles:
    low = rows[j, i] * (1 - s) + rows[j, i + 1] * s
    high = rows[j + 1, i] * (1 - s) + rows[j + 1, i + 1] * s
    return np.asarray(low * (1 - t) + high * t)


def _with_merged_positions(points: Doubles, u: Lines, v: Lines) -> Doubles:
    """Return the points with identical positions where they are one point: at inner edges, poles, and where the patch
    closes."""
    first_u, first_v = np.flatnonzero(u.joined), np.flatnonzero(v.joined)
    points[:, first_u] = points[:, first_u - 1]
    points[first_v] = points[first_v - 1]
    near = FLAT * float(np.abs(points).max(initial=0.0))
    for end in (0, -1):
        for edge in (points[end], points[:, end]):
            if np.abs(edge - edge[0]).max() <= near:
                edge[:] = edge[0]
    for first, last in ((points[0], points[-1]), (points[:, 0], points[:, -1])):
        if np.abs(first - last).max() <= near:
            last[:] = first
    return points


def _mesh(patch: NurbsPatch, controls: Sequence[Control], u: Lines, v: Lines, cut: Trimmed | None) -> Mesh:
    vertices = _Vertices.of(u, v, cut)
    found = [vertices.surface(control) for control in controls]
    points = [p.astype(np.float32) for p, _ in found]
    triangles, cells = _triangles(u, v, cut)
    solid = np.zeros(len(triangles), bool)
    for place in points:
        a, b, c = (place[triangles[:, k]] for k in range(3))
        solid |= (a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1)
    triangles, cells = triangles[solid], cells[solid]
    if len(triangles) == 0:
        return _empty(patch)
    if patch.is_flipped:
        triangles = triangles[:, [0, 2, 1]]
    found_numbers = np.unique(triangles, return_inverse=True)
    used, numbers = found_numbers[0].astype(np.intp), found_numbers[1]
    triangles = numbers.reshape(-1, 3).astype(np.int32)
    rows = _Rows(used, triangles, cells, alike=len(used) == 3 * len(triangles))
    outwards = -1 if patch.is_flipped else 1
    normals = [rows.normals((outwards * n).astype(np.float32)) for _, n in found]
    motion = None
    if patch.motion is not None:
        steps = np.stack([p[used] for p in points[1:]])
        motion = PointMotion(patch.motion.times, np.ascontiguousarray(steps), np.stack(normals[1:]))
    return Mesh(
        path=patch.path,
        points=np.ascontiguousarray(points[0][used]),
        triangles=triangles,
        normals=normals[0],
        colors=None if patch.colors is None else rows.colors(_on_mesh(patch.colors, patch, vertices, rows)),
        surface=patch.surface,
        primvars=tuple(_on_mesh(p, patch, vertices, rows) for p in patch.primvars),
        light=patch.light,
        link_row=patch.link_row,
        motion=motion,
    )


def _empty(patch: NurbsPatch) -> Mesh:
    return Mesh(
        path=patch.path,
        points=patch.points,
        triangles=np.zeros((0, 3), np.int32),
        normals=None,
        colors=None,
        surface=patch.surface,
        primvars=(),
        light=patch.light,
        link_row=patch.link_row,
    )


def _triangles(u: Lines, v: Lines, cut: Trimmed | None) -> tuple[Ints, Ints]:
    """Return the triangles and the cell (u, v) of each."""
    whole = (u.is_drawn & v.is_drawn[:, None]) if cut is None else cut.whole
    j, i = np.nonzero(whole)
    columns = len(u.at)
    a = j * columns + i
    b, c, d = a + 1, a + columns + 1, a + columns
    quads = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    cells = np.repeat(np.stack([i, j], axis=1), 2, axis=0)
    if cut is None:
        return quads.astype(np.int32), cells.astype(np.int32)
    return np.concatenate([quads, cut.triangles]).astype(np.int32), np.concatenate([cells, cut.cells]).astype(np.int32)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Subset of vertices and cells used by the mesh. `alike`: it has as many points as corners, which description.Mesh could
    not tell apart."""

    used: Indices
    triangles: Ints
    cells: Ints
    alike: bool

    def normals(self, values: Floats) -> Floats:
        kept = values[self.used]
        return np.ascontiguousarray(kept[self.triangles.ravel()] if self.alike else kept)

    def colors(self, primvar: Primvar) -> Floats:
        corners = self.triangles.ravel()
        if primvar.interpolation is Interpolation.POINT:
            return np.ascontiguousarray(primvar.values[corners], np.float32)
        if primvar.interpolation is Interpolation.FACE:
            return np.repeat(primvar.values, 3, axis=0)
        return np.repeat(primvar.values[:1], 3 * len(self.triangles), axis=0)


def _on_mesh(primvar: Primvar, patch: NurbsPatch, vertices: _Vertices, rows: _Rows) -> Primvar:
    kind = primvar.interpolation
    if kind is Interpolation.CONSTANT:
        return primvar
    values = primvar.values if primvar.indices is None else primvar.values[primvar.indices]
    if kind is Interpolation.FACE:
        u, v = vertices.u, vertices.v
        i = u.spans[rows.cells[:, 0]] - (patch.u.order - 1)
        j = v.spans[rows.cells[:, 1]] - (patch.v.order - 1)
        return Primvar(primvar.name, kind, values[j * (patch.u.count - patch.u.order + 1) + i])
    if kind is Interpolation.POINT:
        found = vertices.values(Control.of(patch, values))
    else:
        shape = patch.v.count - patch.v.order + 2, patch.u.count - patch.u.order + 2, -1
        found = vertices.linear(values.astype(np.float64).reshape(shape))
    return Primvar(primvar.name, Interpolation.POINT, np.ascontiguousarray(found[rows.used], np.float32))
