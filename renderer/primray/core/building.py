"""From a description to a scene in the core: cages diced, everything uploaded and accelerated."""

from __future__ import annotations

from typing import Any

from ..description import SceneDescription, Shape
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
    """The description with triangles for subdivision cages, and what is coarser or sharper than the stage says; `textures`, of
    which those that displace cages are read: every TextureFile that could be."""
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
    """The core's scene, accelerated; `textures`: the images of every TextureFile that could be read, taken out of it.

    `shapes`, where given, are used in place of the description's and let go on the way: the list is empty afterwards.
    """
    width = settings.filter_width if settings.filter_width is not None else DEFAULT_FILTER_WIDTH[settings.pixel_filter]
    record = SceneRecord() if description.aovs else None
    try:
        scene, uploaded = hand_over(
            module(), description, textures, width, inverse_cdf(settings.pixel_filter, width), shapes, record
        )
    except module().CoreError as error:
        raise_as_ours(error)
    return core_scene(scene, uploaded, description, record)


def core_scene(scene: Any, uploaded: Uploaded, d: SceneDescription, record: SceneRecord | None) -> CoreScene:
    warnings = [*uploaded.warnings, *noted_emitters(scene)]
    made = CoreScene(scene, d.camera.exposure_scale, warnings, d.frame.size, record, d.rendering_space, uploaded.bounds)
    made.uploaded = uploaded
    made.routes = routes_of(d.aovs, uploaded.light_groups)
    if made.routes is not None:
        made.warnings += missing_groups(made.routes, uploaded.light_groups)
    return made
