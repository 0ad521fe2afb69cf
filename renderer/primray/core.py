"""The C++ core: which of its builds to use, a scene built in it, and a film of it. The only module that imports `_core_*`.

`PRIMRAY_ISA` (v2, v3, v4) and `PRIMRAY_LANES` (1, 4, 8, 16) override the choice by CPU.
"""

from __future__ import annotations

import hashlib
import importlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import numpy.typing as npt

from . import dice as dicing
from . import errors
from .color_space import REC709, ColorSpace
from .description import Floats, SceneDescription, Shape
from .installed_packages import library_of, version_of
from .pixel_filter import inverse_cdf
from .scene_record import InstanceNumbers, SceneRecord
from .scene_upload import upload
from .settings import DEFAULT_FILTER_WIDTH, RenderSettings
from .surface_upload import MutableTextures

# What each class needs, as the kernel names it (x86-64 psABI, section 3.1.1); newest first.
ISA_FLAGS = {
    "v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "v3": {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"},
    "v2": {"cx16", "lahf_lm", "popcnt", "sse4_1", "sse4_2", "ssse3"},
}
DEFAULT_LANES = {"v4": 16, "v3": 8, "v2": 4}
NO_DEPTH_LIMIT = 1 << 20
TILE = 16  # pixels across; kTile in film.hpp

Progress = Callable[[float], bool | None]  # fraction of the pass


def _cpu_flags() -> set[str]:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("flags"):
            return set(line.split(":", 1)[1].split())
    return set()


def runnable_isas() -> list[str]:
    """The ISA classes that this CPU runs, newest first."""
    flags, runnable = _cpu_flags(), list[str]()
    for name in reversed(ISA_FLAGS):  # each class has all of the older ones
        if not ISA_FLAGS[name] <= flags:
            break
        runnable.insert(0, name)
    return runnable


@cache
def isa() -> str:
    """The ISA class in use: the newest that the CPU has, unless PRIMRAY_ISA names one."""
    runnable = runnable_isas()
    wanted = os.environ.get("PRIMRAY_ISA")
    if wanted is None:
        if not runnable:
            raise errors.UnsupportedError("this CPU lacks SSE4.2 (x86-64-v2), the least that primray runs on", code="cpu")
        return runnable[0]
    if wanted not in ISA_FLAGS:
        raise errors.SettingsError(f"PRIMRAY_ISA is {wanted!r}; it may be v2, v3 or v4")
    if wanted not in runnable:
        raise errors.SettingsError(f"PRIMRAY_ISA={wanted}, but this CPU offers {', '.join(runnable)}")
    return wanted


@cache
def lanes() -> int:
    """Paths that go through the kernel at a time."""
    wanted = os.environ.get("PRIMRAY_LANES")
    if wanted is None:
        return DEFAULT_LANES[isa()]
    if not wanted.isdigit() or not module().has_lanes(int(wanted)):
        raise errors.SettingsError(
            f"PRIMRAY_LANES is {wanted!r}; the {isa()} build has 1, 4, 8 and 16 up to {module().MAX_LANES}"
        )
    return int(wanted)


def _embree_path() -> Path:
    found = library_of("embreex", "libembree4")
    if found is None:
        raise errors.InternalError("the embreex package carries no Embree library for this platform", code="embree")
    return found


@cache
def module() -> Any:
    """The extension module for `isa()`, with Embree loaded."""
    return load(isa())


def load(isa: str) -> Any:
    """The extension module for an ISA class, with Embree loaded."""
    name = f"primray._core_{isa}"
    try:
        core = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise errors.SettingsError(
            f"this build of primray has no {isa} core; in its source tree, `make cores` compiles all that this CPU runs"
        ) from error
    core.load_embree(str(_embree_path()))
    return core


@cache
def build_digest() -> str:
    """Of the module's file: two builds need not agree in every bit."""
    return hashlib.sha256(Path(str(module().__file__)).read_bytes()).hexdigest()[:16]


def versions() -> dict[str, str]:
    return {"embree": "4.4.0", "embreex": str(version_of("embreex"))}


class CoreScene:
    """A scene built in the core, ready to render."""

    def __init__(
        self,
        scene: Any,
        exposure_scale: float,
        warnings: list[tuple[str, str, str]],
        resolution: tuple[int, int],
        record: SceneRecord | None = None,
        rendering_space: ColorSpace = REC709,
    ) -> None:
        self._scene = scene
        self.record = record  # where AOVs are asked for
        self.resolution = resolution  # of the film
        self._exposure_scale = exposure_scale
        self.warnings = warnings  # code, prim path, message
        self.rendering_space = rendering_space
        self._guides: dict[tuple[int, Splits], Any] = {}
        self._caustics: dict[int, Any] = {}

    def guide(self, settings: RenderSettings, splits: Splits) -> Any:
        """Where light comes from, learnt once from paths of their own; None where that would not pay, and for a quick look."""
        if settings.is_quick_look:
            return None
        depth = max_depth(settings)
        if (depth, splits) not in self._guides:
            self._guides[depth, splits] = module().learn_guide(
                self._scene, depth, splits.paths, lanes(), self.caustics(settings), splits.lights
            )
        return self._guides[depth, splits]

    def caustics(self, settings: RenderSettings) -> Any:
        """Where small lights shine after metal and glass, found once by photons; None where there is nothing to speak of, where
        it would not pay, and for a quick look."""
        if settings.is_quick_look:
            return None
        depth = max_depth(settings)
        if depth not in self._caustics:
            self._caustics[depth] = module().learn_caustics(self._scene, depth, threads(settings), lanes())
        return self._caustics[depth]

    @property
    def memory_bytes(self) -> int:
        """Bytes of the core's arrays, of Embree's acceleration structures, and of guides."""
        guides = [guide for guide in (*self._caustics.values(), *self._guides.values()) if guide is not None]
        own = int(self._scene.memory_bytes) + int(module().embree_memory()[0])
        return own + sum(int(guide.memory_bytes) for guide in guides)

    @property
    def exposure_scale(self) -> float:
        return self._exposure_scale

    @property
    def instance_numbers(self) -> InstanceNumbers:
        assert self.record is not None
        group, first, parent, total = self._scene.placements
        return InstanceNumbers(self.record, group, first, parent, int(total))

    @property
    def features(self) -> list[dict[str, str]]:
        """What is modelled beyond opaque faceted Lambert triangles, and why; guides once they have been learnt."""
        s = self._scene
        guides = [guide for guide in self._guides.values() if guide is not None]
        regions = max((guide.regions for guide in guides), default=0)
        photons = max((guide.photons for guide in self._caustics.values() if guide is not None), default=0)
        if any(guide.alone for guide in guides):
            photons = 0
        rows = [
            (s.has_instances, "instances", "prototypes are placed more than once"),
            (s.has_spheres, "exact spheres", "the scene has Sphere prims"),
            (s.has_attributes, "vertex attributes", "meshes have normals or varying displayColor"),
            (s.textures > 0, f"textures ({s.texture_bytes / 2**20:.1f} MiB)", "surfaces' inputs are connected to images"),
            (s.has_inputs, "varying inputs", "a surface's inputs are connected to textures or primvars"),
            (s.has_cutouts, "cut-outs", "a surface has an opacityThreshold and an opacity that varies"),
            (s.has_emission, "surface emission", "a surface has emissiveColor"),
            (s.emitters > 0, "emitting geometry sampled as lights", f"{s.emitters} shapes emit"),
            (s.has_thin, "see-through shadows", "a surface lets light straight through"),
            (s.has_lens, "thin lens", "the camera has an fStop and a focus distance"),
            (s.has_clipping_planes, "clipping planes", "the camera has clippingPlanes"),
            (s.has_shutter, "ray times", "the camera's shutter is open for a while"),
            (s.domes > 0, "dome", "the scene has a DomeLight"),
            (s.has_lobe_factors, "lobe factors", "a light's diffuse or specular multiplier is not 1"),
            (photons > 0, f"caustics guided by {photons} photons", "small lights shine on metal or glass"),
            (regions > 0, f"indirect light guided in {regions} regions", "most of the noise is of light from other surfaces"),
            (s.sampled_lights > 0, f"light sampling ({s.sampled_lights})", "lights that are sampled at every vertex"),
        ]
        return [{"name": name, "why": why} for on, name, why in rows if on]


class Film:
    """What a scene's render has gathered so far; arrays are of shape (H, W, ...), R = 2 replicates."""

    def __init__(self, scene: CoreScene, state: Mapping[str, npt.NDArray[Any]] | None = None) -> None:
        width, height = scene.resolution
        self._film = module().Film(width, height) if state is None else module().Film.from_state(width, height, dict(state))
        self._exposure_scale = scene._exposure_scale
        self._image: tuple[int, tuple[Floats, Floats]] | None = None

    def image(self) -> tuple[Floats, Floats]:
        """Mean R, G, B, coverage (H, W, 4) and the standard errors of R, G, B (H, W, 3); inf where there is no estimate."""
        if self._image is None or self._image[0] != self.samples:
            self._image = (self.samples, self._film.image(self._exposure_scale))
        return self._image[1]

    @property
    def pixels(self) -> Floats:
        return self.image()[0]

    @property
    def replicates(self) -> npt.NDArray[np.float64]:
        """Sums (R, H, W, 4) of each independent replicate, before exposure."""
        sums: npt.NDArray[np.float64] = self._film.replicates
        return sums

    @property
    def counts(self) -> npt.NDArray[np.uint32]:
        """Samples (R, H, W) in each sum."""
        counts: npt.NDArray[np.uint32] = self._film.counts
        return counts

    @property
    def samples_per_pixel(self) -> tuple[int, int]:
        total = self.counts.sum(axis=0)
        return int(total.min()), int(total.max())

    @property
    def samples(self) -> int:
        return int(self._film.samples)

    @property
    def invalid_samples(self) -> int:
        return int(self._film.invalid_samples)

    @property
    def rays_by_kind(self) -> dict[str, int]:
        film = self._film
        return {"camera": film.camera_rays, "scattered": film.scattered_rays, "shadow": film.shadow_rays}

    @property
    def rays(self) -> int:
        return sum(self.rays_by_kind.values())

    @property
    def resolution(self) -> tuple[int, int]:
        return int(self._film.width), int(self._film.height)

    @property
    def tiles(self) -> tuple[int, int]:
        """Tiles across and down."""
        return int(self._film.tiles_x), int(self._film.tiles_y)

    @property
    def next(self) -> npt.NDArray[np.uint32]:
        """(R, tiles): the number of each tile's next sample, rows of tiles from the top."""
        numbers: npt.NDArray[np.uint32] = self._film.next
        return numbers

    @property
    def tile_rays(self) -> npt.NDArray[np.int64]:
        rays: npt.NDArray[np.int64] = self._film.tile_rays
        return rays

    def start_at(self, number: int) -> None:
        """Begin the sequences with another sample than the first."""
        self._film.start_at(number)

    def merge(self, other: Film) -> None:
        """Add what another film gathered from other samples: the same bits as one film that took them all."""
        try:
            self._film.merge(other._film)
        except module().CoreError as error:
            _raise(error)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """All of it as arrays, for `Film(scene, state)`."""
        state: dict[str, npt.NDArray[Any]] = self._film.state()
        return state

    def error_sums(self, most_pixels: int, threads: int) -> dict[str, Any]:
        """Sums behind the error's estimates; see film/frame_error.hpp, and error.py for what is made of them."""
        sums: dict[str, Any] = self._film.error(self._exposure_scale, most_pixels, threads)
        return sums


def _raise(error: Exception) -> NoReturn:
    code, message = error.args
    if code in ("out-of-memory", "too-large"):
        raise errors.LimitError(message, code=code) from error
    if code == "settings-error":
        raise errors.SettingsError(message) from error
    raise errors.InternalError(message, code=code) from error


def dice(description: SceneDescription, settings: RenderSettings) -> tuple[SceneDescription, dicing.Warnings]:
    """The description with triangles for subdivision cages, and what is coarser or sharper than the stage says."""
    try:
        return dicing.dice(module(), description, dicing.dicing_of(settings), threads(settings))
    except module().CoreError as error:
        _raise(error)


def build(
    description: SceneDescription, textures: MutableTextures, settings: RenderSettings, shapes: list[Shape] | None = None
) -> CoreScene:
    """The core's scene, accelerated; `textures`: the images of every TextureFile that could be read, taken out of it.

    `shapes`, where given, are used in place of the description's and let go on the way: the list is empty afterwards.
    """
    width = settings.filter_width if settings.filter_width is not None else DEFAULT_FILTER_WIDTH[settings.filter]
    record = SceneRecord() if description.aovs else None
    try:
        scene, warnings = upload(module(), description, textures, width, inverse_cdf(settings.filter, width), shapes, record)
    except module().CoreError as error:
        _raise(error)
    d = description
    return CoreScene(scene, d.camera.exposure_scale, warnings, d.frame.size, record, d.rendering_space)


def threads(settings: RenderSettings) -> int:
    return settings.threads or len(os.sched_getaffinity(0))


def max_depth(settings: RenderSettings) -> int:
    return NO_DEPTH_LIMIT if settings.max_depth is None else settings.max_depth


BAND = 4 * TILE  # rows between which signals are looked after


def first_hits(
    scene: CoreScene, planes: Sequence[str], primvars: Sequence[tuple[int, int, int]], settings: RenderSettings
) -> dict[str, Any]:
    """Arrays (H, W, C) of what is seen first, by the core's names of planes, and a list of the primvars' (its number, that of
    its wide twin, and its width); bindings/first_hit_bindings.cpp."""
    try:
        hits = module().FirstHits(scene._scene, list(planes), list(primvars))
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except module().CoreError as error:
        _raise(error)
    found: dict[str, Any] = hits.take()
    return found


@dataclass(frozen=True)
class Pass:
    """What a pass of rendering did."""

    interrupted: bool
    seconds: float
    busy_lanes: int
    shaded_lanes: int


class Splits(NamedTuple):
    """Paths that go on from the first surface, and samples of lights that are taken there."""

    paths: int = 1
    lights: int = 1


def choose_splits(scene: CoreScene, settings: RenderSettings) -> Splits:
    """What a pilot finds best; a function of scene and depth alone, but for a quick look."""
    if settings.is_quick_look:
        return Splits()
    try:
        return Splits(*module().choose_splits(scene._scene, max_depth(settings), lanes(), scene.caustics(settings)))
    except module().CoreError as error:
        _raise(error)


def render_pass(
    scene: CoreScene,
    film: Film,
    ends: npt.NDArray[np.uint32],
    splits: Splits,
    settings: RenderSettings,
    progress: Progress | None = None,
) -> Pass:
    """Take every tile's sequences (R, tiles) to `ends`, or until `progress` answers False or Ctrl-C comes.

    The film is valid then, and another pass goes on from there to the same bits.
    """
    guide, caustics = scene.guide(settings, splits), scene.caustics(settings)
    if guide is not None and guide.alone:
        caustics = None
    try:
        done = module().render_pass(
            scene._scene,
            film._film,
            np.ascontiguousarray(ends, np.uint32),
            max_depth(settings),
            splits.paths,
            threads(settings),
            settings.seed,
            lanes(),
            progress,
            guide,
            caustics,
            settings.screen_block,
            splits.lights,
        )
    except module().CoreError as error:
        _raise(error)
    return Pass(bool(done.interrupted), float(done.seconds), int(done.busy_lanes), int(done.shaded_lanes))


def samples_of_replicates(samples: int) -> tuple[int, int]:
    """How many of a pixel's first `samples` fall to each replicate: they take turns."""
    return (samples + 1) // 2, samples // 2


def uniform_ends(film: Film, samples: int) -> npt.NDArray[np.uint32]:
    """`ends` of a pass that gives every pixel its first `samples`."""
    return np.repeat(np.array(samples_of_replicates(samples), np.uint32)[:, None], film.next.shape[1], axis=1)


def render(scene: CoreScene, settings: RenderSettings, progress: Progress | None = None) -> Film:
    """One uniform pass of `settings.spp` samples, without looking at the error on the way."""
    film = Film(scene)
    splits = choose_splits(scene, settings)
    render_pass(scene, film, uniform_ends(film, settings.most_samples), splits, settings, progress)
    return film


class Recording:
    """Every ray of a one-threaded render in order, to trace again through Embree alone (for the benchmark; takes memory)."""

    def __init__(self, scene: CoreScene, settings: RenderSettings) -> None:
        self._recording = module().Recording(scene._scene, settings.most_samples, max_depth(settings), settings.seed, lanes())

    def replay_s(self) -> float:
        """Seconds of one thread to trace them, each as packet or single ray as the render did."""
        return float(self._recording.replay_seconds())
