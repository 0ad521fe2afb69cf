"""A description to a scene in the core: cages are diced, everything is uploaded and accelerated."""

from __future__ import annotations

from typing import Any

from .. import process_memory
from ..description import SceneDescription, Shape
from ..errors import LimitError
from ..refine import dice as dicing
from ..refine.nurbs.description import with_patches_diced
from ..refine.ribbons import dice_ribbons
from ..settings import DEFAULT_FILTER_WIDTH, RenderSettings
from .core_errors import raise_as_ours
from .dicing.displacement import displacements
from .isa_class import module
from .light_paths.routes import missing_groups, routes_of
from .limits import threads
from .pixel_filter import inverse_cdf
from .scene import CoreScene
from .scene_record import SceneRecord
from .scene_upload import Uploaded, hand_over, noted_emitters
from .surface_upload import MutableTextures, Textures


def dice(
    description: SceneDescription, settings: RenderSettings, textures: Textures | None = None
) -> tuple[SceneDescription, dicing.Warnings]:
    """Return the description with subdivision cages diced to triangles, and warnings where they are coarser or sharper.

    `textures`: every TextureFile that could be read; those that displace cages are used.
    """
    try:
        displaced = displacements(module(), description, textures or {})
        chosen = dicing.dicing_of(settings)
        made, warnings = dicing.dice(module(), description, chosen, threads(settings), displaced)
        made, notes = with_patches_diced(dice_ribbons(made, chosen.pixels), chosen)
        return made, [*warnings, *notes]
    except module().CoreError as error:
        raise_as_ours(error)


def build(
    description: SceneDescription, textures: MutableTextures, settings: RenderSettings, shapes: list[Shape] | None = None
) -> CoreScene:
    """Return the core's scene with acceleration structures; `textures`: all images that could be read, emptied on the way.

    `shapes`, if given, replaces the description's shapes; it is emptied to save memory.
    """
    width = settings.filter_width if settings.filter_width is not None else DEFAULT_FILTER_WIDTH[settings.pixel_filter]
    record = SceneRecord() if description.aovs else None
    try:
        limit_hierarchies(settings)
        scene, uploaded = hand_over(
            module(), description, textures, width, inverse_cdf(settings.pixel_filter, width), shapes, record
        )
    except module().CoreError as error:
        if error.args[0] == "out-of-memory" and settings.max_memory_bytes is not None:
            held = int(module().embree_memory()[1]) / process_memory.MIB
            allowed = settings.max_memory_bytes / process_memory.MIB
            sentence = f"acceleration structures need more than {held:.0f} MiB, which exceeds the limit of {allowed:.0f} MiB"
            raise LimitError(sentence, code=process_memory.CODE) from error
        raise_as_ours(error)
    finally:
        module().limit_embree_memory(2**62)
    return core_scene(scene, uploaded, description, record)


def limit_hierarchies(settings: RenderSettings) -> None:
    """Make Embree's builds fail rather than exceed what is left of the memory limit."""
    limit = settings.max_memory_bytes
    if limit is None:
        return
    left = limit if process_memory.held is None else limit - process_memory.MARGIN - process_memory.resident_bytes()
    module().limit_embree_memory(int(max(left, 0)) + int(module().embree_memory()[0]))


def core_scene(scene: Any, uploaded: Uploaded, d: SceneDescription, record: SceneRecord | None) -> CoreScene:
    warnings = [*uploaded.warnings, *noted_emitters(scene)]
    made = CoreScene(scene, d.camera.exposure_scale, warnings, d.frame.size, record, d.rendering_space, uploaded.bounds)
    made.uploaded = uploaded
    made.light_groups = uploaded.light_groups
    made.routes = routes_of(d.aovs, uploaded.light_groups)
    if made.routes is not None:
        made.warnings += missing_groups(made.routes, uploaded.light_groups)
    return made
