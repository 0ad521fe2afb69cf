"""From a stage to a SceneDescription: the table of adapters, and the order in which they are asked."""

from __future__ import annotations

import gc
import math
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
from pxr import Tf, Usd

from ..aov_names import VECTORS, WIDE, AovRequest, primvars_of, requests_of
from ..arrays import Doubles
from ..description import (
    Camera,
    CameraMotion,
    Frame,
    Light,
    MotionSteps,
    MovingInstances,
    Placed,
    Placement,
    Prototype,
    SceneDescription,
    Shape,
    Sphere,
    Surface,
)
from ..description.instance_names import name_of
from ..description.lighting import NO_LINKS
from ..description.placement import IDENTITY, MatrixInstances, chunks, named_levels, rows_of_levels
from ..diagnostics import Diagnostics
from ..settings import RenderSettings
from .adapters.lights.geometry_light import as_light, without_material
from .adapters.lights.light import light
from .adapters.lights.light_rules import rules_of
from .adapters.rendering.render_product import ProductSettings
from .adapters.rendering.render_settings import product_settings
from .adapters.rendering.render_var import aovs_of_variables
from .adapters.shapes.draw_mode import DRAW_MODES
from .adapters.shapes.implicit import sphere, tessellated
from .adapters.shapes.mesh import mesh
from .adapters.shapes.point_instancer import point_instances
from .adapters.shapes.points import POINT, point_sphere
from .lights.default_light import default_lights
from .lights.light_links import Links, find_links
from .lights.portals import note_unnamed_portals
from .materials.primvars_read import primvars_read
from .moving.foreseen import Foreseen
from .moving.levels import do_move
from .moving.pixels import pixels_of
from .moving.settle import Precision, settled
from .moving.stands import Stands
from .opening.file_names import file_names
from .opening.stage import usd_messages
from .opening.stage_metadata import meters_per_unit, up_axis
from .paths.lights import LightPath, moving_light, note_changing_size
from .paths.point_steps import PointSteps
from .paths.portals import with_moving_portals
from .querying.cameras import cameras_of
from .querying.messages import scene_errors, tf_message
from .querying.traversal import stands_in_world
from .resolving.color_spaces import rendering_space
from .resolving.context import Context
from .resolving.convert import square
from .resolving.notes import LightShapes
from .resolving.read import When, when_of
from .resolving.resolve import BlurScales, ResolvedPrim
from .resolving.stage_bounds import Bounds, NotBounded, stage_bounds
from .shapes.instance_primvars import without_unread
from .viewing.camera_path import camera_motion, nearest_to
from .viewing.diffusion import with_diffusion
from .viewing.drawn import Drawn, drawn
from .viewing.foreseen import as_seen, foreseen
from .viewing.framing import prototype_box, shape_bounds
from .viewing.rolling import exposed
from .viewing.shutter import shutter_of_vectors, timing_of
from .viewing.view import select_camera, view_through
from .walking.find_by_type import Found, find_by_type
from .walking.instances import Arrangement, Chain, Group, arrange, at_instant, count_of, merge_coincident
from .walking.skinning import are_drawn, posed
from .walking.walk import walk

ShapeAdapter = Callable[[ResolvedPrim, Context], Shape | None]
LightAdapter = Callable[[ResolvedPrim, Doubles, Context], Light | None]

# The adapter table: prim type -> what turns it into description objects. Point instancers are expanded by the walk
# (adapters.point_instancer); cameras and render settings are not found by place, but chosen (view.py).
SHAPES: dict[str, ShapeAdapter] = {
    "Mesh": mesh,
    "Sphere": sphere,
    "Cube": tessellated,
    "Cone": tessellated,
    "Cylinder": tessellated,
    "Cylinder_1": tessellated,
    "Capsule": tessellated,
    "Capsule_1": tessellated,
    "Plane": tessellated,
}
SHAPES |= DRAW_MODES  # in place of prims of any type
SHAPES[POINT] = point_sphere
LIGHTS: dict[str, LightAdapter] = dict.fromkeys(
    ("DistantLight", "SphereLight", "DiskLight", "RectLight", "CylinderLight", "DomeLight", "DomeLight_1"), light
)

# Each takes 55 microseconds here and 1 kB, before the core has its row; the core chooses among so many as fast as among 20.
MAX_LIGHT_INSTANCES = 1 << 18
MAX_BOUNDED_INSTANCES = 1_000_000
_PROTOTYPE = re.compile(r"/__Prototype_\d+")


@dataclass
class _Scene:
    """What has been translated so far."""

    links: Links | None  # whom lights reach; None: everything
    shapes: list[Shape] = field(default_factory=list)
    static: list[Placed] = field(default_factory=list)
    prototypes: list[Prototype] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    has_lights: bool = False  # also if none of them emits anything
    number: dict[int, int] = field(default_factory=dict)  # of the prototype that a group's shapes have become
    blur_scales: dict[int, float] = field(default_factory=dict)  # by prototype
    moving_lights: list[tuple[int, LightPath]] = field(default_factory=list)  # by number, where they stand over time


def translate(stage: Usd.Stage, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
    """What `settings` asks to render of the stage, and everything that the picture will not show as authored."""
    diagnostics = Diagnostics(file_names(stage).in_text)
    names: dict[str, str] = {}
    with usd_messages(diagnostics), _without_collection():
        description = _translate(stage, settings, diagnostics, names)
    return description, _with_names(diagnostics, names)


@contextmanager
def _without_collection() -> Iterator[None]:
    """Without Python's search for cyclic garbage, which goes over all that was made again and again: a tenth of the time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _with_names(diagnostics: Diagnostics, names: dict[str, str]) -> Diagnostics:
    """The same, with paths into prototypes replaced by those of their first instances."""
    shown = Diagnostics(diagnostics.shown)
    for d in diagnostics:
        path, message = (_PROTOTYPE.sub(lambda m: names.get(m[0], m[0]), text) for text in (d.prim_path, d.message))
        shown.add(d.code, path, message, d.attribute)
    return shown


def _translate(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics, names: dict[str, str]) -> SceneDescription:
    found, when = find_by_type(stage, diagnostics), when_of(stage, settings.time_code)
    if are_drawn(stage, found.skeletons):
        stage = posed(stage, when, _foreseen(stage, settings, found, when), diagnostics)
        found = find_by_type(stage, Diagnostics())
    cameras, settings_prims, shaders = found.cameras, found.settings, found.shaders
    product = product_settings(stage, settings, settings_prims, when, diagnostics)
    ctx = _context(stage, settings, when, product, diagnostics, names)
    space = rendering_space(product.settings_path, product.rendering_color_space, ctx)
    aovs = requests_of(settings.aovs) if settings.aovs is not None else aovs_of_variables(product.variables, diagnostics)
    names_instances = any(request.source == "instance" for request in aovs)
    ctx = replace(ctx, rendering_space=space, aov_primvars=primvars_of(aovs), names_instances=names_instances)
    read, of_colors = primvars_read(shaders, ctx)
    of_aovs = {f"primvars:{name}" for name in ctx.aov_primvars}
    ctx = replace(ctx, primvars_read=read | of_aovs, color_primvars=of_colors)
    camera_prim = select_camera(stage, ctx, product, cameras)
    shutter, rolling = exposed(camera_prim, ctx, product)
    is_vectored = any(request.source in VECTORS for request in aovs)
    vectors = shutter_of_vectors(camera_prim, shutter, ctx) if is_vectored else None
    ctx = replace(ctx, timing=timing_of(shutter, bool(aovs), ctx, vectors, rolling))
    if ctx.timing.is_open:
        ctx = replace(ctx, foreseen=as_seen(camera_prim, shutter, ctx, product))
    groups, links, ctx = _walked(ctx)
    for g, count in merge_coincident(groups, lambda leaf: leaf.type_name in LIGHTS).items():
        ctx.warn("instances-coincident", groups[g].path, f"{count:,} instances stand exactly where another does: left out.")
    where = arrange(groups, settings.max_memory_bytes or _physical_memory() // 2)
    if not ctx.timing.is_open and not ctx.timing.is_frame:
        where = at_instant(where, groups, ctx.timing.opens)
    for parent, child in where.cyclic:
        diagnostics.add(
            "invalid-instancer", groups[child].path, f"A prototype that contains itself, through {groups[parent].path}."
        )
    ctx = replace(ctx, shares=_shared_paths(groups))
    scene = _Scene(links)
    for g, group in enumerate(groups):
        _add_group(scene, group, where, g, ctx)
    _add_grouped(scene, groups, where)

    def bounds() -> Bounds:
        is_asked = not (where.cyclic or _is_crowded(groups) or _is_elsewhere(stage, groups) or ctx.kept.of(NotBounded))
        whole = stage_bounds(stage, ctx.when, ctx.purposes) if is_asked else None
        return whole or shape_bounds(scene.shapes, scene.static, scene.prototypes, scene.placements)

    note_unnamed_portals(ctx)
    camera, frame = view_through(camera_prim, ctx, product, shutter, bounds, lambda: _drawn(scene))
    camera = with_diffusion(camera, settings)
    _add_default_light(scene, camera, ctx)
    _note_missing_primvars(scene, ctx)
    motion, steps = None, list[MotionSteps]()
    if ctx.timing.is_open:
        nearest = nearest_to(camera, _drawn(scene))
        moving = camera_motion(camera_prim, camera, ctx, product, frame.resolution, nearest, settings.motion_error)
        if moving is not None:
            motion = moving[0]
            steps.append(moving[1].of(camera.path, "camera"))
        steps += [*_settle(scene, ctx, camera, motion, frame.resolution), *ctx.kept.of(PointSteps)]
        _note_errors(steps, ctx)
    return replace(_describe(scene, ctx, camera, motion, frame, aovs), motion_steps=tuple(steps))


def _foreseen(stage: Usd.Stage, settings: RenderSettings, found: Found, when: When) -> Foreseen:
    """What is wrong with camera and settings is told later, of the posed stage."""
    unheard = Diagnostics()
    product = product_settings(stage, settings, found.settings, when, unheard)
    return foreseen(_context(stage, settings, when, product, unheard, {}), product, found.cameras)


def _walked(ctx: Context) -> tuple[list[Group[ResolvedPrim]], Links | None, Context]:
    """All groups, and whom lights reach. The walk begins anew where it finds out what it should have known before."""
    kinds = dict.fromkeys(SHAPES, "shape") | dict.fromkeys(LIGHTS, "light")
    groups = walk(ctx, kinds, point_instances)
    widest = max(ctx.kept.of(BlurScales), default=1.0)
    if widest > ctx.timing.blur_scale:
        ctx = replace(ctx, timing=replace(ctx.timing, blur_scale=widest))
        groups = walk(ctx, kinds, point_instances)
    links = find_links((leaf for group in groups for leaf in group.leaves), ctx)
    if links is not None:  # instances that lights tell apart become groups of their own
        groups = walk(ctx, kinds, point_instances, links)
    return groups, links, ctx


def _note_errors(steps: list[MotionSteps], ctx: Context) -> None:
    """Where more times than there may be would have been needed."""
    for found in steps:
        if found.error > ctx.settings.motion_error:
            pixels = f"{found.error:.2g}" if math.isfinite(found.error) else "any number of"
            left = f"its path is given in {found.segments} steps, which leaves it up to {pixels} pixels off."
            ctx.warn("motion", ctx.shown(found.path), f"It moves fast: {left}")


def _settle(
    scene: _Scene, ctx: Context, camera: Camera, motion: CameraMotion | None, resolution: tuple[int, int]
) -> list[MotionSteps]:
    """What moves gets its times, now that it is known how large it is seen."""
    cameras = (camera, *(motion.cameras if motion else ()))
    precision = Precision(ctx.timing, pixels_of(cameras, resolution), ctx.settings.motion_error)

    def at_seam(placement: Placement) -> Placement:
        number = placement.prototype
        box = prototype_box(scene.shapes, scene.prototypes, number) if do_move(placement.levels) else (np.zeros(3), np.zeros(3))
        return settled(placement, scene.blur_scales[number], box, scene.prototypes[number].path, precision)

    scene.placements = [at_seam(placement) for placement in scene.placements]
    for number, path in scene.moving_lights:
        scene.lights[number] = moving_light(scene.lights[number], path, precision, ctx)
    for k, prototype in enumerate(scene.prototypes):
        if prototype.placements:
            scene.prototypes[k] = replace(prototype, placements=tuple(map(at_seam, prototype.placements)))
    if motion is not None or _do_any_move(scene):  # of portals alone no picture shows whether they do
        paths = dict(scene.moving_lights)
        for number, made in enumerate(scene.lights):
            if made.portals:
                scene.lights[number] = with_moving_portals(made, paths.get(number), precision, ctx)
    return precision.steps


def _drawn(scene: _Scene) -> Drawn:
    return drawn(scene.shapes, scene.static, scene.prototypes, scene.placements)


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


def _note_missing_primvars(scene: _Scene, ctx: Context) -> None:
    there = {p.name.removeprefix(WIDE) for owner in (*scene.shapes, *scene.placements) for p in owner.primvars}
    for name in ctx.aov_primvars:
        if name not in there:
            ctx.warn("aov-empty", "", f"Nothing in the picture has primvars:{name}: its AOV is 0 everywhere.")


@scene_errors()
def camera_paths(stage: Usd.Stage) -> list[str]:
    """The cameras that could be asked for."""
    return [str(prim.GetPath()) for prim in cameras_of(stage)]


def _shared_paths(groups: list[Group[ResolvedPrim]]) -> frozenset[str]:
    """Prims that several groups hold, because different things are handed down to their instances."""
    seen: set[str] = set()
    shared: set[str] = set()
    for group in groups:
        paths = {leaf.path for leaf in group.leaves}
        shared |= seen & paths
        seen |= paths
    return frozenset(shared)


def _is_elsewhere(stage: Usd.Stage, groups: list[Group[ResolvedPrim]]) -> bool:
    """Whether USD's bounds would leave out what stands in no world: prototypes of point instancers below `class` or `over`."""
    roots = (stage.GetPrimAtPath(group.path) for group in groups[1:] if group.path)
    return any(root and not stands_in_world(root) for root in roots)


def _is_crowded(groups: list[Group[ResolvedPrim]]) -> bool:
    """Whether USD's bounds would make more matrices at once than is good (it does for instancers without an extent)."""
    return sum(len(some) for group in groups for _, some in group.instances) > MAX_BOUNDED_INSTANCES


def _add_group(scene: _Scene, group: Group[ResolvedPrim], where: Arrangement, g: int, ctx: Context) -> None:
    """A group that stands once becomes static shapes, one that stands more often a prototype."""
    chains = where.world.get(g, [])
    count = sum(map(count_of, chains))
    if count == 0:
        return
    is_once = count == 1 and not rows_of_levels(chains[0]) and not do_move(chains[0])
    once = square(next(chunks(chains[0]))[0]) if is_once else None
    alone = "" if once is None or not ctx.names_instances else name_of(named_levels(chains[0]), 0)
    members: list[Placed] = []
    leaves, group.leaves = group.leaves[::-1], []
    matrices = _matrices(leaves)
    finite: list[bool] = np.asarray(np.isfinite(matrices).all(axis=(1, 2))).tolist()
    placed = matrices if once is None or np.array_equal(once, np.eye(4)) else once @ matrices
    while leaves:  # what has been translated is let go
        leaf = leaves.pop()
        scene.has_lights |= leaf.type_name in LIGHTS or leaf.path in ctx.kept.of(LightShapes)
        if not finite.pop():
            ctx.warn("invalid-transform", leaf.path, "Its transform is not finite.")
        elif leaf.type_name in LIGHTS:
            _add_lights(scene, leaf, matrices[len(leaves)], chains, count, group.blur_scale, ctx)
        elif (shape := _shape(leaf, _standing(leaf, chains, matrices[len(leaves)], ctx), scene.links)) is not None:
            if scene.links is not None:
                shape = replace(shape, link_row=scene.links.row_of(leaf))
            members.append(Placed(len(scene.shapes), placed[len(leaves)], alone))
            scene.shapes.append(shape)
    if once is not None:
        scene.static += members
    elif members:
        scene.number[g] = len(scene.prototypes)
        scene.blur_scales[scene.number[g]] = group.blur_scale
        if g not in where.inside:
            scene.placements += _placements(scene, g, where.top.get(g, []))
        scene.prototypes.append(Prototype(group.path, tuple(members)))


def _add_grouped(scene: _Scene, groups: list[Group[ResolvedPrim]], where: Arrangement) -> None:
    """Groups that keep their instances together, as prototypes of placements; their own shapes are one of these."""
    for kept, inside in where.inside.items():
        placements = tuple(p for g, chains in inside.items() if g in scene.number for p in _placements(scene, g, chains))
        if placements:
            top = len(scene.prototypes)
            scene.blur_scales[top] = groups[kept].blur_scale
            scene.prototypes.append(Prototype(groups[kept].path, (), placements))
            scene.placements += [_placement(top, chain) for chain in where.top[kept]]


def _placements(scene: _Scene, g: int, chains: list[Chain]) -> list[Placement]:
    return [_placement(scene.number[g], chain) for chain in chains]


def _placement(prototype: int, chain: Chain) -> Placement:
    return Placement(prototype, chain or (MatrixInstances(IDENTITY[None]),), rows_of_levels(chain))


def _standing(leaf: ResolvedPrim, chains: list[Chain], group_from_prim: Doubles, ctx: Context) -> Context:
    """What moves by itself is given at times that depend on how large it is seen."""
    if not ctx.timing.is_open:
        return ctx
    return replace(ctx, stands=Stands(chains, group_from_prim, leaf.inherited.blur_scale, leaf.path not in ctx.shares))


def _shape(leaf: ResolvedPrim, ctx: Context, links: Links | None) -> Shape | None:
    try:
        if leaf.path not in ctx.kept.of(LightShapes):
            return SHAPES[leaf.type_name](leaf, ctx)
        shape = SHAPES[leaf.type_name](without_material(leaf, ctx), ctx)
        return None if shape is None else as_light(shape, leaf, ctx, links)
    except Tf.ErrorException as error:
        ctx.warn("unsupported-prim", leaf.path, f"USD failed to read it: {tf_message(error)}")
        return None


def _matrices(leaves: list[ResolvedPrim]) -> Doubles:
    """(N, 4, 4) group_from_prim of the leaves of a group."""
    return leaves[0].poses.taken([leaf.pose for leaf in leaves]) if leaves else np.zeros((0, 4, 4))


def _add_lights(
    scene: _Scene,
    leaf: ResolvedPrim,
    group_from_prim: Doubles,
    chains: list[Chain],
    count: int,
    blur_scale: float,
    ctx: Context,
) -> None:
    """One light for each place; a light's emission depends on its own size in the world."""
    if count > MAX_LIGHT_INSTANCES:
        ctx.warn("instanced-lights", leaf.path, f"Only the first {MAX_LIGHT_INSTANCES} of its {count} instances are lit.")
    note_changing_size(leaf, ctx)
    rules = rules_of(leaf, ctx, scene.links)
    if count > 1:
        ctx = replace(ctx, when=replace(ctx.when, remembered={}))
    matrices = ((chain, k, row) for chain in chains for k, row in enumerate(row for rows in chunks(chain) for row in rows))
    for chain, k, row in islice(matrices, MAX_LIGHT_INSTANCES):
        made = LIGHTS[leaf.type_name](leaf, square(row) @ group_from_prim, ctx)
        if made is None:
            continue
        if do_move(chain):
            scene.moving_lights.append((len(scene.lights), LightPath(chain, k, group_from_prim, blur_scale)))
        scene.lights.append(rules.applied(made))


def _add_default_light(scene: _Scene, camera: Camera, ctx: Context) -> None:
    """Where nobody meant to give light: lights that emit nothing are meant."""
    if scene.has_lights or not ctx.settings.default_light or any(_emits(s) for s in ctx.surfaces):
        return
    scene.lights += default_lights(camera, up_axis(ctx.stage) == "Z")
    ctx.warn(
        "default-light", "", "There is no light and nothing that emits: a studio light is added, which the camera does not see."
    )


def _emits(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)


def _describe(
    scene: _Scene,
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
        ctx.timing.exposure if ctx.timing.is_open and (motion is not None or _do_any_move(scene)) else None,
        motion,
    )


def _do_any_move(scene: _Scene) -> bool:
    placements = [*scene.placements, *(inner for prototype in scene.prototypes for inner in prototype.placements)]
    return (
        any(isinstance(level, MovingInstances) for placement in placements for level in placement.levels)
        or any(not isinstance(shape, Sphere) and shape.motion is not None for shape in scene.shapes)
        or any(light.motion is not None for light in scene.lights)
    )


def _physical_memory() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
