"""Translation of a stage to a SceneDescription: the table of adapters, and the order of the passes.

One pass over the stage and its native prototypes finds the prims that are needed by type, wherever they are.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

from pxr import Usd

from ..aovs import VECTORS, AovRequest, names_instances, primvars_of, with_distances
from ..description import Camera, CameraMotion, Frame, MotionSteps, SceneDescription
from ..diagnostics import Diagnostics
from ..process_memory import machine_bytes, without_collection
from ..settings import RenderSettings
from .camera.back_plates import RenderedCamera, find_back_plates, with_back_plates
from .camera.lens import with_diffusion
from .camera.motion import camera_motion, nearest_distance
from .camera.near_plane import report_clipped_geometry
from .camera.shutter import Shutter, motion_vector_shutter, render_timing, report_closed_shutter
from .camera.view import (
    cameras_in_instances,
    cameras_of,
    estimate_view,
    estimate_view_through,
    exposure_times,
    select_camera,
    view_through,
    view_without_scene,
)
from .curves.adapter import basis_curves_of, hermite_curves_of, nurbs_curves_of
from .instancing.instances import Arrangement, Group, arrange, at_instant, merge_coincident
from .instancing.point_instancer import point_instances
from .lights.assembly import add_default_light
from .lights.geometry_light import with_geometry_lights
from .lights.light import light_at
from .lights.light_groups import light_groups
from .lights.light_links import Links, find_links
from .lights.portals import report_unnamed_portals
from .materials.material_primvars import primvars_read
from .mesh.adapter import mesh
from .motion.pixels import Foreseen
from .nurbs.adapter import nurbs_patch
from .render_settings.outputs import outputs_of
from .render_settings.render_pass import report_ignored_render_pass, with_render_pass
from .render_settings.render_product import ProductSettings
from .render_settings.render_settings import product_settings
from .scene.assembly import (
    add_group,
    add_kept_groups,
    choose_times,
    describe,
    note_errors,
    note_missing_primvars,
    scene_bounds,
    shared_paths,
)
from .scene.color_spaces import rendering_space
from .scene.context import Context
from .scene.inheritance import ResolvedPrim
from .scene.level_of_detail import with_levels_chosen
from .scene.notes import LevelsMet
from .scene.translated_scene import Adapters, LightAdapter, Record, ShapeAdapter, TranslatedScene
from .scene.walk import walk
from .shapes.draw_mode import DRAW_MODES
from .shapes.implicit import sphere, tessellated
from .shapes.points import POINT, point_sphere
from .skinning.baking import any_drawn, posed_stage
from .stage.edits import OpinionsLeak, isolated_copy
from .stage.messages import file_names, scene_errors
from .stage.metadata import meters_per_unit
from .stage.open import usd_messages
from .stage.reads import type_name
from .stage.traversal import exists, is_in_world, populated, prims_in_instances
from .stage.values import When, when_of

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


def translate(stage: Usd.Stage, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
    """Return the description that `settings` ask for, and diagnostics for everything that the picture will not show as
    authored."""
    diagnostics = Diagnostics(file_names(stage).in_text)
    names: dict[str, str] = {}
    with usd_messages(diagnostics), without_collection():
        description = _translate(stage, settings, diagnostics, names)
    return description, with_names(diagnostics, names)


def with_names(diagnostics: Diagnostics, names: dict[str, str]) -> Diagnostics:
    """Return the diagnostics with paths into prototypes replaced by the paths of their first instances."""
    shown = Diagnostics(diagnostics.shown)
    for d in diagnostics:
        path, message = (_PROTOTYPE.sub(lambda m: names.get(m[0], m[0]), text) for text in (d.prim_path, d.message))
        shown.add(d.code, path, message, d.attribute)
    return shown


@dataclass(frozen=True)
class ViewSetup:
    """State before the walk: the settings, and the camera, whose shutter decides at what times values are read."""

    ctx: Context
    product: ProductSettings
    camera: Usd.Prim | None
    shutter: Shutter
    aovs: tuple[AovRequest, ...]


@dataclass(frozen=True)
class Assembled:
    """Translated content of the stage, independent of the view as long as the shutter is closed."""

    ctx: Context
    scene: TranslatedScene
    groups: list[Group[ResolvedPrim]]
    where: Arrangement


def _translate(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics, names: dict[str, str]) -> SceneDescription:
    """Translate the stage by editing copies of it; an isolated stage where those edits would change other prims too."""
    count = len(diagnostics)
    with suppress(OpinionsLeak):
        return _edited(stage, settings, diagnostics, names)
    diagnostics.forget_after(count)
    names.clear()
    return _edited(isolated_copy(stage), settings, diagnostics, names)


def _edited(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics, names: dict[str, str]) -> SceneDescription:
    """Translate a stage after editing copies of it; raise OpinionsLeak where an edit would change prims that it is not meant
    for."""
    if settings.render_pass is not None:
        stage = with_render_pass(stage, settings.render_pass, diagnostics)
    found, when = find_by_type(stage, diagnostics, settings.render_pass), when_of(stage, settings.time_code)
    if found.geometry_lights:
        purposes = context_of(stage, settings, found, when, Diagnostics(), {})[0].purposes
        stage = with_geometry_lights(stage, found.geometry_lights, purposes, when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if plates := find_back_plates(found.cameras):
        stage = with_back_plates(stage, plates, _looks(stage, settings, found, when), when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if any_drawn(stage, found.skeletons):
        stage = posed_stage(stage, when, _foreseen(stage, settings, found, when), diagnostics)
        found = find_by_type(stage, Diagnostics())
    try:
        return _described(stage, settings, found, when, diagnostics, names)
    except LevelsMet:
        ctx, product = context_of(stage, settings, found, when, Diagnostics(), {})
        stage = with_levels_chosen(stage, select_camera(stage, ctx, product, found.cameras), when, diagnostics)
        found = find_by_type(stage, Diagnostics())
        return _described(stage, settings, found, when, diagnostics, names, levels_chosen=True)


def _described(
    stage: Usd.Stage,
    settings: RenderSettings,
    found: Found,
    when: When,
    diagnostics: Diagnostics,
    names: dict[str, str],
    *,
    levels_chosen: bool = False,
) -> SceneDescription:
    """Translate an edited stage; raise LevelsMet where levels of detail have yet to be chosen."""
    ctx, product = context_of(stage, settings, found, when, diagnostics, names)
    begun = set_up_view(found, (replace(ctx, levels_chosen=levels_chosen), product))
    return finish(begun, assemble(begun.ctx, Record()))


def context_of(
    stage: Usd.Stage, settings: RenderSettings, found: Found, when: When, diagnostics: Diagnostics, names: dict[str, str]
) -> tuple[Context, ProductSettings]:
    """Return the context that a translation begins with, and the product settings that the stage's render settings give."""
    product = product_settings(stage, settings, found.settings, when, diagnostics)
    error = settings.motion_error if settings.motion_error is not None else product.asked.of("motion_error")
    settings = settings if error is settings.motion_error else replace(settings, motion_error=error)
    return _context(stage, settings, when, product, diagnostics, names), product


def set_up_view(found: Found, started: tuple[Context, ProductSettings]) -> ViewSetup:
    ctx, product = started
    settings = ctx.settings
    space = rendering_space(product.settings_path, product.rendering_color_space, ctx)
    aovs, file = outputs_of(product, settings, ctx.diagnostics)
    aovs = with_distances(aovs, meters_per_unit(ctx.stage))
    product = replace(product, file=file)
    has_names = any(names_instances(request.source) for request in aovs)
    ctx = replace(ctx, rendering_space=space, aov_primvars=primvars_of(aovs), names_instances=has_names)
    ctx = replace(ctx, light_groups=light_groups(ctx.stage, product.settings_path))
    read, of_colors = primvars_read(found.shaders, ctx)
    of_aovs = {f"primvars:{name}" for name in ctx.aov_primvars}
    ctx = replace(ctx, primvars_read=read | of_aovs, color_primvars=of_colors)
    camera = select_camera(ctx.stage, ctx, product, found.cameras)
    shutter, rolling = exposure_times(camera, ctx, product)
    is_vectored = any(request.source in VECTORS for request in aovs)
    vectors = motion_vector_shutter(camera, shutter, ctx) if is_vectored else None
    if is_vectored:
        report_closed_shutter(shutter, vectors, ctx)
    ctx = replace(ctx, timing=render_timing(shutter, bool(aovs), ctx, vectors, rolling))
    if ctx.timing.is_open:
        ctx = replace(ctx, foreseen=estimate_view_through(camera, shutter, ctx, product))
    return ViewSetup(ctx, product, camera, shutter, aovs)


def assemble(ctx: Context, record: Record) -> Assembled:
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


def finish(begun: ViewSetup, assembled: Assembled) -> SceneDescription:
    """Add what only a view decides (camera, default light, motion steps), and return the finished description."""
    ctx, scene, product = assembled.ctx, assembled.scene, begun.product
    bounds = partial(scene_bounds, scene, assembled.groups, assembled.where, ctx)
    camera, frame = view_through(begun.camera, ctx, product, begun.shutter, bounds, lambda: scene.framed_objects)
    camera = with_diffusion(camera, ctx.settings)
    report_clipped_geometry(camera, scene.shapes, scene.static, ctx)
    may_need_light = add_default_light(scene, camera, ctx)
    note_missing_primvars(scene, ctx)
    motion, steps = None, list[MotionSteps]()
    if ctx.timing.is_open:
        motion, steps = _timed(scene, camera, frame, begun, ctx)
    instances = tuple(sorted(ctx.prototype_names.values())) if begun.aovs else ()
    described = describe(scene, ctx, camera, motion, frame, begun.aovs)
    described = replace(described, file=product.file, asked=product.asked, may_need_light=may_need_light)
    return replace(described, motion_steps=tuple(steps), instances=instances)


def _timed(
    scene: TranslatedScene, camera: Camera, frame: Frame, begun: ViewSetup, ctx: Context
) -> tuple[CameraMotion | None, list[MotionSteps]]:
    """Choose the times at which the camera and everything that moves are sampled; return the camera's motion and all steps."""
    motion, steps, error = None, list[MotionSteps](), ctx.settings.most_motion_error
    nearest = nearest_distance(camera, scene.framed_objects)
    moving = camera_motion(begun.camera, camera, ctx, begun.product, frame.resolution, nearest, error)
    if moving is not None:
        motion = moving[0]
        steps.append(moving[1].of(camera.path, "camera"))
    steps += [*choose_times(scene, ctx, camera, motion, frame.resolution), *ctx.findings.point_steps]
    note_errors(steps, ctx)
    return motion, steps


def _looks(stage: Usd.Stage, settings: RenderSettings, found: Found, when: When) -> RenderedCamera | None:
    """Return the camera of the stage that the picture is taken through, with its frame; None without one."""
    begun = set_up_view(found, context_of(stage, settings, found, when, Diagnostics(), {}))
    camera, frame = view_without_scene(begun.camera, begun.ctx, begun.product, begun.shutter)
    return None if begun.camera is None or camera is None else RenderedCamera(begun.camera, camera, frame)


def _foreseen(stage: Usd.Stage, settings: RenderSettings, found: Found, when: When) -> Foreseen:
    """Return how large things will appear. Diagnostics here are discarded; they are reported when the posed stage is
    translated."""
    ctx, product = context_of(stage, settings, found, when, Diagnostics(), {})
    return estimate_view(ctx, product, found.cameras)


def _walked(ctx: Context, record: Record) -> tuple[list[Group[ResolvedPrim]], Links | None, Context]:
    """Return all groups and the light links. The walk is repeated where its result changes what it should have started with."""
    kinds = dict.fromkeys(SHAPES, "shape") | dict.fromkeys(LIGHTS, "light")
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


def _context(
    stage: Usd.Stage,
    settings: RenderSettings,
    when: When,
    wanted: ProductSettings,
    diagnostics: Diagnostics,
    names: dict[str, str],
) -> Context:
    purposes = settings.purposes if settings.purposes is not None else wanted.purposes
    return Context(stage, settings, when, purposes, wanted.material_purposes, diagnostics, prototype_names=names)


@scene_errors()
def camera_paths(stage: Usd.Stage) -> list[str]:
    """Return the paths of the cameras that a render may choose."""
    return [str(prim.GetPath()) for prim in cameras_of(stage)]


_TYPES = frozenset({"Camera", "RenderSettings", "RenderPass", "Shader", "SkelRoot", "GeometryLight"})


@dataclass
class Found:
    """Prims of some types; cameras and settings are those in the world."""

    cameras: list[Usd.Prim] = field(default_factory=list)  # in the order of cameras_of
    in_prototypes: bool = False  # some cameras are in native prototypes
    lights_in_prototypes: bool = False  # some geometry lights are
    settings: list[Usd.Prim] = field(default_factory=list)
    geometry_lights: list[Usd.Prim] = field(default_factory=list)  # in the world
    shaders: list[Usd.Prim] = field(default_factory=list)  # including those in native prototypes
    skeletons: list[Usd.Prim] = field(default_factory=list)  # SkelRoots, including those in native prototypes


def find_by_type(stage: Usd.Stage, diagnostics: Diagnostics, render_pass: str | None = None) -> Found:
    """Return the prims of these types. `render_pass` is the pass that is rendered; others are reported."""
    found = Found()
    for prim in populated(stage):
        name = type_name(prim)
        if name in _TYPES and exists(prim):
            _add(found, prim, str(name), diagnostics, render_pass)
    if found.in_prototypes:
        found.cameras += cameras_in_instances(stage)
    if found.lights_in_prototypes:
        found.geometry_lights += prims_in_instances(stage, "GeometryLight")
    return found


def _add(found: Found, prim: Usd.Prim, name: str, diagnostics: Diagnostics, render_pass: str | None) -> None:
    if name == "Shader":
        found.shaders.append(prim)
    elif name == "SkelRoot":
        found.skeletons.append(prim)
    elif prim.IsInPrototype() or not is_in_world(prim):
        found.in_prototypes |= name == "Camera"
        found.lights_in_prototypes |= name == "GeometryLight"
    elif name == "Camera":
        found.cameras.append(prim)
    elif name == "RenderSettings":
        found.settings.append(prim)
    elif name == "GeometryLight":
        found.geometry_lights.append(prim)
    elif render_pass is None:
        report_ignored_render_pass(prim, diagnostics)
