"""A description to a scene in the core: cages are diced, everything is uploaded and accelerated.

Pixel filters are tables of offsets, for the core's filter importance sampling.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .. import process_memory
from ..description import SceneDescription, Shape
from ..errors import LimitError
from ..settings import DEFAULT_FILTER_WIDTH, Filter, RenderSettings
from ..tessellation import dice as dicing
from ..tessellation.dice import dice_patches_of
from ..tessellation.ribbons import dice_ribbons
from . import compiled
from .displacement_upload import displacements
from .light_path_tables import light_path_tables, missing_groups
from .native import raise_primray_error, threads
from .scene import CoreScene
from .scene_record import SceneRecord
from .scene_upload import UploadRecord, emitter_warnings, upload_scene
from .surface_upload import MutableTextures, Textures


def dice(
    description: SceneDescription, settings: RenderSettings, textures: Textures | None = None
) -> tuple[SceneDescription, dicing.Warnings]:
    """Return the description with subdivision cages diced to triangles, and warnings where they are coarser or sharper.

    `textures`: every TextureFile that could be read; those that displace cages are used.
    """
    try:
        displaced = displacements(description, textures or {})
        chosen = dicing.dicing_by_settings(settings)
        made, warnings = dicing.dice(compiled, description, chosen, threads(settings), displaced)
        made, notes = dice_patches_of(dice_ribbons(made, chosen.pixels), chosen)
        return made, [*warnings, *notes]
    except compiled.CoreError as error:
        raise_primray_error(error)


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
        scene, uploaded = upload_scene(description, textures, width, inverse_cdf(settings.pixel_filter, width), shapes, record)
    except compiled.CoreError as error:
        if error.args[0] == "out-of-memory" and settings.max_memory_bytes is not None:
            held = int(compiled.embree_memory()[1]) / process_memory.MIB
            allowed = settings.max_memory_bytes / process_memory.MIB
            sentence = f"acceleration structures need more than {held:.0f} MiB, which exceeds the limit of {allowed:.0f} MiB"
            raise LimitError(sentence, code=process_memory.CODE) from error
        raise_primray_error(error)
    finally:
        compiled.limit_embree_memory(2**62)
    return core_scene(scene, uploaded, description, record)


def limit_hierarchies(settings: RenderSettings) -> None:
    """Make Embree's builds fail rather than exceed what is left of the memory limit."""
    limit = settings.max_memory_bytes
    if limit is None:
        return
    left = limit if process_memory.held is None else limit - process_memory.MARGIN - process_memory.resident_bytes()
    compiled.limit_embree_memory(int(max(left, 0)) + int(compiled.embree_memory()[0]))


def core_scene(scene: compiled.Scene, uploaded: UploadRecord, d: SceneDescription, record: SceneRecord | None) -> CoreScene:
    warnings = [*uploaded.warnings, *emitter_warnings(scene)]
    made = CoreScene(scene, d.camera.exposure_scale, warnings, d.frame.size, record, d.rendering_space, uploaded.bounds)
    made.uploaded = uploaded
    made.light_groups = uploaded.light_groups
    made.light_paths = light_path_tables(d.aovs, uploaded.light_groups)
    if made.light_paths is not None:
        made.warnings += missing_groups(made.light_paths, uploaded.light_groups)
    return made


CELLS = 512  # as PixelFilter::kCells in scene/camera.hpp


def profile(filter: Filter, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the filter's value at x in [-1, 1], its full width."""
    if filter is Filter.GAUSSIAN:
        # Standard deviation: a quarter of the width; shifted so that it is 0 at the ends, two standard deviations away.
        return np.asarray(np.exp(-2 * x * x) - np.exp(-2.0))
    if filter is Filter.BLACKMAN_HARRIS:
        # Harris 1978, "On the Use of Windows for Harmonic Analysis with the Discrete Fourier Transform", 4 terms, -92 dB.
        t = np.pi * (x + 1)
        return 0.35875 - 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) - 0.01168 * np.cos(3 * t)
    return np.ones_like(x)


def inverse_cdf(filter: Filter, width: float) -> npt.NDArray[np.float32]:
    """Return offsets in pixels at cumulative probability i / CELLS, (CELLS + 2,); empty for a box, which needs no table."""
    if filter is Filter.BOX:
        return np.zeros(0, np.float32)
    x = np.linspace(-1, 1, 20001)
    f = profile(filter, x)
    cdf = np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2)])
    cdf /= cdf[-1]
    offsets = np.interp(np.arange(CELLS + 1) / CELLS, cdf, x) * (width / 2)
    return np.append(offsets, offsets[-1]).astype(np.float32)
