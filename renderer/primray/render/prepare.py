"""Preparation of a scene for sampling: stage opened, translated, textures loaded, scene built within the memory limit.

`Steps` has the steps as methods, so that subclasses can reuse results of earlier renders.

Expensive modules are imported when a render starts; importing this module is cheap.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from .. import process_memory
from ..aovs import LIGHTS, AovRequest, aov_bytes, light_paths_of, shows_things, taxonomy_of
from ..diagnostics import Diagnostics
from ..errors import SettingsError, UnsupportedError, did_you_mean
from ..process_memory import without_collection
from ..read_files import check_kept, is_watching
from ..report.prepared import Prepared
from ..settings import STAGING, DefaultWrap, Ground, Metric, RenderSettings, StopAt
from ..settings.stage_settings import StageSettings

if TYPE_CHECKING:
    from ..arrays import Doubles
    from ..color.color_space import ColorSpace
    from ..core import CoreScene
    from ..core.surface_upload import KeptImages
    from ..description import SceneDescription, Shape, TextureFile, Wrap
    from ..description.picture_file import PictureFile
    from ..diagnostics import Diagnostics
    from ..labels.table import LabelTable
    from ..report.report import Costs
    from ..report.summary import ImageSize
    from ..tessellation.dice import DicedBefore
    from ..textures.texture import Texture
    from ..textures.texture_set import LoadedFile
    from ..textures.tile_cache import TileCache
    from ..usd import LabelledPrims


DENOISING_PIXEL_BYTES = 1000  # Open Image Denoise and the two half pictures, rounded up from measurements
REMOVED_PIXEL_BYTES = 102  # exact sums, in both replicates, of the light removed by a clamp or as caustics
FILM_PIXEL_BYTES = 126  # as in the core, which is not loaded yet when memory is checked; a test compares them


@dataclass(frozen=True)
class OpenedStage:
    """A stage that has been composed, with its diagnostics."""

    stage: Any  # Usd.Stage
    composed_by: tuple[Any, ...]  # the settings that decide its composition
    diagnostics: Diagnostics
    seconds: float
    name: object = None  # what the user passed: its path, if that was given


def composing_settings(settings: RenderSettings) -> tuple[Any, ...]:
    return settings.variants, settings.load, settings.mask, settings.session_layer


def open_once(stage: str | os.PathLike[str] | Any, settings: RenderSettings) -> OpenedStage:
    """Open a stage as `settings` compose it, for `render_frames` and for inspection before rendering."""
    from ..report.report import Costs
    from ..time_spans import span

    with span("import USD"):
        from .. import usd

    costs, diagnostics = Costs(), Diagnostics()
    with costs.stage("open"):
        opened = usd.open_stage(stage, diagnostics, settings.composition)
    return OpenedStage(opened, composing_settings(settings), diagnostics, costs.stages_s["open"], stage)


def prepare(
    stage: Any,
    opening: Diagnostics,
    settings: RenderSettings,
    costs: Costs,
    diagnostics: Diagnostics,
    *,
    fingerprinted: bool = False,
    steps: Steps | None = None,
) -> Prepared:
    """Translate an opened stage, load its textures and build its scene; diagnostics are added to `diagnostics`.

    `steps`: pipeline with caches from earlier renders; None: everything is made here.
    """
    with without_collection():
        return _prepare(stage, opening, settings, costs, diagnostics, fingerprinted, Steps() if steps is None else steps)


def _prepare(
    stage: Any,
    opening: Diagnostics,
    settings: RenderSettings,
    costs: Costs,
    diagnostics: Diagnostics,
    fingerprinted: bool,
    steps: Steps,
) -> Prepared:
    from .. import usd
    from ..description import CameraVisibility
    from ..description.picture_file import PLAIN
    from ..description.scene import is_lit_behind, with_larger_pixels
    from ..report.report import resolve_settings
    from ..report.summary import texture_sizes

    if process_memory.held is not None:
        process_memory.held.read_stage()
    with costs.stage("translate"):
        description, translating = steps.translate(stage, settings)
        diagnostics.name_files(translating.shown)
        diagnostics.extend([*opening, *translating])
        settings, asked = with_stage_settings(settings, description.asked, diagnostics)
        file = _with_usable_views(description, diagnostics)
        description = with_additions(description, settings, diagnostics)
        if process_memory.held is not None:
            sizes = texture_sizes(description, usd.read_asset).values()
            check_memory(description, settings, [size for size in sizes if size], film_copies=int(fingerprinted))
        if not settings.surface_textures:
            if is_watching():
                from ..textures.texture_set import note_files

                note_files(description)
            description = steps.without_images(description)
        description, textures = steps.load_textures(description, diagnostics, settings)
        if settings.dome is not None:
            from ..staging import require_dome

            require_dome(description, settings, diagnostics)
        check_kept()
        diagnostics.raise_if_refused(settings.refusal)
    images = steps.image_sizes(textures)
    check_memory(description, settings, images, film_copies=int(fingerprinted))
    with costs.stage("build"):
        description = steps.add_missing_light(description, textures, settings, diagnostics)
    description, file = _with_lights_apart(description, file, diagnostics)
    mixes = _mix_weights(settings, description.aovs)
    digests = steps.fingerprint(description, textures) if fingerprinted else {}
    with costs.stage("dice"):
        looked_at = description
        if settings.dicing_camera is not None:
            looked_at = replace(description, camera=settings.dicing_camera, camera_motion=None)
        diced, limits = steps.dice(looked_at, textures, settings)
        description = replace(
            diced, camera=description.camera, camera_motion=description.camera_motion, anchor=settings.dicing_camera
        )
    for code, path, message in limits:
        diagnostics.add(code, path, message)

    if settings.metric is Metric.DISPLAY:
        _check_view(description, diagnostics, settings)
    given, settings = settings, resolve_settings(settings, description)
    counted, motion = steps.count(description, settings, images)
    if settings.pixel_size != 1:
        description = with_larger_pixels(description, settings.pixel_size)
    ground_shadow = None
    if settings.ground is Ground.SHADOW:
        from ..staging import GroundShadow

        ground_shadow = GroundShadow(description, dict(textures), given)
    shapes, description = list(description.shapes), replace(description, shapes=())
    with costs.stage("build"):
        scene = steps.build(description, textures, settings, shapes)
    for code, path, message in scene.warnings:
        diagnostics.add(code, path, message)
    diagnostics.raise_if_refused(settings.refusal)
    with steps.reading_stage():
        if scene.bounds is None:
            _require_something_to_render(diagnostics, settings)
        left_out = {} if scene.bounds is not None else usd.count_undrawn_shapes(stage, settings)
        if description.aovs and stage.GetPrototypes():  # all instances may have been turned into copies
            assert scene.record is not None
            record = scene.record
            shown = [*record.shape_paths, *(path for path, _ in record.media)]
            materials = [*record.surface_paths, *(material for _, material in record.media)]
            record.names = usd.names_in_instances(stage, shown, materials, description.instances)
        assets: dict[str, str] = {}
        if any(request.source == "crypto_asset" for request in description.aovs):
            assert scene.record is not None
            assets = usd.assets_of(stage, [*scene.record.shape_paths, *(path for path, _ in scene.record.media)])
        labelled = table = None
        if any(taxonomy_of(request.source) for request in description.aovs):
            labelled, table = _labelled_prims(stage, description.aovs, settings, diagnostics)
            diagnostics.raise_if_refused(settings.refusal)
        name = usd.stage_name(stage)
    camera, frame, lights = description.camera, description.frame, len(description.lights)
    prepared = Prepared(
        scene=scene,
        settings=settings,
        counts=counted,
        camera=camera,
        frame=frame,
        fingerprint=digests,
        aovs=description.aovs,
        lights=lights,
        motion=motion,
        left_out=left_out,
    )
    prepared = replace(prepared, asked=asked, mixes=mixes)
    if file != PLAIN or is_lit_behind(description):
        prepared = replace(prepared, file=replace(file, lit_behind=is_lit_behind(description)))
    hidden = (
        scene.bounds is not None
        and bool(description.surfaces)
        and all(surface.camera is CameraVisibility.HIDDEN for surface in description.surfaces)
        and not (description.media or description.volume_emissions)  # the camera sees all Volumes
    )
    rolls = description.exposure is not None and any(description.exposure.rolling)
    prepared = replace(prepared, ground_shadow=ground_shadow, rolls=rolls)
    return replace(prepared, assets=assets, labelled=labelled, label_table=table, stage=name, hidden_from_camera=hidden)


def _labelled_prims(
    stage: Any, requests: Sequence[AovRequest], settings: RenderSettings, diagnostics: Diagnostics
) -> tuple[LabelledPrims, LabelTable]:
    """Return the labelled prims of a stage, and the ids of their classes; report taxonomies that nothing bears."""
    from .. import usd
    from ..labels.table import class_ids

    labelled = usd.LabelledPrims(stage, settings.time_code)
    known = labelled.taxonomies()
    wanted = dict.fromkeys(taxonomy for request in requests if (taxonomy := taxonomy_of(request.source)) is not None)
    for taxonomy in wanted:
        if taxonomy not in known:
            hint = did_you_mean(taxonomy, known)
            others = f"labels are in {', '.join(known)}" if known else "nothing on the stage has labels"
            message = f"No prim has labels in the taxonomy {taxonomy}: {hint or others}."
            diagnostics.add("label-taxonomy", "", message)
    things = {str(taxonomy_of(r.source)): known.get(str(taxonomy_of(r.source)), ()) for r in requests if shows_things(r.source)}
    return labelled, class_ids(settings, things, diagnostics)


def _with_lights_apart(
    description: SceneDescription, file: PictureFile, diagnostics: Diagnostics
) -> tuple[SceneDescription, PictureFile]:
    """Return the description with an output for each light, and the product's file with their parts, if that is asked for."""
    if all(request.source != LIGHTS for request in description.aovs):
        return description, file
    from ..light_mix.parts import with_lights_apart, with_parts

    before = {request.name: request for request in description.aovs}
    asked = {name for name, request in before.items() if request.source == LIGHTS}
    description = with_lights_apart(description, diagnostics)
    made = [request.name for request in description.aovs if request != before.get(request.name)]
    return description, with_parts(file, asked, made)


def _mix_weights(settings: RenderSettings, requests: Sequence[AovRequest]) -> Doubles | None:
    if settings.stop_at is not StopAt.MIX:
        return None
    from ..sampling.mix_weights import mix_weights

    return mix_weights(settings, requests, light_paths_of(requests))


def _require_something_to_render(diagnostics: Diagnostics, settings: RenderSettings) -> None:
    """Raise UnsupportedError if nothing is drawn because references are missing, instead of rendering an empty picture."""
    missing = [d for d in diagnostics if d.code == "composition-error" and not settings.refusal.allows(d.code)]
    if missing:
        message = f"there is no geometry to draw, and the stage has missing references: {missing[0].message}"
        raise UnsupportedError(message, where=missing[0].prim_path, code="nothing-to-render")


def with_stage_settings(
    settings: RenderSettings, asked: StageSettings, diagnostics: Diagnostics
) -> tuple[RenderSettings, StageSettings]:
    """Return the settings with the stage's settings where they are open, and which of those were applied.

    Settings that this machine cannot follow are reported and ignored.
    """
    if asked.of("denoise") and settings.denoise is None:
        from ..denoising.denoiser import has_denoiser

        if not has_denoiser():
            one = next(one for one in asked.asked if one.name == "denoise")
            message = (
                f"{one.attribute}: no denoiser is installed (pip install primray[denoise]), so the picture is not denoised."
            )
            diagnostics.add("render-settings-input", one.prim, message, one.attribute)
            asked = asked.without("denoise")
    settings, taken = asked.applied_to(settings)
    for one in taken:
        if one.meaning:
            diagnostics.add("foreign-settings", one.prim, f"{one.attribute} is read as {one.meaning}.", one.attribute)
    return settings, StageSettings(taken)


def with_usable_view(file: PictureFile, space: ColorSpace, path: str, diagnostics: Diagnostics) -> PictureFile:
    """Return a product's file settings, without a view that the OpenColorIO configuration does not have."""
    asked = file.view
    if asked.is_default:
        return file
    from ..images.exposure import View

    try:
        View(asked.view, asked.display, asked.look, space).check()
    except SettingsError as error:
        message = f"The view for its pictures cannot be made, and the default is used: {error.message}."
        diagnostics.add("render-settings-input", path, message, "primray:view")
        return replace(file, view=replace(asked, view=None, display=None, look=None))
    return file


def _with_usable_views(description: SceneDescription, diagnostics: Diagnostics) -> PictureFile:
    file, space = description.file, description.rendering_space
    products = tuple((path, with_usable_view(own, space, path, diagnostics)) for path, own in file.products)
    return replace(with_usable_view(file, space, "", Diagnostics() if products else diagnostics), products=products)


def with_additions(description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics) -> SceneDescription:
    """Return the description with additions to the stage (lights, ground, background); the same object if there are none."""
    if all(getattr(settings, name) == value for name, value in STAGING.items()):
        return description
    from ..images.background import background_of
    from ..staging import with_requested_additions

    background_of(settings.background)  # raises before anything is sampled
    return with_requested_additions(description, settings, diagnostics)


def _check_view(description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings) -> None:
    """Raise SettingsError, before sampling, if the error is measured on a display whose view cannot be made."""
    from ..sampling.error import DisplayView

    view = DisplayView(space=description.rendering_space)
    view.check()
    if settings.rendering_color_space is None and (assumed := view.assumed()) is not None:
        if settings.strict and not settings.refusal.allows("view-space-assumed"):
            raise SettingsError(f"--strict: {assumed}", where="rendering_color_space", code="view-space-assumed")
        diagnostics.add("view-space-assumed", "", assumed)


def check_memory(
    description: SceneDescription, settings: RenderSettings, images: list[ImageSize], film_copies: int = 0
) -> None:
    """Raise LimitError, before building, if the scene is estimated to need more memory than is allowed.

    `film_copies`: 1 if a checkpoint is written or read, which holds a copy of the film.
    """
    limit_bytes = settings.max_memory_bytes
    if limit_bytes is None:
        return
    from ..report.summary import summary

    width, height = description.frame.size
    removals = (settings.clamp_indirect is not None) + (not settings.caustics)
    of_pixel = {
        "checkpoint": film_copies * FILM_PIXEL_BYTES,
        "AOVs": aov_bytes(_with_lights_apart(description, description.file, Diagnostics())[0].aovs),
        "denoising": settings.denoises * DENOISING_PIXEL_BYTES,
        "removed light": removals * REMOVED_PIXEL_BYTES,
    }
    parts = dict(summary(description, settings.dicing_rate, images).memory_parts)
    parts |= {name: size * width * height for name, size in of_pixel.items()}
    if settings.texture_memory_bytes is not None:
        largest = max((4 * image.width * image.height * image.channels for image in images), default=0)
        most = settings.texture_memory_bytes + 3 * largest  # one as floats, and its levels
        parts["textures"] = min(parts.get("textures", 0), most)
    if process_memory.held is not None:
        from ..report.summary import PROCESS_BYTES, VIEW_BYTES

        of_process = PROCESS_BYTES + max(VIEW_BYTES - sum(parts.values()), 0)
        parts["the process without a scene"] = of_process + process_memory.MARGIN
        process_memory.held.expect(parts)
    if sum(parts.values()) > limit_bytes:
        raise process_memory.too_little(limit_bytes, parts)


Textures = dict["TextureFile", "list[tuple[int, Texture]]"]


def _unheard(step: str, done: int, of: int) -> None:
    pass


class Steps:
    """The steps in their order, without caching.

    `on_progress` is called with a step's name, how many of its parts are done, and how many there are (0: not known); what it
    raises ends the preparation.
    """

    on_progress: Callable[[str, int, int], None] = staticmethod(_unheard)
    has_record = False  # whether what rays hit can be named although no AOV is requested
    diced_before: DicedBefore | None = None  # what was diced before; None: nothing stays
    kept_images: KeptImages | None = None  # those of an earlier scene in the core, for the next one that is built

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from .. import usd
        from ..core import compiled

        return usd.translate(stage, settings, compiled.triangulate)

    def reading_stage(self) -> AbstractContextManager[object]:
        """Return a block in which nobody else edits the stage."""
        return nullcontext()

    def without_images(self, description: SceneDescription) -> SceneDescription:
        """Return the description with surfaces that read no image files."""
        from ..description.shading import without_images

        return replace(description, surfaces=tuple(map(without_images, description.surfaces)))

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        from .. import usd
        from ..textures.tile_cache import tile_cache

        return load_textures(description, diagnostics, usd.read_asset, settings.default_wrap, tile_cache(settings))

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        """Return the sizes of the images just loaded."""
        return image_sizes(textures)

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        from ..checkpoints.fingerprint import fingerprint

        return fingerprint(description, textures)

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, list[tuple[str, str, str]]]:
        """Return the diced description, and code, path and message of approximations."""
        from .. import core

        return core.dice(description, settings, textures, self.diced_before, partial(self.on_progress, "dice"))

    def count(
        self, description: SceneDescription, settings: RenderSettings, images: list[ImageSize]
    ) -> tuple[dict[str, int], dict[str, Any] | None]:
        """Return the report's counts of scene contents, and its facts about motion."""
        from ..report.summary import counts, motion_facts, summary

        return counts(summary(description, settings.dicing_rate, images)), motion_facts(description)

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        """Return the description with a studio light, if emissive surfaces light too little of what is visible."""
        if not description.may_need_light:
            return description
        from .. import core
        from ..staging import with_studio_where_dark

        def build(small: SceneDescription, quick: RenderSettings) -> CoreScene:
            diced, _ = core.dice(small, quick, textures)
            return core.build(diced, dict(textures), quick)

        return with_studio_where_dark(description, settings, diagnostics, build)

    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        """Build the scene; `textures`, and `shapes`, which replaces the description's, are emptied on the way to save
        memory."""
        from .. import core

        return core.build(
            description,
            textures,
            settings,
            shapes,
            self.kept_images,
            has_record=self.has_record,
            on_file=partial(self.on_progress, "build"),
        )


def load_textures(
    description: SceneDescription,
    diagnostics: Diagnostics,
    read: Callable[[str], bytes] | None,
    default_wrap: DefaultWrap = DefaultWrap.BLACK,
    cache: TileCache | None = None,
) -> tuple[SceneDescription, Textures]:
    """Return the description, and the images of every file that could be read, with tile numbers or 0.

    Domes whose texture cannot be read are removed; each unreadable file is a diagnostic.
    """
    from ..description import Wrap
    from ..textures.texture_set import images_of, with_read_textures

    textures = images_of(read_files(description, diagnostics, read, Wrap(default_wrap.value), cache=cache))
    return replace(description, lights=with_read_textures(description.lights, textures, diagnostics)), textures


def read_files(
    description: SceneDescription,
    diagnostics: Diagnostics,
    read: Callable[[str], bytes] | None,
    default_wrap: Wrap,
    known: Mapping[TextureFile, LoadedFile] = MappingProxyType({}),
    on_image: Callable[[int, int], None] | None = None,
    cache: TileCache | None = None,
) -> dict[TextureFile, LoadedFile]:
    """Return what the description's files gave, with diagnostics about them; those in `known` that have the same readers are
    not read again."""
    from ..textures.coverage import note_missing_tiles, note_textures_outside
    from ..textures.texture_set import images_of, load_files

    files = load_files(description, read, default_wrap, diagnostics.shown, known, on_image=on_image, cache=cache)
    for one in files.values():
        diagnostics.extend(one.told)
    note_textures_outside(description, images_of(files), diagnostics)
    note_missing_tiles(description, diagnostics)
    return files


def image_sizes(textures: Textures) -> list[ImageSize]:
    """Return the sizes of distinct images, each counted once."""
    from ..report.summary import ImageSize

    different = {id(image): image for images in textures.values() for _, image in images}
    return [ImageSize(i.shape[1], i.shape[0], i.shape[2], i.stored.itemsize) for i in different.values()]
