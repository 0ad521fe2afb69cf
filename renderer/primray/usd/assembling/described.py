"""Conversion of the assembled scene to a SceneDescription."""

from __future__ import annotations

from ...aov_names import WIDE, AovRequest
from ...description import Camera, CameraMotion, Frame, SceneDescription
from ...description.lighting import NO_LINKS
from ..opening.stage_metadata import meters_per_unit, up_axis
from ..resolving.context import Context
from ..shapes.instance_primvars import without_unread
from .scene import Scene


def describe(
    scene: Scene,
    ctx: Context,
    camera: Camera,
    motion: CameraMotion | None,
    frame: Frame,
    aovs: tuple[AovRequest, ...],
) -> SceneDescription:
    return SceneDescription(
        tuple(scene.shapes),
        tuple(ctx.surfaces),
        tuple(scene.static),
        tuple(scene.prototypes),
        without_unread(scene.placements, scene.prototypes, scene.shapes, tuple(ctx.surfaces), ctx.aov_primvars),
        tuple(scene.lights),
        camera,
        frame.resolution,
        up_axis(ctx.stage, ctx.diagnostics),
        meters_per_unit(ctx.stage, ctx.diagnostics),
        ctx.settings.time_code,
        aovs,
        None if frame.is_whole else frame.pixels,
        frame.pixel_aspect_ratio,
        NO_LINKS if scene.links is None else scene.links.linked(ctx.diagnostics),
        ctx.rendering_space,
        ctx.timing.exposure if ctx.timing.is_open and (motion is not None or scene.moves) else None,
        motion,
    )


def note_missing_primvars(scene: Scene, ctx: Context) -> None:
    there = {p.name.removeprefix(WIDE) for owner in (*scene.shapes, *scene.placements) for p in owner.primvars}
    for name in ctx.aov_primvars:
        if name not in there:
            ctx.warn("aov-empty", "", f"Nothing in the picture has primvars:{name}: its AOV is 0 everywhere.")
