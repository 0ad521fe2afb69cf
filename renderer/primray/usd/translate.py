"""Translation of a stage to a SceneDescription: the table of adapters, and the passes in order.

stage edits    edit_stage      copies of the stage with what the traversal cannot do: poses, back plates, levels of detail
view           view_setup.py   what is asked for, the camera, and when it exposes
traversal      assemble        groups of prims with what they inherit, then shapes, lights and placements from them
description    finish          what a view decides: the camera's frame, the default light, motion sample times

Stage edits are, in this order: a render pass, geometry lights, back plates, poses of skeletons, levels of detail. Most stages
need none of them and are not copied.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property, partial

from pxr import Usd

from ..description import Camera, CameraMotion, Frame, MotionSteps, SceneDescription
from ..description.lighting import NO_LINKS
from ..diagnostics import Diagnostics
from ..process_memory import machine_bytes, without_collection
from ..settings import RenderSettings
from .camera.back_plates import RenderedCamera, find_back_plates, with_back_plates
from .camera.lens import with_diffusion
from .camera.motion import camera_motion, nearest_distance
from .camera.near_plane import report_clipped_geometry
from .camera.view import cameras_of, estimate_view, view_through, view_without_scene
from .curves.adapter import basis_curves_of, hermite_curves_of, nurbs_curves_of
from .instancing.instances import Arrangement, Group, arrange, at_instant, merge_coincident
from .instancing.point_instancer import point_instances
from .lights.assembly import add_default_light
from .lights.geometry_light import with_geometry_lights
from .lights.light import light_at, report_unnamed_portals
from .lights.light_links import Links, find_links
from .mesh.adapter import mesh
from .mesh.triangulate import Triangulator, triangulated
from .motion.timing import Foreseen
from .primvars.surface_primvars import without_unread_primvars
from .render_settings.render_pass import with_render_pass
from .scene.assembly import (
    VOLUME,
    add_group,
    add_kept_groups,
    choose_times,
    note_errors,
    note_missing_primvars,
    scene_bounds,
    shared_paths,
)
from .scene.context import Context
from .scene.fog import fog_of
from .scene.inheritance import ResolvedPrim
from .scene.level_of_detail import with_levels_chosen
from .scene.translated_scene import Adapters, LightAdapter, Record, ShapeAdapter, TranslatedScene
from .scene.walk import walk
from .shapes.draw_mode import DRAW_MODES
from .shapes.implicit import sphere, tessellated
from .shapes.nurbs_patch import nurbs_patch
from .shapes.points import POINT, point_sphere
from .skinning.baking import any_drawn, posed_stage
from .stage.edits import OpinionsLeak, isolated_copy
from .stage.messages import file_names, scene_errors
from .stage.metadata import meters_per_unit, up_axis
from .stage.open import note_layers, usd_messages
from .stage.values import when_of
from .view_setup import SearchedStage, ViewSetup, find_by_type, set_up_view


class _ViewBeforeEdits:
    """The view of the stage before its edits, for those that depend on it; what it reports, the view afterwards reports too."""

    def __init__(self, searched: SearchedStage, settings: RenderSettings) -> None:
        self._searched, self._settings = searched, settings

    @cached_property
    def setup(self) -> ViewSetup:
        return set_up_view(self._searched, self._settings, Diagnostics(), {})

    @property
    def rendered_camera(self) -> RenderedCamera | None:
        """The camera of the stage that the picture is taken through, with its frame; None without one."""
        view = self.setup
        camera, frame = view_without_scene(view.camera, view.ctx, view.product, view.shutter)
        return None if view.camera is None or camera is None else RenderedCamera(view.camera, camera, frame)

    @property
    def foreseen(self) -> Foreseen:
        """How large things will appear."""
        return estimate_view(self.setup.camera, self.setup.ctx, self.setup.product)

    def camera_on(self, stage: Usd.Stage) -> Usd.Prim | None:
        """Return the camera's prim on a copy of the stage; None if the picture is not taken through a camera of the stage."""
        return None if self.setup.camera is None else stage.GetPrimAtPath(self.setup.camera.GetPath())


def edit_stage(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics) -> SearchedStage:
    """Return the stage to traverse: the stage itself, or an edited copy.

    Where an edit would change prims that it is not meant for, an isolated copy is edited instead.
    """
    count = len(diagnostics)
    try:
        return _edited(stage, settings, diagnostics)
    except OpinionsLeak:
        diagnostics.forget_after(count)
    # Not while that is handled: what USD prints of an error in its callbacks would show it as the cause.
    return _edited(isolated_copy(stage), settings, diagnostics)


def _edited(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics) -> SearchedStage:
    """Return the stage after its edits; raise OpinionsLeak if one would change prims that it is not meant for."""
    if settings.render_pass is not None:
        stage = with_render_pass(stage, settings.render_pass, diagnostics)
    when = when_of(stage, settings.time_code)
    searched = SearchedStage(stage, find_by_type(stage, diagnostics, settings.render_pass), when)
    view, found = _ViewBeforeEdits(searched, settings), searched.found
    if found.geometry_lights:
        stage = with_geometry_lights(stage, found.geometry_lights, view.setup.ctx.purposes, when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if plates := find_back_plates(found.cameras):
        stage = with_back_plates(stage, plates, view.rendered_camera, when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if any_drawn(stage, found.skeletons):
        stage = posed_stage(stage, when, view.foreseen, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if found.has_levels:
        stage = with_levels_chosen(stage, view.camera_on(stage), when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    return SearchedStage(stage, found, when)


def may_be_edited(searched: SearchedStage) -> bool:
    """Return whether a stage has prims of which some edit may be needed, render passes aside."""
    found = searched.found
    return bool(found.skeletons or found.geometry_lights or found.has_levels or find_back_plates(found.cameras))


# The adapter table: the function that translates prims of each type. The walk expands point instancers itself
# (adapters.point_instancer); cameras and render settings are not adapted where they are, but selected (view.py).
SHAPES: dict[str, ShapeAdapter] = {
    "Mesh": mesh,
    "TetMesh": mesh,
    "NurbsPatch": nurbs_patch,
    "Sphere": sphere,
    "Cube": tessellated,
    "Cone": tessellated,
    "Cylinder": tessellated,
    "Cylinder_1": tessellated,
    "Capsule": tessellated,
    "Capsule_1": tessellated,
    "Plane": tessellated,
    "BasisCurves": basis_curves_of,
    "HermiteCurves": hermite_curves_of,
    "NurbsCurves": nurbs_curves_of,
}
SHAPES |= DRAW_MODES  # stand-ins for prims of any type
SHAPES[POINT] = point_sphere
LIGHTS: dict[str, LightAdapter] = dict.fromkeys(
    ("DistantLight", "SphereLight", "DiskLight", "RectLight", "CylinderLight", "DomeLight", "DomeLight_1"), light_at
)

_PROTOTYPE = re.compile(r"/__Prototype_\d+")


def translate(
    stage: Usd.Stage, settings: RenderSettings, triangulator: Triangulator = triangulated
) -> tuple[SceneDescription, Diagnostics]:
    """Return the description that `settings` ask for, and diagnostics for everything that the picture will not show as
    authored. The compiled core's `triangulator` gives the same triangles as the one in NumPy, sooner."""
    diagnostics = Diagnostics(file_names(stage).in_text)
    names: dict[str, str] = {}
    with usd_messages(diagnostics), without_collection():
        view = set_up_view(edit_stage(stage, settings, diagnostics), settings, diagnostics, names, triangulator)
        description = finish(view, assemble(view.ctx, Record()))
    note_layers(stage)  # those of value clips have been opened by now
    return description, with_names(diagnostics, names)


def with_names(diagnostics: Diagnostics, names: dict[str, str]) -> Diagnostics:
    """Return the diagnostics with paths into prototypes replaced by the paths of their first instances."""
    shown = Diagnostics(diagnostics.shown)
    for d in diagnostics:
        path, message = (_PROTOTYPE.sub(lambda m: names.get(m[0], m[0]), text) for text in (d.prim_path, d.message))
        shown.add(d.code, path, message, d.attribute)
    return shown


@dataclass(frozen=True)
class Assembled:
    """Translated content of the stage, independent of the view as long as the shutter is closed."""

    ctx: Context
    scene: TranslatedScene
    groups: list[Group[ResolvedPrim]]
    where: Arrangement


def assemble(ctx: Context, record: Record) -> Assembled:
    """Traverse the stage and translate everything on it; `record` notes what an update after an edit needs."""
    groups, links, ctx = _walked(ctx, record)
    where = _arranged(groups, ctx)
    ctx = replace(ctx, shares=shared_paths(groups))
    record.told = len(ctx.diagnostics)
    scene = TranslatedScene(Adapters(SHAPES, LIGHTS), links, record)
    for g, group in enumerate(groups):
        add_group(scene, group, where, g, ctx)
    add_kept_groups(scene, groups, where)
    report_unnamed_portals(ctx)
    return Assembled(ctx, scene, groups, where)


def finish(view: ViewSetup, assembled: Assembled) -> SceneDescription:
    """Add what only a view decides (camera, default light, motion steps), and return the finished description."""
    ctx, scene = assembled.ctx, assembled.scene
    bounds = partial(scene_bounds, scene, assembled.groups, assembled.where, ctx)
    camera, frame = view_through(view.camera, ctx, view.product, view.shutter, bounds, lambda: scene.framed_objects)
    camera = with_diffusion(camera, ctx.settings)
    report_clipped_geometry(camera, scene.shapes, scene.static, ctx)
    may_need_light = add_default_light(scene, camera, ctx)
    note_missing_primvars(scene, ctx)
    motion, steps = None, list[MotionSteps]()
    if ctx.timing.is_open:
        motion, steps = _timed(scene, camera, frame, view, ctx)
    surfaces = tuple(ctx.surfaces)
    return SceneDescription(
        shapes=tuple(scene.shapes),
        surfaces=surfaces,
        static=tuple(scene.static),
        prototypes=tuple(scene.prototypes),
        placements=without_unread_primvars(scene.placements, scene.prototypes, scene.shapes, surfaces, ctx.aov_primvars),
        lights=tuple(scene.lights),
        camera=camera,
        resolution=frame.resolution,
        up_axis=up_axis(ctx.stage, ctx.diagnostics),
        meters_per_unit=meters_per_unit(ctx.stage, ctx.diagnostics),
        time_code=ctx.settings.time_code,
        aovs=view.aovs,
        pixels=None if frame.is_whole else frame.pixels,
        pixel_aspect_ratio=frame.pixel_aspect_ratio,
        linked=NO_LINKS if scene.links is None else scene.links.linked(ctx.diagnostics),
        rendering_space=ctx.rendering_space,
        exposure=ctx.timing.exposure if ctx.timing.is_open and (motion is not None or scene.moves) else None,
        camera_motion=motion,
        motion_steps=tuple(steps),
        asked=view.product.asked,
        file=view.product.file,
        may_need_light=may_need_light,
        media=tuple(scene.media),
        volume_emissions=tuple(scene.volume_emissions),
        fog=fog_of(view.camera, scene.lights, ctx),
        instances=tuple(sorted(ctx.prototype_names.values())) if view.aovs else (),
    )


def _timed(
    scene: TranslatedScene, camera: Camera, frame: Frame, view: ViewSetup, ctx: Context
) -> tuple[CameraMotion | None, list[MotionSteps]]:
    """Choose the times at which the camera and everything that moves are sampled; return the camera's motion and all steps."""
    motion, steps, error = None, list[MotionSteps](), ctx.settings.most_motion_error
    nearest = nearest_distance(camera, scene.framed_objects)
    moving = camera_motion(view.camera, camera, ctx, view.product, frame.resolution, nearest, error)
    if moving is not None:
        motion = moving[0]
        steps.append(moving[1].of(camera.path, "camera"))
    steps += [*choose_times(scene, ctx, camera, motion, frame.resolution), *ctx.findings.point_steps]
    note_errors(steps, ctx)
    return motion, steps


def _walked(ctx: Context, record: Record) -> tuple[list[Group[ResolvedPrim]], Links | None, Context]:
    """Return all groups and the light links. The walk is repeated where its result changes what it should have started with."""
    kinds = dict.fromkeys(SHAPES, "shape") | dict.fromkeys(LIGHTS, "light") | {VOLUME: "volume"}
    groups = walk(ctx, kinds, point_instances, record)
    widest = max(ctx.findings.blur_scales, default=1.0)
    if widest > ctx.timing.blur_scale:
        ctx = replace(ctx, timing=replace(ctx.timing, blur_scale=widest))
        groups = walk(ctx, kinds, point_instances, record)
    links = find_links((leaf for group in groups for leaf in group.leaves), ctx)
    if links is not None:  # instances that light links treat differently become separate groups
        groups = walk(ctx, kinds, point_instances, record, links)
    return groups, links, ctx


def _arranged(groups: list[Group[ResolvedPrim]], ctx: Context) -> Arrangement:
    """Compute instance placements; report cyclic and coincident instances."""
    for g, count in merge_coincident(groups, lambda leaf: leaf.type_name in LIGHTS).items():
        ctx.warn("instances-coincident", groups[g].path, f"{count:,} instances are exactly where another one is: left out.")
    where = arrange(groups, ctx.settings.max_memory_bytes or machine_bytes() // 2)
    if not ctx.timing.is_open and not ctx.timing.is_frame:
        where = at_instant(where, groups, ctx.timing.opens)
    for parent, child in where.cyclic:
        ctx.warn("invalid-instancer", groups[child].path, f"The prototype contains itself, through {groups[parent].path}.")
    return where


@scene_errors()
def camera_paths(stage: Usd.Stage) -> list[str]:
    """Return the paths of the cameras that a render may choose."""
    return [str(prim.GetPath()) for prim in cameras_of(stage)]
