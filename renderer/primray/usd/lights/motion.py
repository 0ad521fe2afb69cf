"""Moving lights and portals: their motion is rigid, so that size and emission stay those of the frame.

Portals move with their parents or alone, and stay in front of the openings that they guide a dome's samples to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from pxr import Usd

from ...arrays import Doubles
from ...description import Light, LightType, MatrixMotion, Portal
from ...description.lighting import half_extent
from ...description.placement import Instances
from ..motion.attributes import animated_operations, bend_times, blur_scale_of, is_animated
from ..motion.levels import product_at, times_of
from ..motion.matrices import (
    MatrixPath,
    MotionPrecision,
    have_rotations,
    polar_decomposition,
    rotation_matrices,
    sampled_motion,
)
from ..motion.sample_times import corners_of, fractions
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import property_names
from .light import self_and_ancestors, world_from_prim

SIZES = ("inputs:radius", "inputs:width", "inputs:height", "inputs:length", "inputs:angle")
SAME_SIZE = 1e-6
_INFINITE = (LightType.DISTANT, LightType.DOME)
INFINITE_NO_ERROR = 1e-4  # pixels


@dataclass(frozen=True, eq=False)
class LightPath:
    """Motion of a light in an instance: the instance levels, its row in them, and the light's place in the group."""

    levels: Sequence[Instances]
    row: int
    group_from_light: Doubles  # (4, 4)
    blur_scale: float

    def at(self, offset: float) -> Doubles:
        """Return world_from_light (4, 4) at a time offset."""
        world = np.eye(4)
        world[:3] = product_at(self.levels, offset)[self.row]
        return np.asarray(world @ self.group_from_light)

    @property
    def times(self) -> tuple[float, ...]:
        """Time offsets from the frame at which the path may bend."""
        return times_of(self.levels)


class TransformPath(Protocol):
    """A transform over time: world matrices (4, 4) by time offset from the frame, and the offsets where the path may bend."""

    @property
    def at(self) -> Callable[[float], Doubles]: ...
    @property
    def times(self) -> tuple[float, ...]: ...
    @property
    def blur_scale(self) -> float: ...


def report_changing_size(prim: ResolvedPrim, ctx: Context) -> None:
    """Report sizes of a light that change while the shutter is open: they are not blurred."""
    if ctx.timing.is_frame:
        return
    for name in SIZES:
        if name in prim.names and is_animated(prim.prim.GetAttribute(name), ctx.when, ctx.timing):
            ctx.warn("motion", prim.path, f"{name} is not blurred: a light keeps its size at the frame.", name)


def with_motion(light: Light, path: TransformPath, precision: MotionPrecision, ctx: Context) -> Light:
    """Return the light with its motion if it moves; report motion that cannot be rendered (a change of size)."""
    timing, scale = precision.timing, path.blur_scale
    bent = fractions(path.times, timing.span, scale)
    inside = [time for time in bent if 0.0 < time < 1.0]
    known: dict[float, Doubles] = {}

    def world(fraction: float) -> Doubles:
        if fraction not in known:
            known[fraction] = path.at(scale * timing.offset(fraction))
        return known[fraction]

    looked_at = [world(time) for time in (0.0, *inside, 0.5, 1.0)]
    if all(np.array_equal(matrix, looked_at[0]) for matrix in looked_at):
        return light
    frame = path.at(0.0)
    problem = _unrendered_motion(np.stack([frame, *looked_at]))
    if problem:
        ctx.warn("motion", light.path, problem)
    turns = have_rotations(np.stack([frame, *looked_at])[:, None, :3])
    start = polar_decomposition(frame[None, :3]) if turns else None

    def rigid(fraction: float) -> Doubles:
        """Return the light's rigid motion applied to its matrix at the frame, (1, 3, 4)."""
        moved = light.world_from_light.copy()
        then = world(fraction)
        if start is not None:
            rotation = rotation_matrices(polar_decomposition(then[None, :3]).quaternions)[0]
            moved[:3, :3] = rotation @ rotation_matrices(start.quaternions)[0].T @ moved[:3, :3]
        if light.type not in _INFINITE:
            moved[:3, 3] = then[:3, 3]
        return moved[None, :3]

    found, steps = sampled_motion(_visible_path(light, rigid, bent, precision), precision.most, rigid=True)
    if len({rigid(time).tobytes() for time in steps.times}) == 1:
        return light
    precision.steps.append(steps.of(light.path, "lights"))
    matrices = np.zeros((len(steps.times), 4, 4))
    matrices[:, :3], matrices[:, 3, 3] = found.matrices[:, 0], 1.0
    return replace(light, motion=MatrixMotion(found.times, matrices, found.turns))


def _unrendered_motion(matrices: Doubles) -> str:
    """Return a sentence on what of a light's motion is not rendered; "" if all is."""
    if not have_rotations(matrices[:, None, :3]):
        flat = not np.array_equal(matrices[:, :3, :3], np.broadcast_to(matrices[0, :3, :3], matrices[:, :3, :3].shape))
        return "Only the light's position is blurred, as its transform is singular." if flat else ""
    stretches = polar_decomposition(matrices[:, :3]).stretches
    size = np.abs(stretches[0]).max()
    if np.abs(stretches - stretches[0]).max() <= SAME_SIZE * size:
        return ""
    return "The light's size changes while the shutter is open: its position and rotation are blurred, its size is the frame's."


def _visible_path(light: Light, rigid: object, bent: Sequence[float], precision: MotionPrecision) -> MatrixPath:
    """Return the path and how visible its errors are (pixels per unit), over the light's size and along its beam."""
    assert callable(rigid)
    half = np.array(half_extent(light))
    places = np.array([rigid(time)[0, :, 3] for time in (0.0, 0.5, 1.0)])
    if light.type in _INFINITE:
        return MatrixPath(
            rigid, bent, corners_of(-np.ones(3), np.ones(3)), np.array([precision.pixels.per_unit]), INFINITE_NO_ERROR
        )
    if light.shaping is not None:
        stretch = float(np.linalg.norm(light.world_from_light[:3, :3], axis=0).max()) or 1.0
        away = np.linalg.norm(places[:, None] - precision.pixels.eyes, axis=2).max()
        half = np.maximum(half, away / stretch)
    reach = np.abs(light.world_from_light[:3, :3]) @ half
    low, high = (places.min(axis=0) - reach)[None], (places.max(axis=0) + reach)[None]
    return MatrixPath(rigid, bent, corners_of(-half, half), precision.pixels.per_length(low, high), INFINITE_NO_ERROR)


WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class PortalPath:
    """A portal's world transform by time offset from the frame."""

    at: Callable[[float], Doubles]  # (4, 4)
    times: tuple[float, ...]  # offsets at which the path may bend
    blur_scale: float


def with_moving_portals(dome: Light, path: LightPath | None, precision: MotionPrecision, ctx: Context) -> Light:
    """Return the dome with the motion of its portals; `path` is the dome's own motion, if it moves."""
    return replace(dome, portals=tuple(_moving_portal(portal, path, precision, ctx) for portal in dome.portals))


def _moving_portal(portal: Portal, dome_path: LightPath | None, precision: MotionPrecision, ctx: Context) -> Portal:
    known = ctx.findings.moving_portals.get(id(portal))
    if known is None:
        return portal
    path = _portal_path(known.prim, known.dome, known.world_from_dome, dome_path, ctx)
    shape = Light(known.path, LightType.RECT, portal.world_from_portal, WHITE, width=portal.width, height=portal.height)
    return replace(portal, motion=with_motion(shape, path, precision, ctx).motion)


def _portal_path(
    prim: Usd.Prim, dome: Usd.Prim | None, world_from_dome: Doubles, dome_path: LightPath | None, ctx: Context
) -> PortalPath:
    """Return a portal's path. `dome` is given if both are in one prototype, whose placement is known by the dome's."""
    times = _bend_times(prim, ctx)
    if dome is None:
        return PortalPath(lambda offset: world_from_prim(prim, ctx, offset), times, blur_scale_of(prim))
    own = () if dome_path is None else dome_path.times

    def at(offset: float) -> Doubles:
        world = world_from_dome if dome_path is None else dome_path.at(offset)
        return np.asarray(world @ np.linalg.inv(world_from_prim(dome, ctx, offset)) @ world_from_prim(prim, ctx, offset))

    return PortalPath(at, (*times, *own), 1.0 if dome_path is None else dome_path.blur_scale)


def _bend_times(prim: Usd.Prim, ctx: Context) -> tuple[float, ...]:
    found = [
        operation
        for above in self_and_ancestors(prim)
        for operation in animated_operations(above, frozenset(property_names(above)), ctx.when, ctx.timing)
    ]
    return tuple(bend_times(found, ctx.when, ctx.timing))
