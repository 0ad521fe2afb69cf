"""Volume prims: fields and a volume shader to media and emission, one for each placement of the prim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import VolumeEmission, VolumeMedium
from ...description.placement import chunks
from ...volumes.volume_grid import VolumeGrid
from ..instancing.instances import Chain
from ..materials.appearance import camera_visibility
from ..scene.context import Context
from ..scene.droplets import droplets_of
from ..scene.inheritance import ResolvedPrim
from ..scene.translated_scene import TranslatedScene
from .baking import TooLargeError, VolumeMaker
from .coefficients import UnusableShaderError, with_droplets
from .fields import Field, fields_of
from .files import TOO_LARGE
from .motion import VolumePath, VolumePlace
from .shaders import coefficients_of, storm_fallback
from .velocity import TooFarError, Velocities, velocities_of
from .volume_light import as_light


def add_volume(
    scene: TranslatedScene, leaf: ResolvedPrim, group_from_prim: Doubles, chains: list[Chain], is_in_world: bool, ctx: Context
) -> None:
    """Add a Volume's media and emission; `is_in_world`: its group is the stage itself, and not a prototype."""
    scene.record.is_plain = False  # any edit is a new translation, which reads no file again
    if "extent" not in leaf.names:
        ctx.findings.unbounded_shapes.add(leaf.path)  # USD computes none for a Volume
    blur_scale = leaf.inherited.blur_scale
    instant = 0.0 if ctx.timing.is_open else ctx.timing.opens * blur_scale
    placed, usable = _placements(leaf, chains, ctx)
    fields, missing = fields_of(leaf, group_from_prim, placed, is_in_world, instant, ctx)
    if not fields:
        if not missing:
            ctx.warn("volume-field", leaf.path, "It names no field (field:NAME): it is not rendered.")
        return
    droplets = droplets_of((leaf.prim, leaf.material), ctx)
    coefficients = with_droplets(coefficients_of(leaf.material, fields, leaf.path, ctx), droplets)
    maker = VolumeMaker(
        coefficients=coefficients,
        fields=fields,
        instances=placed,
        path=leaf.path,
        ctx=ctx,
        material="" if leaf.material is None else str(leaf.material.GetPath()),
        camera=camera_visibility(leaf, ctx),
    )
    try:
        try:
            media, emissions = list(maker.media()), list(maker.emissions())
        except UnusableShaderError as error:
            ctx.warn("shader-ignored", leaf.path, f"Its volume shader cannot be rendered: {error}.")
            fallback = storm_fallback(fields, "its material's volume shader cannot be rendered")
            maker.coefficients = with_droplets(fallback, droplets)
            media, emissions = list(maker.media()), list(maker.emissions())
    except TooLargeError as error:
        ctx.warn(TOO_LARGE, leaf.path, f"It is not rendered: {error}.")
        return
    _report_absent_fields([name for name in maker.absent_fields() if name not in missing], bool(media or emissions), maker)
    velocities = velocities_of(leaf, fields, ctx)
    _report_fields({*maker.fields_read(), *(() if velocities is None else velocities.names)}, fields, ctx)
    blurred = "" if velocities is None else _blur(media, emissions, maker, velocities)
    ctx.warn("volume-convention", leaf.path, maker.coefficients.convention + blurred)
    if ctx.timing.is_open:
        _add_paths(scene, media, emissions, maker, VolumePlace(leaf.path, chains, usable, blur_scale))
    scene.media += media
    scene.volume_emissions += as_light(emissions, leaf, ctx)


def _report_absent_fields(absent: list[str], is_seen: bool, maker: VolumeMaker) -> None:
    """Report names of fields that the shader reads and the volume does not have; an error where nothing is seen for it."""
    if not absent:
        return
    names, has = ", ".join(absent), ", ".join(maker.fields)
    which, is_none = ("the field", "is none") if len(absent) == 1 else ("the fields", "are none")
    message = f"Its shader reads {which} {names}, which {is_none} of its own ({has}): "
    if is_seen:
        maker.ctx.warn("material-input", maker.path, f"{message}the shader's default is used.")
    else:
        maker.ctx.warn("volume-field", maker.path, f"{message}nothing of it is seen.")


def _report_fields(read: set[str], fields: dict[str, Field], ctx: Context) -> None:
    """Report fields that are read and are not rendered as their files have them, or have nothing in them."""
    for field in fields.values():
        if field.name not in read:
            continue
        for message, attribute in field.changes:
            ctx.warn("volume-values", field.path, message, attribute)
        if field.grid.support is None and not field.changes:
            ctx.warn("volume-empty", field.path, f"The grid {field.grid_name!r} is 0 everywhere.", "filePath")


def _blur(media: list[VolumeMedium], emissions: list[VolumeEmission], maker: VolumeMaker, velocities: Velocities) -> str:
    """Blur media and emissions by velocities, and return what the report says of it."""
    fields = {id(matrices): of for matrices, of in maker.placed}
    by_field: dict[str, list[VolumeGrid]] = {}
    drawn: list[VolumeMedium | VolumeEmission] = [*media, *emissions]
    for volume in drawn:
        by_field.setdefault(fields[id(volume.matrices)].name, []).append(volume.grid)
    try:
        blurs = {name: velocities.blur_of(maker.fields[name], grids) for name, grids in by_field.items()}
    except TooFarError as error:
        maker.ctx.warn("motion", maker.path, f"It is not blurred by its velocities, as {error}.")
        return ""
    if not any(blurs.values()):
        return ""
    media[:] = [replace(medium, blur=blurs[fields[id(medium.matrices)].name]) for medium in media]
    emissions[:] = [replace(glow, blur=blurs[fields[id(glow.matrices)].name]) for glow in emissions]
    *others, last = velocities.names
    name = f"{', '.join(others)} and {last}" if others else last
    which = "fields" if others else "field"
    return f" While the shutter is open it is blurred by the velocities of the {which} {name}, in its units per second."


def _add_paths(
    scene: TranslatedScene, media: list[VolumeMedium], emissions: list[VolumeEmission], maker: VolumeMaker, place: VolumePlace
) -> None:
    """Add the paths of media and emissions that move, one for each field that they are at."""
    fields = {id(matrices): of for matrices, of in maker.placed}
    paths: dict[str, VolumePath] = {}

    def path_of(volume: VolumeMedium | VolumeEmission) -> VolumePath | None:
        of = fields[id(volume.matrices)]
        if of.motion is None and not place.moves:
            return None
        return paths.setdefault(of.name, VolumePath(place, of.group_from_index, of.motion))

    for k, medium in enumerate(media, len(scene.media)):
        if (path := path_of(medium)) is not None:
            path.media.append(k)
    for k, emission in enumerate(emissions, len(scene.volume_emissions)):
        if (path := path_of(emission)) is not None:
            path.emissions.append(k)
    scene.volume_paths += paths.values()


def _placements(leaf: ResolvedPrim, chains: list[Chain], ctx: Context) -> tuple[Doubles, npt.NDArray[np.bool_]]:
    """Return world_from_group (N, 4, 4) of the instances at the frame, without those whose matrices are singular, and which of
    all instances they are."""
    rows = np.concatenate([rows for chain in chains for rows in chunks(chain)])
    found = np.zeros((len(rows), 4, 4))
    found[:, :3], found[:, 3, 3] = rows, 1.0
    with np.errstate(all="ignore"):
        usable = np.isfinite(rows).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(rows[:, :, :3]))) > 0)
    if not usable.all():
        count = int(np.count_nonzero(~usable))
        ctx.warn("singular-transform", leaf.path, f"{count} instances have a singular or non-finite matrix and are left out.")
    return found[usable], usable
