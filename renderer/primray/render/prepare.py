"""From a stage to a scene that is ready to sample: opened, translated, its textures loaded, built within the memory allowed.

What does the work is imported when a render starts; importing this module costs nothing.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .. import process_memory
from ..aov_names import taxonomy_of
from ..diagnostics import Diagnostics
from ..errors import SettingsError, UnsupportedError
from ..garbage import without_collection
from ..report.prepared import Prepared
from ..settings import STAGING, Ground, Metric, RenderSettings
from ..settings.in_stage import StageSettings
from .steps import Steps

if TYPE_CHECKING:
    from ..color.color_space import ColorSpace
    from ..description import SceneDescription
    from ..description.picture_file import PictureFile
    from ..report.report import Costs
    from ..report.summary import ImageSize

DENOISING_PIXEL_BYTES = 1000  # what Open Image Denoise and the halves take, a little more than was measured
REMOVED_PIXEL_BYTES = 102  # the exact sums of both replicates of what a clamp takes, or of caustics
FILM_PIXEL_BYTES = 126  # of the core's, which is not loaded yet where memory is checked; a test holds them equal


@dataclass(frozen=True)
class OpenedStage:
    """A stage that has been composed, with what there was to tell of it."""

    stage: Any  # Usd.Stage
    composed_by: tuple[Any, ...]  # the settings that decide how
    diagnostics: Diagnostics
    seconds: float
    name: object = None  # what the user called it: its path, if that was given


def composing_settings(settings: RenderSettings) -> tuple[Any, ...]:
    return settings.variants, settings.load, settings.mask, settings.session_layer


def open_once(stage: str | os.PathLike[str] | Any, settings: RenderSettings) -> OpenedStage:
    """Open a stage as `settings` compose it, for `render_frames` and to look at before."""
    from .. import usd
    from ..report.report import Costs

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
    """Translate an opened stage, load its textures and build its scene; what there is to tell goes to `diagnostics`.

    `steps`: of who keeps what earlier renders made; None: everything is made here.
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
    from ..description import CameraSight
    from ..description.background import is_lit_behind
    from ..description.picture_file import PLAIN
    from ..report.report import resolve_settings
    from ..report.texture_sizes import texture_sizes

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
        description, textures = steps.load_textures(description, diagnostics, settings)
        if settings.dome is not None:
            from ..staging import require_dome

            require_dome(description, settings, diagnostics)
        diagnostics.raise_if_refused(settings.refusal)
    images = steps.image_sizes(textures)
    check_memory(description, settings, images, film_copies=int(fingerprinted))
    with costs.stage("build"):
        description = steps.add_missing_light(description, textures, settings, diagnostics)
    digests = steps.fingerprint(description, textures) if fingerprinted else {}
    with costs.stage("dice"):
        description, limits = steps.dice(description, textures, settings)
    for code, path, message in limits:
        diagnostics.add(code, path, message)

    ground_shadow = None
    if settings.ground is Ground.SHADOW:
        from ..staging.ground_shadow import GroundShadow

        ground_shadow = GroundShadow(description, dict(textures), settings)
    if settings.metric is Metric.DISPLAY:
        _check_view(description, diagnostics, settings)
    settings = resolve_settings(settings, description)
    counted, motion = steps.count(description, settings, images)
    shapes, description = list(description.shapes), replace(description, shapes=())
    with costs.stage("build"):
        scene = steps.build(description, textures, settings, shapes)
    for code, path, message in scene.warnings:
        diagnostics.add(code, path, message)
    diagnostics.raise_if_refused(settings.refusal)
    if scene.bounds is None:
        _require_something_to_render(diagnostics, settings)
    left_out = {} if scene.bounds is not None else usd.left_out(stage, settings)
    camera, frame, lights = description.camera, description.frame, len(description.lights)
    if description.aovs and stage.GetPrototypes():  # all of its instances may have ended in a copy
        assert scene.record is not None
        record = scene.record
        record.names = usd.names_in_instances(stage, record.shape_paths, record.surface_paths, description.instances)
    assets: dict[str, str] = {}
    if any(request.source == "crypto_asset" for request in description.aovs):
        assert scene.record is not None
        assets = usd.assets_of(stage, scene.record.shape_paths)
    prepared = Prepared(scene, settings, counted, camera, frame, digests, description.aovs, lights, motion, left_out)
    prepared = replace(prepared, asked=asked)
    if file != PLAIN or is_lit_behind(description):
        prepared = replace(prepared, file=replace(file, lit_behind=is_lit_behind(description)))
    labels = None
    if any(taxonomy_of(request.source) for request in description.aovs):
        labels = lambda prim, instance, taxonomy: usd.labels_of(stage, prim, instance, taxonomy, settings.time_code)  # noqa: E731
    hidden = (
        scene.bounds is not None
        and bool(description.surfaces)
        and all(surface.camera is CameraSight.HIDDEN for surface in description.surfaces)
    )
    prepared = replace(prepared, ground_shadow=ground_shadow)
    return replace(prepared, assets=assets, labels=labels, stage=usd.stage_name(stage), hidden_from_camera=hidden)


def _require_something_to_render(diagnostics: Diagnostics, settings: RenderSettings) -> None:
    """Raise UnsupportedError where nothing is drawn because what the stage refers to is missing: no picture is a success."""
    missing = [d for d in diagnostics if d.code == "composition-error" and not settings.refusal.allows(d.code)]
    if missing:
        message = f"no geometry is drawn, and what the stage refers to is missing: {missing[0].message}"
        raise UnsupportedError(message, where=missing[0].prim_path, code="nothing-to-render")


def with_stage_settings(
    settings: RenderSettings, asked: StageSettings, diagnostics: Diagnostics
) -> tuple[RenderSettings, StageSettings]:
    """Return the settings with what the stage asks for where they are open, and what of it was taken.

    What cannot be had on this machine is reported, and left out.
    """
    if asked.of("denoise") and settings.denoise is None:
        from ..denoising.denoiser import has_denoiser

        if not has_denoiser():
            one = next(one for one in asked.asked if one.name == "denoise")
            message = (
                f"{one.attribute}: there is no denoiser here (pip install primray[denoise]), so the picture is not denoised."
            )
            diagnostics.add("render-settings-input", one.prim, message, one.attribute)
            asked = asked.without("denoise")
    settings, taken = asked.applied_to(settings)
    for one in taken:
        if one.meaning:
            diagnostics.add("foreign-settings", one.prim, f"{one.attribute} is taken for {one.meaning}.", one.attribute)
    return settings, StageSettings(taken)


def with_usable_view(file: PictureFile, space: ColorSpace, path: str, diagnostics: Diagnostics) -> PictureFile:
    """Return what a product asks of its file, without a view that the OpenColorIO configuration does not have."""
    asked = file.view
    if asked.is_default:
        return file
    from ..images.exposure import View

    try:
        View(asked.view, asked.display, asked.look, space).check()
    except SettingsError as error:
        message = f"The view that its pictures are to have cannot be made, the default is used: {error.message}."
        diagnostics.add("render-settings-input", path, message, "primray:view")
        return replace(file, view=replace(asked, view=None, display=None, look=None))
    return file


def _with_usable_views(description: SceneDescription, diagnostics: Diagnostics) -> PictureFile:
    file, space = description.file, description.rendering_space
    products = tuple((path, with_usable_view(own, space, path, diagnostics)) for path, own in file.products)
    return replace(with_usable_view(file, space, "", Diagnostics() if products else diagnostics), products=products)


def with_additions(description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics) -> SceneDescription:
    """Return the description with what is asked for beside the stage; the very same object where nothing is."""
    if all(getattr(settings, name) == value for name, value in STAGING.items()):
        return description
    from ..images.background import background_of
    from ..staging import staged

    background_of(settings.background)  # is refused before anything is sampled
    return staged(description, settings, diagnostics)


def _check_view(description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings) -> None:
    """SettingsError where a render that is judged on a display has no view, before it samples."""
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
    """LimitError if the scene is estimated to need more memory than is allowed, before anything of it is built.

    A copy of the film is what a checkpoint is written from, or read into.
    """
    limit_bytes = settings.max_memory_bytes
    if limit_bytes is None:
        return
    from ..aov_names import aov_bytes
    from ..report.summary import summary

    width, height = description.frame.size
    removals = (settings.clamp_indirect is not None) + (not settings.caustics)
    of_pixel = {
        "checkpoint": film_copies * FILM_PIXEL_BYTES,
        "AOVs": aov_bytes(description.aovs),
        "denoising": settings.denoises * DENOISING_PIXEL_BYTES,
        "what is left out": removals * REMOVED_PIXEL_BYTES,
    }
    parts = dict(summary(description, settings.dicing_rate, images).memory_parts)
    parts |= {name: size * width * height for name, size in of_pixel.items()}
    if process_memory.held is not None:
        from ..report.summary import PROCESS_BYTES, VIEW_BYTES

        of_process = PROCESS_BYTES + max(VIEW_BYTES - sum(parts.values()), 0)
        parts["the process without a scene"] = of_process + process_memory.MARGIN
        process_memory.held.expect(parts)
    if sum(parts.values()) > limit_bytes:
        raise process_memory.too_little(limit_bytes, parts)
