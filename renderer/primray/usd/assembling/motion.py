"""Times at which moving shapes and lights are sampled, once it is known how large they appear."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...description import Camera, CameraMotion, MotionSteps, Placement
from ..lights.motion import with_motion, with_moving_portals
from ..moving.levels import do_move
from ..moving.pixels import pixels_of
from ..moving.settle import Precision, settled
from ..resolving.context import Context
from ..viewing.drawn import prototype_box
from .scene import Scene


def settle(
    scene: Scene, ctx: Context, camera: Camera, motion: CameraMotion | None, resolution: tuple[int, int]
) -> list[MotionSteps]:
    """Choose the times of everything that moves, and return the steps of each."""
    cameras = (camera, *(motion.cameras if motion else ()))
    precision = Precision(ctx.timing, pixels_of(cameras, resolution), ctx.settings.most_motion_error)

    def at_seam(placement: Placement) -> Placement:
        number = placement.prototype
        box = prototype_box(scene.shapes, scene.prototypes, number) if do_move(placement.levels) else (np.zeros(3), np.zeros(3))
        return settled(placement, scene.blur_scales[number], box, scene.prototypes[number].path, precision)

    scene.placements = [at_seam(placement) for placement in scene.placements]
    for number, path in scene.moving_lights:
        scene.lights[number] = with_motion(scene.lights[number], path, precision, ctx)
    for k, prototype in enumerate(scene.prototypes):
        if prototype.placements:
            scene.prototypes[k] = replace(prototype, placements=tuple(map(at_seam, prototype.placements)))
    if motion is not None or scene.moves:  # motion of portals alone does not show in a picture
        paths = dict(scene.moving_lights)
        for number, made in enumerate(scene.lights):
            if made.portals:
                scene.lights[number] = with_moving_portals(made, paths.get(number), precision, ctx)
    return precision.steps


def note_errors(steps: list[MotionSteps], ctx: Context) -> None:
    """Report motion that would have needed more times than are allowed."""
    for found in steps:
        if found.error > ctx.settings.most_motion_error:
            pixels = f"{found.error:.2g}" if math.isfinite(found.error) else "any number of"
            left = f"its path is sampled in {found.segments} steps, which leaves an error of up to {pixels} pixels."
            ctx.warn("motion", ctx.shown(found.path), f"It moves fast: {left}")
