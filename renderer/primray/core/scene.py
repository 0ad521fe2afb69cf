"""A scene built in the core, with the splitting factors and path guides that were learnt for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ..color.color_space import REC709, ColorSpace
from ..description.placement import Box
from ..settings import RenderSettings
from . import compiled
from .inputs import integrator_settings
from .light_path_tables import LightPathTables, automaton_without_caustics
from .light_upload import LightGroups
from .native import lanes, max_depth, raise_primray_error, threads
from .scene_record import InstanceNumbers, SceneRecord

if TYPE_CHECKING:
    from .scene_upload import UploadRecord

LARGEST_CLAMP = 3e38  # the core's clamp must be finite


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
        self._without_caustics: compiled.LpeAutomaton | None = None  # for renders without caustics
        self.uploaded: UploadRecord | None = None
        # Caches by path depth and whether caustics are rendered.
        self._guides: dict[tuple[int, bool, Splits], compiled.Guide | None] = {}
        self._caustics: dict[int, compiled.CausticGuide | None] = {}
        self._splits: dict[tuple[int, bool], Splits] = {}

    @property
    def _scene(self) -> compiled.Scene:
        assert self._built is not None
        return self._built

    def splits(self, settings: RenderSettings) -> Splits:
        """Return the splitting factors that a pilot finds best, measured once for each depth and caustics setting.

        A quick look has no pilot and no splitting.
        """
        if settings.is_quick_look:
            return Splits()
        depth = max_depth(settings), settings.caustics
        if depth not in self._splits:
            pilot = integrator_settings(settings, caustics=self.caustics(settings))
            try:
                self._splits[depth] = Splits(*compiled.choose_splits(self._scene, pilot, lanes()))
            except compiled.CoreError as error:
                raise_primray_error(error)
        return self._splits[depth]

    def guide(self, settings: RenderSettings, splits: Splits) -> compiled.Guide | None:
        """Return the path guide, learnt once from training paths; None where guiding would not pay off, and for a quick
        look."""
        if settings.is_quick_look:
            return None
        depth = max_depth(settings), settings.caustics
        if (*depth, splits) not in self._guides:
            asked = integrator_settings(
                settings, splits=splits.paths, light_samples=splits.lights, caustics=self.caustics(settings)
            )
            self._guides[*depth, splits] = compiled.learn_guide(self._scene, asked, lanes())
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
            self._caustics[depth] = compiled.learn_caustics(self._scene, depth, threads(settings), lanes())
        return self._caustics[depth]

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
    def exposure_scale(self) -> float:
        return self._exposure_scale

    @property
    def instance_numbers(self) -> InstanceNumbers:
        assert self.record is not None
        group, first, parent, total = self._scene.placements
        return InstanceNumbers(self.record, group, first, parent, total)

    @property
    def features(self) -> list[dict[str, str]]:
        """Features beyond opaque faceted Lambert triangles that are enabled, and why; guides once they are learnt."""
        s = self._scene
        guides = [guide for guide in self._guides.values() if guide is not None]
        regions = max((guide.regions for guide in guides), default=0)
        photons = max((guide.photons for guide in self._caustics.values() if guide is not None), default=0)
        if any(guide.alone for guide in guides):
            photons = 0
        rows = [
            (s.has_instances, "instances", "prototypes are placed more than once"),
            (s.has_curves, "curves", "the scene has curves"),
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
            (s.has_moving_points, "moving vertices", "meshes deform while the shutter is open"),
            (s.has_moving_lights, "moving lights", "lights move while the shutter is open"),
            (s.domes > 0, "dome", "the scene has a DomeLight"),
            (s.has_lobe_factors, "lobe factors", "a light's diffuse or specular multiplier is not 1"),
            (photons > 0, f"caustics guided by {photons} photons", "small lights shine on metal or glass"),
            (regions > 0, f"indirect light guided in {regions} regions", "most of the noise comes from indirect light"),
            (s.sampled_lights > 0, f"light sampling ({s.sampled_lights})", "lights that are sampled at every vertex"),
        ]
        return [{"name": name, "why": why} for on, name, why in rows if on]
