"""A scene in the core, built from a description: cages are diced, everything is uploaded and accelerated.

The scene has the splitting factors and path guides that were learnt for it. Pixel filters are tables of offsets, for the core's
filter importance sampling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .. import process_memory
from ..aovs import has_deep
from ..color.color_space import REC709, ColorSpace
from ..description import SceneDescription, Shape
from ..description.placement import Box
from ..errors import LimitError
from ..settings import DEFAULT_FILTER_WIDTH, Filter, RenderSettings
from ..tessellation import dice as dicing
from ..time_spans import span
from . import compiled
from .displacement_upload import displacements
from .inputs import integrator_settings
from .light_path_tables import LightPathTables, automaton_without_caustics, light_path_tables, missing_groups
from .light_upload import LightGroups
from .native import lanes, max_depth, raise_primray_error, threads
from .scene_record import InstanceNumbers, SceneRecord
from .scene_upload import UploadRecord, emitter_warnings, upload_scene
from .surface_upload import KeptImages, MutableTextures, OnFile, Textures
from .tiled_textures import TiledTextures, facts_since, tiled_textures

if TYPE_CHECKING:
    from .scene_upload import UploadRecord


LARGEST_CLAMP = 3e38  # the core's clamp must be finite


class Cancelled(Exception):
    """What was being learnt for a scene is not needed any more."""


class Splits(NamedTuple):
    """Splitting factors: paths that continue from the first hit, and light samples taken there."""

    paths: int = 1
    lights: int = 1


class CoreScene:
    """A scene that is built in the core and ready to render."""

    def __init__(
        self,
        scene: compiled.Scene | None,
        exposure_scale: float,
        warnings: list[tuple[str, str, str]],
        resolution: tuple[int, int],
        record: SceneRecord | None = None,
        rendering_space: ColorSpace = REC709,
        bounds: Box | None = None,
    ) -> None:
        self._built = scene  # None where parts are merged, which nothing renders
        self.record = record  # None unless AOVs are requested
        self.resolution = resolution  # of the film, in pixels
        self._exposure_scale = exposure_scale
        self.warnings = warnings  # code, prim path, message
        self.rendering_space = rendering_space
        self.bounds = bounds  # low and high corner (3,) of everything in the world, without a few outliers
        self.light_paths: LightPathTables | None = None  # None unless light path expressions are requested
        self.light_groups: LightGroups | None = None
        self.is_deep = False  # films of the scene hold a deep picture
        self._without_caustics: compiled.LpeAutomaton | None = None  # for renders without caustics
        self.uploaded: UploadRecord | None = None
        self.cancellation: compiled.Cancellation | None = None  # asked for from other threads; learning then raises Cancelled
        self.tiled: TiledTextures | None = None  # where a budget was set
        self.tiles_before: dict[str, Any] = {}  # its facts before the scene was built
        # Caches by path depth and whether caustics are rendered.
        self._guides: dict[tuple[int, bool, Splits], compiled.Guide | None] = {}
        self._caustics: dict[int, compiled.CausticGuide | None] = {}
        self._splits: dict[tuple[int, bool], Splits] = {}

    @property
    def _scene(self) -> compiled.Scene:
        assert self._built is not None
        return self._built

    @property
    def is_there(self) -> bool:
        """Return whether nobody has taken the core's scene."""
        return self._built is not None

    def take(self) -> compiled.Scene | None:
        """Return the core's scene for another one to be made of it; this one renders nothing afterwards."""
        scene, self._built = self._built, None
        return scene

    def splits(self, settings: RenderSettings) -> Splits:
        """Return the splitting factors that a pilot finds best, measured once for each depth and caustics setting.

        A quick look has no pilot and no splitting.
        """
        if settings.is_quick_look:
            return Splits()
        depth = max_depth(settings), settings.caustics
        if depth not in self._splits:
            pilot = integrator_settings(settings, caustics=self.caustics(settings), cancel=self.cancellation)
            try:
                with span("choose splits"):
                    found = Splits(*compiled.choose_splits(self._scene, pilot, lanes()))
            except compiled.CoreError as error:
                raise_primray_error(error)
            self._raise_if_cancelled()
            self._splits[depth] = found
        return self._splits[depth]

    def guide(self, settings: RenderSettings, splits: Splits) -> compiled.Guide | None:
        """Return the path guide, learnt once from training paths; None where guiding would not pay off, and for a quick
        look."""
        if settings.is_quick_look:
            return None
        depth = max_depth(settings), settings.caustics
        if (*depth, splits) not in self._guides:
            asked = integrator_settings(
                settings,
                splits=splits.paths,
                light_samples=splits.lights,
                caustics=self.caustics(settings),
                cancel=self.cancellation,
            )
            with span("path guide"):
                found = compiled.learn_guide(self._scene, asked, lanes())
            self._raise_if_cancelled()
            self._guides[*depth, splits] = found
        return self._guides[*depth, splits]

    def caustics(self, settings: RenderSettings) -> compiled.CausticGuide | None:
        """Return the guide to caustics of small lights, learnt once from photons.

        None where there are no caustics worth guiding, where guiding would not pay off, where caustics are left out, and for a
        quick look.
        """
        if settings.is_quick_look or not settings.caustics:
            return None
        depth = max_depth(settings)
        if depth not in self._caustics:
            with span("caustics"):
                found = compiled.learn_caustics(self._scene, depth, threads(settings), lanes(), cancel=self.cancellation)
            self._raise_if_cancelled()
            self._caustics[depth] = found
        return self._caustics[depth]

    def _raise_if_cancelled(self) -> None:
        if self.cancellation is not None and self.cancellation.is_asked:
            raise Cancelled

    def lpe_automaton(self, settings: RenderSettings) -> compiled.LpeAutomaton | None:
        """Return the automaton of the light path expressions, or None if nothing depends on them."""
        if settings.caustics:
            return None if self.light_paths is None else self.light_paths.automaton
        if self._without_caustics is None:
            expressions = () if self.light_paths is None else self.light_paths.expressions
            assert self.light_groups is not None
            self._without_caustics = automaton_without_caustics(expressions, self.light_groups)
        return self._without_caustics

    def clamp_of(self, value: float) -> float:
        """Return the radiance before exposure, as the film stores it, that corresponds to `value` in the picture."""
        scale = abs(self._exposure_scale)
        return min(value / scale, LARGEST_CLAMP) if scale > 0 else LARGEST_CLAMP

    def shape_of_light(self, row: int) -> tuple[int, int]:
        """Return the shape of emissive geometry by its light's row, as the plane "prim" numbers it, and its instance or -1."""
        return compiled.shape_of_light(self._scene, row)

    def forget_guides(self) -> None:
        """Discard learnt guides and splitting factors, as if the scene were new: for renders of another depth."""
        self._guides.clear()
        self._caustics.clear()
        self._splits.clear()

    @property
    def memory_bytes(self) -> int:
        """Bytes of the core's arrays, of Embree's acceleration structures, and of guides."""
        guides = [guide for guide in (*self._caustics.values(), *self._guides.values()) if guide is not None]
        return self._scene.memory_bytes + compiled.embree_memory()[0] + sum(guide.memory_bytes for guide in guides)

    @property
    def texture_memory(self) -> dict[str, Any] | None:
        """What textures out of core read since the scene was built; None where no budget was set."""
        return None if self.tiled is None else facts_since(self.tiled.facts(), self.tiles_before)

    @property
    def exposure_scale(self) -> float:
        return self._exposure_scale

    @property
    def instance_numbers(self) -> InstanceNumbers:
        assert self.record is not None
        group, first, parent, total = self._scene.placements
        return InstanceNumbers(self.record, group, first, parent, total)

    def name_of_part(self, shape: int, instance: int, outer: int) -> tuple[str, str]:
        """Return the path of a shape, and the name of its instance ("": none), of a scene that has a record.

        Numbers are those of `first_hits`: shapes without triangles are below -1; instances are -1 where there are none.
        """
        record = self.record
        assert record is not None
        row, name = record.meshes[shape] if shape >= 0 else record.curved[-2 - shape]
        if not name and instance >= 0:
            numbers = self.instance_numbers
            name = numbers.name(int(numbers.number(np.array([instance]), np.array([outer]))[0]))
        return record.shape_paths[row], name

    @property
    def features(self) -> list[dict[str, str]]:
        """Features beyond opaque faceted Lambert triangles that are enabled, and why; guides once they are learnt."""
        s = self._scene
        guides = [guide for guide in self._guides.values() if guide is not None]
        copies = 0 if self.uploaded is None else len(self.uploaded.copies)
        regions = max((guide.regions for guide in guides), default=0)
        photons = max((guide.photons for guide in self._caustics.values() if guide is not None), default=0)
        if any(guide.alone for guide in guides):
            photons = 0
        rows = [
            (s.has_instances, "instances", "prototypes are placed more than once"),
            (s.has_curves, "curves", "the scene has curves"),
            (
                copies > 0,
                f"instances of curves as curves of the world ({copies})",
                "they overlap: one hierarchy finds hits sooner",
            ),
            (s.has_spheres, "exact spheres", "the scene has Sphere prims"),
            (s.has_attributes, "vertex attributes", "meshes have normals or varying displayColor"),
            (s.textures > 0, f"textures ({s.texture_bytes / 2**20:.1f} MiB)", "surfaces' inputs are connected to images"),
            (s.has_inputs, "varying inputs", "a surface's inputs are connected to textures or primvars"),
            (s.has_cutouts, "cut-outs", "a surface has an opacityThreshold and an opacity that varies"),
            (s.has_emission, "surface emission", "a surface has emissiveColor"),
            (s.emitters > 0, "emitting geometry sampled as lights", f"{s.emitters} shapes emit"),
            (s.has_thin, "see-through shadows", "a surface transmits light without refraction"),
            (s.has_lens, "thin lens", "the camera has an fStop and a focus distance"),
            (s.has_clipping_planes, "clipping planes", "the camera has clippingPlanes"),
            (s.has_moving_camera, "moving camera", "it moves while its shutter is open"),
            (s.has_moving_instances, "moving instances", "shapes or instances move while the shutter is open"),
            (s.has_moving_volumes, "moving volumes", "volumes move while the shutter is open"),
            (s.has_moving_points, "moving vertices", "meshes deform while the shutter is open"),
            (s.has_moving_lights, "moving lights", "lights move while the shutter is open"),
            (s.domes > 0, "dome", "the scene has a DomeLight"),
            (s.has_lobe_factors, "lobe factors", "a light's diffuse or specular multiplier is not 1"),
            (photons > 0, f"caustics guided by {photons} photons", "small lights shine on metal or glass"),
            (regions > 0, f"indirect light guided in {regions} regions", "most of the noise comes from indirect light"),
            (s.sampled_lights > 0, f"light sampling ({s.sampled_lights})", "lights that are sampled at every vertex"),
        ]
        return [{"name": name, "why": why} for on, name, why in rows if on]


def dice(
    description: SceneDescription,
    settings: RenderSettings,
    textures: Textures | Callable[[], Textures] | None = None,
    known: dicing.DicedBefore | None = None,
    on_cage: dicing.OnCage | None = None,
) -> tuple[SceneDescription, dicing.Warnings]:
    """Return the description with subdivision cages diced to triangles, and warnings where they are coarser or sharper.

    `textures`: every TextureFile that could be read, or a function that reads them; those that displace cages are used.
    `known`: what was diced before.
    `on_cage` is called with the number of cages that have been diced, and of all.
    """
    try:
        displaced = displacements(description, {} if textures is None else textures)
        chosen = dicing.dicing_by_settings(settings)
        made, warnings = dicing.dice(compiled, description, chosen, threads(settings), displaced, known, on_cage)
        made, notes = dicing.dice_patches_of(dicing.dice_ribbons(made, chosen.pixels, known), chosen, known)
        return made, [*warnings, *notes]
    except compiled.CoreError as error:
        raise_primray_error(error)


def build(
    description: SceneDescription,
    textures: MutableTextures,
    settings: RenderSettings,
    shapes: list[Shape] | None = None,
    kept: KeptImages | None = None,
    *,
    has_record: bool = False,
    on_file: OnFile | None = None,
) -> CoreScene:
    """Return the core's scene with acceleration structures; `textures`: all images that could be read, emptied on the way.

    `shapes`, if given, replaces the description's shapes; it is emptied to save memory. `kept`: images of an earlier scene, of
    which `textures` may have the sizes alone. `has_record`: what rays hit is to be named although no AOV is requested.
    `on_file`: as in SurfaceUpload.add_images.
    """
    width = settings.filter_width if settings.filter_width is not None else DEFAULT_FILTER_WIDTH[settings.pixel_filter]
    record = SceneRecord() if description.aovs or has_record else None
    try:
        limit_hierarchies(settings)
        offsets = inverse_cdf(settings.pixel_filter, width)
        tiled = tiled_textures(settings)
        before = {} if tiled is None else tiled.facts()
        scene, uploaded = upload_scene(description, textures, width, offsets, shapes, record, kept, on_file, tiled)
    except compiled.CoreError as error:
        if error.args[0] == "out-of-memory" and settings.max_memory_bytes is not None:
            held = int(compiled.embree_memory()[1]) / process_memory.MIB
            allowed = settings.max_memory_bytes / process_memory.MIB
            sentence = f"acceleration structures need more than {held:.0f} MiB, which exceeds the limit of {allowed:.0f} MiB"
            raise LimitError(sentence, code=process_memory.CODE) from error
        raise_primray_error(error)
    finally:
        compiled.limit_embree_memory(2**62)
    made = core_scene(scene, uploaded, description, record)
    made.tiled, made.tiles_before = tiled, before
    return made


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
    made.is_deep = has_deep(d.aovs)
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
