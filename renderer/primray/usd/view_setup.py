"""The second pass of a translation, the view: what the render settings and the user ask for, the camera, and when it exposes.

Everything is known here that decides at what times, in what colour space and for which purposes values are read. Before it, one
search of the stage and its native prototypes finds the prims that are needed by type, wherever they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pxr import Usd

from ..aovs import DEEP, VECTORS, AovRequest, has_deep, names_instances, primvars_of, with_distances
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..settings import RenderSettings
from .camera.shutter import Shutter, motion_vector_shutter, render_timing, report_closed_shutter
from .camera.view import cameras_in_instances, estimate_view_through, exposure_times, select_camera
from .lights.light_groups import light_groups
from .materials.material_primvars import primvars_read
from .mesh.triangulate import Triangulator, triangulated
from .render_settings.outputs import outputs_of
from .render_settings.render_pass import report_ignored_render_pass
from .render_settings.render_product import ProductSettings
from .render_settings.render_settings import product_settings
from .scene.color_spaces import rendering_space
from .scene.context import Context
from .scene.level_of_detail import LOD_ROOT
from .stage.metadata import meters_per_unit
from .stage.reads import has_schema, type_name
from .stage.traversal import exists, is_in_world, populated, prims_in_instances
from .stage.values import When

# Types below which nothing is drawn: none of them is asked for levels of detail.
_NEVER_DRAWN = frozenset({"Shader", "NodeGraph", "Material", "GeomSubset"})
_TYPES = frozenset({"Camera", "RenderSettings", "RenderPass", "Shader", "SkelRoot", "GeometryLight"})


@dataclass
class Found:
    """Prims of some types; cameras and settings are those in the world."""

    cameras: list[Usd.Prim] = field(default_factory=list)  # in the order of cameras_of
    in_prototypes: bool = False  # some cameras are in native prototypes
    lights_in_prototypes: bool = False  # some geometry lights are
    has_levels: bool = False  # there are roots of levels of detail
    settings: list[Usd.Prim] = field(default_factory=list)
    geometry_lights: list[Usd.Prim] = field(default_factory=list)  # in the world
    shaders: list[Usd.Prim] = field(default_factory=list)  # including those in native prototypes
    skeletons: list[Usd.Prim] = field(default_factory=list)  # SkelRoots, including those in native prototypes


@dataclass(frozen=True)
class SearchedStage:
    """A stage, the prims found on it, and the time to read it at."""

    stage: Usd.Stage
    found: Found
    when: When


def find_by_type(stage: Usd.Stage, diagnostics: Diagnostics, render_pass: str | None = None) -> Found:
    """Return the prims of these types. `render_pass` is the pass that is rendered; others are reported."""
    found = Found()
    for prim in populated(stage):
        name = type_name(prim)
        if name in _TYPES and exists(prim):
            _add(found, prim, str(name), diagnostics, render_pass)
        if not found.has_levels and name not in _NEVER_DRAWN and has_schema(prim, LOD_ROOT):
            found.has_levels = True
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


@dataclass(frozen=True)
class ViewSetup:
    """The context that the traversal is given, and the camera, whose shutter decides at what times values are read."""

    ctx: Context
    product: ProductSettings
    camera: Usd.Prim | None
    shutter: Shutter
    aovs: tuple[AovRequest, ...]


def set_up_view(
    searched: SearchedStage,
    settings: RenderSettings,
    diagnostics: Diagnostics,
    names: dict[str, str],
    triangulator: Triangulator = triangulated,
) -> ViewSetup:
    """Return the view of a stage; `names` will hold the first instances of native prototypes."""
    stage, found, when = searched.stage, searched.found, searched.when
    product = product_settings(stage, settings, found.settings, when, diagnostics)
    error = settings.motion_error if settings.motion_error is not None else product.asked.of("motion_error")
    settings = settings if error is settings.motion_error else replace(settings, motion_error=error)
    purposes = settings.purposes if settings.purposes is not None else product.purposes
    ctx = Context(
        stage=stage,
        settings=settings,
        when=when,
        purposes=purposes,
        material_purposes=product.material_purposes,
        diagnostics=diagnostics,
        prototype_names=names,
        triangulate=triangulator,
    )
    space = rendering_space(product.settings_path, product.rendering_color_space, ctx)
    aovs, file = outputs_of(product, settings, diagnostics)
    if has_deep(aovs) and settings.eye is not None:
        raise SettingsError(
            "a stereo pair has no deep pictures: render each eye by --camera, or leave out --aov deep and deepRaster products",
            where="aovs",
            code="deep-setting",
        )
    aovs = with_distances(aovs, meters_per_unit(stage))
    product = replace(product, file=file)
    has_names = any(names_instances(request.source) for request in aovs)
    ctx = replace(ctx, rendering_space=space, aov_primvars=primvars_of(aovs), names_instances=has_names)
    ctx = replace(ctx, light_groups=light_groups(stage, product.settings_path))
    read, of_colors = primvars_read(found.shaders, ctx)
    of_aovs = {f"primvars:{name}" for name in ctx.aov_primvars}
    ctx = replace(ctx, primvars_read=read | of_aovs, color_primvars=of_colors)
    camera = select_camera(stage, ctx, product, found.cameras)
    shutter, rolling = exposure_times(camera, ctx, product)
    is_vectored = any(request.source in VECTORS for request in aovs)
    vectors = motion_vector_shutter(camera, shutter, ctx) if is_vectored else None
    if is_vectored:
        report_closed_shutter(shutter, vectors, ctx)
    ctx = replace(ctx, timing=render_timing(shutter, any(request.source != DEEP for request in aovs), ctx, vectors, rolling))
    if ctx.timing.is_open:
        ctx = replace(ctx, foreseen=estimate_view_through(camera, shutter, ctx, product))
    return ViewSetup(ctx=ctx, product=product, camera=camera, shutter=shutter, aovs=aovs)
