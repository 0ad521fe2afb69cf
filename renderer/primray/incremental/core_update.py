"""Update of a scene in the core: other lights, surface values, camera, or transforms of a few meshes; everything else stays.

The core's tables of shapes, Embree's hierarchies over them, and textures are reused. Where they would differ in a new scene, a
new one is built.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..core import compiled
from ..core.inputs import filled
from ..core.light_upload import LightUpload
from ..core.native import raise_primray_error
from ..core.scene import CoreScene, core_scene, inverse_cdf
from ..core.scene_upload import UploadRecord, camera_input, fog_input, power_of_two_scale, scene_extent
from ..core.shape_upload import matrix, whole_part
from ..core.single_precision import OUTLYING, rebasing_origin
from ..core.surface_upload import KeptImages, ReadFiles, SurfaceUpload, is_cutout, is_fibre, is_hole
from ..description import Mesh, Placed, SceneDescription, Surface, TextureFile
from ..description.placement import transformed_boxes
from ..description.shading import pattern_files
from ..settings import DEFAULT_FILTER_WIDTH, RenderSettings
from ..textures.texture import Texture
from .steps import same

# Fields of a description that may change while the tables of shapes stay.
UPDATABLE = frozenset(
    {"lights", "surfaces", "camera", "anchor", "static", "resolution", "pixels", "pixel_aspect_ratio", "time_code"}
)
# Those that only the camera in the core depends on.
OF_VIEW = frozenset({"camera", "anchor", "resolution", "pixels", "pixel_aspect_ratio"})
NO_SURFACES = np.zeros(0, np.int32)
LightImages = Mapping[TextureFile, list[tuple[int, Texture]]]


def updated_core_scene(
    scene: CoreScene,
    before: SceneDescription,
    now: SceneDescription,
    changed: frozenset[str],
    images: LightImages,
    read: ReadFiles,
    settings: RenderSettings,
) -> CoreScene | None:
    """Return the scene of `before` updated to `now`, where these differ in the fields `changed`; None where it has to be
    rebuilt.

    Descriptions are diced, with all of their shapes; `images` are those of lights, and `read` reads files of surfaces. The
    scene of before is consumed, unless None is returned on account of the descriptions alone.
    """
    uploaded = scene.uploaded
    if uploaded is None:
        return None
    if "lights" in changed and same(before.lights, now.lights):  # read again on account of something else
        changed -= {"lights"}
    if not _may_stay(uploaded, before, now, changed):
        return None
    placed = _updated_placements(uploaded, before, now)
    if placed is None:
        return None
    try:
        return _built(scene, *placed, now, images, read, settings, changed)
    except compiled.CoreError as error:
        raise_primray_error(error)


def kept_images(scene: CoreScene, fresh: Collection[TextureFile], read: ReadFiles) -> KeptImages | None:
    """Return the images of a scene that is built anew, but those of files that were read again; the scene is consumed.

    None where it has none, or was consumed before.
    """
    built, uploaded = scene.take(), scene.uploaded
    if built is None or uploaded is None:
        return None
    numbers = {key: number for key, number in uploaded.texture_numbers.items() if key.file not in fresh}
    return KeptImages(compiled.KeptTextures(built), numbers, read, uploaded.domes)


def _may_stay(uploaded: UploadRecord, before: SceneDescription, now: SceneDescription, changed: frozenset[str]) -> bool:
    if not (changed <= UPDATABLE and now.exposure is None and now.camera_motion is None):
        return False
    if not uploaded.is_editable and (not changed <= OF_VIEW or any(map(_reads_files_by_pattern, now.surfaces))):
        return False
    if not np.array_equal(uploaded.origin, rebasing_origin(now.anchor or now.camera)):
        return False
    return len(before.surfaces) == len(now.surfaces) and all(map(_are_alike, before.surfaces, now.surfaces))


def _reads_files_by_pattern(surface: Surface) -> bool:
    return surface.pattern is not None and bool(pattern_files(surface.pattern))


def _are_alike(one: Surface, other: Surface) -> bool:
    """Return whether shapes bound to either surface are uploaded alike."""
    if one is other:
        return True
    alike = one.inputs == other.inputs and one.pattern == other.pattern and one.interface == other.interface
    return alike and is_cutout(one) == is_cutout(other) and is_hole(one) == is_hole(other) and is_fibre(one) == is_fibre(other)


def _updated_placements(
    uploaded: UploadRecord, before: SceneDescription, now: SceneDescription
) -> tuple[UploadRecord, list[tuple[int, Placed, Placed]]] | None:
    """Return the upload for the new description, and the static shapes that moved: core's row, before and now. None:
    rebuild."""
    given = uploaded.description
    are_numbered_alike = len(given.static) == len(before.static) + len(uploaded.copies)  # no stretched curves among them
    static = (*now.static, *uploaded.copies) if are_numbered_alike else given.static
    d = replace(now, static=static, prototypes=given.prototypes, placements=given.placements)
    if len(before.static) != len(now.static):
        return None
    numbers = [i for i, (a, b) in enumerate(zip(before.static, now.static, strict=True)) if a is not b]
    if not numbers:
        return replace(uploaded, description=d), []
    if not are_numbered_alike:
        return None
    moved = [(uploaded.rows[i], before.static[i], now.static[i]) for i in numbers]
    if any(row < 0 or a.shape != b.shape or a.instance != b.instance for row, a, b in moved):
        return None
    if any(not d.surfaces[k].interface for _, _, b in moved for k in np.unique(d.shapes[b.shape].surface).tolist()):
        return None  # where the boundary of a volume is depends on where it is (renderer/primray/core/volume_bounds.py)
    own = uploaded.boxes[[b.shape for _, _, b in moved]]
    low, high = uploaded.low.copy(), uploaded.high.copy()
    with np.errstate(invalid="ignore", over="ignore"):
        low[numbers], high[numbers] = transformed_boxes(np.array([b.matrix for _, _, b in moved]), own[:, 0], own[:, 1])
        reach = (
            np.maximum(np.abs(low[numbers] - uploaded.origin), np.abs(high[numbers] - uploaded.origin)).max() * uploaded.scale
        )
    if not reach < OUTLYING or power_of_two_scale(scene_extent(d, low, high, uploaded.origin)) != uploaded.scale:
        return None
    return replace(uploaded, description=d, low=low, high=high), moved


def _built(
    scene: CoreScene,
    uploaded: UploadRecord,
    moved: list[tuple[int, Placed, Placed]],
    now: SceneDescription,
    images: LightImages,
    read: ReadFiles,
    settings: RenderSettings,
    changed: frozenset[str],
) -> CoreScene | None:
    d = uploaded.description
    given = scene.take()
    assert given is not None
    builder = compiled.SceneBuilder(given)
    textures = {**uploaded.textures, **images}
    inputs = SurfaceUpload(builder, textures, d.time_code or 0.0)
    width = settings.filter_width if settings.filter_width is not None else DEFAULT_FILTER_WIDTH[settings.pixel_filter]
    camera = filled(
        camera_input(d.camera, d.frame), filter_width=width, filter_inverse_cdf=inverse_cdf(settings.pixel_filter, width)
    )
    builder.set_camera(camera)
    if not (changed <= OF_VIEW and builder.keeps_means()):
        builder.drop_surfaces_and_lights()
        inputs.add_surfaces(d.surfaces)
        for row, old, new in moved:
            mesh = now.shapes[new.shape]
            if not isinstance(mesh, Mesh) or not builder.replace_mesh(
                row, _placed(mesh), matrix(old.matrix), matrix(new.matrix)
            ):
                return None
        lights = LightUpload(builder, uploaded.domes, d.lights_apart)
        lights.add(d.lights, textures)
        if d.fog is not None:
            builder.set_fog(fog_input(d.fog))
        uploaded = replace(uploaded, light_groups=lights.groups, domes=tuple(lights.domes))
        builder.set_camera(camera)
    coarse = set(builder.release_coarse_textures())
    inputs.add_read_images(
        {key: number for key, number in uploaded.texture_numbers.items() if number in coarse}, read, scene.tiled
    )
    made = core_scene(builder.finish(), uploaded, d, scene.record)
    made.tiled, made.tiles_before = scene.tiled, scene.tiles_before
    return made


def _placed(mesh: Mesh) -> compiled.MeshInput:
    """Return a mesh input with the fields that depend on the mesh's transform."""
    part, made = whole_part(mesh, NO_SURFACES), compiled.MeshInput()
    made.points, made.cutout = mesh.points, False
    made.normals, made.normal_kind = part.normals[0], compiled.Attribute[part.normals[1]]
    return made
