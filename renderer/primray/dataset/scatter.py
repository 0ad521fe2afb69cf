"""Placement of things on surfaces without collision.

A thing stands with the bottom of its box on a point that is uniform over the surfaces' area. Boxes of things must be apart, as
the test of separating axes of oriented boxes decides (Gottschalk, Lin, Manocha 1996, "OBBTree", section 5): what is inside
boxes that are apart cannot touch. Larger things are placed first. Where one finds no place the whole arrangement begins
again, with other random numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Doubles
from ..errors import SettingsError
from .draws import Draws

TRIES = 200  # of one thing in one arrangement
ARRANGEMENTS = 50
_PARALLEL = 1e-5  # sine of the angle below which edges have no cross product
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True, eq=False)
class Box:
    """An oriented box. `axes` (3, 3): its unit axes as columns; `half` (3,): half its sizes along them."""

    center: Doubles
    axes: Doubles
    half: Doubles

    @cached_property
    def radius(self) -> float:
        """Of the sphere around it."""
        return float(np.linalg.norm(self.half))

    @staticmethod
    def of(corners: tuple[Doubles, Doubles], world: Doubles) -> Box:
        """Return the box in the world of one in a prim's space; where it is sheared, an upright box that holds it."""
        low, high = corners
        middle, half = (low + high) / 2, (high - low) / 2
        linear = world[:3, :3]
        sizes = np.linalg.norm(linear, axis=0)
        axes = linear / np.where(sizes > 0, sizes, 1)
        center = linear @ middle + world[:3, 3]
        if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-6:  # sheared, or flat
            extent = np.abs(linear) @ half
            return Box(center, np.eye(3), extent)
        return Box(center, axes, half * sizes)

    def grown(self, by: float) -> Box:
        return Box(self.center, self.axes, self.half + by)


def are_apart(a: Box, b: Box) -> bool:
    """Return whether a plane separates two boxes; touching ones are apart."""
    between = b.center - a.center
    if float(between @ between) >= (a.radius + b.radius) ** 2:
        return True
    # Test the faces of both, then the cross products of their edges, which near-parallel edges do not have.
    turn = a.axes.T @ b.axes
    reach, at = np.abs(turn), a.axes.T @ between
    slack = 1e-9 * (a.radius + b.radius)
    if (np.abs(at) >= a.half + reach @ b.half - slack).any():
        return True
    if (np.abs(b.axes.T @ between) >= b.half + a.half @ reach - slack).any():
        return True
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        across = a.half[j] * reach[k] + a.half[k] * reach[j]
        across = across + b.half[_NEXT] * reach[i][_AFTER] + b.half[_AFTER] * reach[i][_NEXT]
        lengths = np.sqrt(np.maximum(0, 1 - turn[i] ** 2))
        away = np.abs(at[k] * turn[j] - at[j] * turn[k])
        if ((away >= across - slack * lengths) & (lengths > _PARALLEL)).any():
            return True
    return False


class Surfaces:
    """Triangles (N, 3, 3) in the world to place things on: those that face upwards by `up`."""

    def __init__(self, triangles: Doubles, up: Doubles, steepest_deg: float) -> None:
        crosses = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        doubled = np.linalg.norm(crosses, axis=1)
        least = math.cos(math.radians(steepest_deg)) - 1e-9
        faces_up = (doubled > 0) & (crosses @ up >= least * doubled)
        self.triangles, self.up = triangles[faces_up], up
        self.normals = crosses[faces_up] / doubled[faces_up, None]
        self._ends = np.cumsum(doubled[faces_up])
        across = np.eye(3)[int(np.argmin(np.abs(up)))]
        x = np.cross(across, up)
        x /= np.linalg.norm(x)
        self._plan = np.stack([x, np.cross(up, x)])  # (2, 3): the horizontal plane
        self._flat = self.triangles @ self._plan.T

    def __bool__(self) -> bool:
        return len(self.triangles) > 0

    def point(self, draws: Draws) -> tuple[Doubles, Doubles]:
        """Return a point that is uniform over the area, and the normal there."""
        at = draws.uniform(0.0, float(self._ends[-1]))
        k = min(int(np.searchsorted(self._ends, at, side="right")), len(self.triangles) - 1)
        u, v = math.sqrt(draws.uniform()), draws.uniform()
        a, b, c = self.triangles[k]
        return (1 - u) * a + u * (1 - v) * b + u * v * c, self.normals[k]

    def holds(self, points: Doubles) -> bool:
        """Return whether each of the points (N, 3) is above or below one of the triangles."""
        p = points @ self._plan.T
        a, b, c = (self._flat[None, :, k] for k in range(3))
        signs = [_cross(second - first, p[:, None] - first) for first, second in ((a, b), (b, c), (c, a))]
        slack = 1e-9 * float(np.abs(self._flat).max() + 1)
        inside = np.minimum(np.minimum(*signs[:2]), signs[2]) >= -slack
        return bool(inside.any(axis=1).all())


def _cross(a: Doubles, b: Doubles) -> Doubles:
    crossed: Doubles = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return crossed


@dataclass(frozen=True)
class Scattering:
    """How things are placed. `gap`: least distance between boxes, scene units; `yaw_deg`: range of turns about up."""

    gap: float = 0.0
    yaw_deg: tuple[float, float] = (0.0, 360.0)
    upright: bool = True  # else the thing's up is the surface's normal
    overhang: bool = False  # whether the corners of a box's bottom may be beyond the surfaces


def place_all(
    things: Mapping[str, tuple[tuple[Doubles, Doubles], Doubles]],
    surfaces: Surfaces,
    obstacles: Sequence[Box],
    how: Scattering,
    draws: Draws,
) -> dict[str, Doubles]:
    """Return world_from_prim (4, 4) of each thing, by path, so that boxes touch neither each other nor `obstacles`.

    `things` have their box in their own space, and the linear part of their transform in the world (3, 3): their size and
    which of their directions is up. SettingsError, dataset-crowded, where no arrangement is found.
    """
    order = sorted(things, key=lambda path: (-_footprint(things[path], surfaces.up), path))
    hardest = order[0] if order else ""
    for attempt in range(ARRANGEMENTS):
        placed: dict[str, Doubles] = {}
        taken = [box.grown(how.gap / 2) for box in obstacles]
        for path in order:
            found = _placed(things[path], surfaces, taken, how, draws.of(f"{path}\n{attempt}"))
            if found is None:
                hardest = path
                break
            placed[path], box = found
            taken.append(box)
        if len(placed) == len(order):
            return placed
    raise SettingsError(
        f"no place was found for it among {len(things)} things, in {ARRANGEMENTS} arrangements; use fewer or smaller things, "
        "a larger surface, a smaller gap, or overhang: true",
        where=hardest,
        code="dataset-crowded",
    )


def _footprint(thing: tuple[tuple[Doubles, Doubles], Doubles], up: Doubles) -> float:
    (low, high), linear = thing
    return float(np.linalg.norm(np.abs(linear) @ (high - low) * (1 - np.abs(up))))


def _placed(
    thing: tuple[tuple[Doubles, Doubles], Doubles], surfaces: Surfaces, taken: Sequence[Box], how: Scattering, draws: Draws
) -> tuple[Doubles, Box] | None:
    (low, high), linear = thing
    for _ in range(TRIES):
        point, normal = surfaces.point(draws)
        turn = _turn_about(surfaces.up, math.radians(draws.uniform(*how.yaw_deg)))
        if not how.upright:
            turn = _shortest_turn(surfaces.up, normal) @ turn
        up = surfaces.up if how.upright else normal
        world = np.eye(4)
        world[:3, :3] = turn @ linear
        corners = _corners(low, high) @ world[:3, :3].T
        heights = corners @ up
        bottom = corners[np.argsort(heights, kind="stable")[:4]]
        foot = (corners.max(0) + corners.min(0)) / 2
        foot = foot + (heights.min() - foot @ up) * up
        world[:3, 3] = point - foot
        if not how.overhang and not surfaces.holds(bottom + world[:3, 3]):
            continue
        box = Box.of((low, high), world).grown(how.gap / 2)
        if all(are_apart(box, other) for other in taken):
            return world, box
    return None


def _corners(low: Doubles, high: Doubles) -> Doubles:
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _turn_about(axis: Doubles, angle: float) -> Doubles:
    """Return the rotation matrix about a unit axis (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Doubles = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k)
    return turned


def _shortest_turn(one: Doubles, other: Doubles) -> Doubles:
    axis, cosine = np.cross(one, other), float(np.clip(one @ other, -1, 1))
    size = float(np.linalg.norm(axis))
    return np.eye(3) if size < 1e-9 else _turn_about(axis / size, math.atan2(size, cosine))
