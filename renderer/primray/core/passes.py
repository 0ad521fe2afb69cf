"""Render passes, each of which adds samples of a scene to a film, and first-hit passes for AOVs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..settings import MAX_SPP, RenderSettings
from . import compiled
from .film import TILE, Film, uniform_ends
from .inputs import integrator_settings
from .native import lanes, raise_primray_error, threads
from .scene import CoreScene, Splits

Progress = Callable[[float], bool | None]  # called with the fraction of the pass that is done

# In the number of a path that takes the less likely way at smooth glass, beside the one that takes the other (log_pixel).
ASIDE = 1 << 31


@dataclass(frozen=True)
class Pass:
    """Result of a render pass."""

    interrupted: bool
    seconds: float
    busy_lanes: int
    shaded_lanes: int


def choose_splits(scene: CoreScene, settings: RenderSettings) -> Splits:
    """Return `CoreScene.splits`."""
    return scene.splits(settings)


def render_pass(
    scene: CoreScene,
    film: Film,
    ends: npt.NDArray[np.uint32],
    splits: Splits,
    settings: RenderSettings,
    progress: Progress | None = None,
) -> Pass:
    """Render until every tile's sequences (R, tiles) are at `ends`, or until `progress` returns False or Ctrl-C is pressed.

    The film is valid then, and another pass continues from there to the same bits.
    """
    asked = _pass_settings(scene, settings, splits)
    to = np.ascontiguousarray(ends, np.uint32)
    try:
        done = compiled.render_pass(scene._scene, film._film, to, asked, lanes=lanes(), progress=progress)
    except compiled.CoreError as error:
        raise_primray_error(error)
    _check_textures(scene)
    return Pass(done.interrupted, done.seconds, done.busy_lanes, done.shaded_lanes)


def _check_textures(scene: CoreScene) -> None:
    if scene.tiled is not None:
        scene.tiled.check()


def _pass_settings(scene: CoreScene, settings: RenderSettings, splits: Splits) -> compiled.IntegratorSettings:
    """Return the core's IntegratorSettings of a pass."""
    guide, caustics = scene.guide(settings, splits), scene.caustics(settings)
    if guide is not None and guide.alone:
        caustics = None
    return integrator_settings(
        settings,
        threads=threads(settings),
        seed=settings.seed,
        splits=splits.paths,
        light_samples=splits.lights,
        screen_block=settings.screen_block,
        guide=guide,
        caustics=caustics,
        lpe=scene.lpe_automaton(settings),
        **({} if settings.clamp_indirect is None else {"clamp_indirect": scene.clamp_of(settings.clamp_indirect)}),
    )


def log_pixel(
    scene: CoreScene,
    x: int,
    y: int,
    spans: Sequence[tuple[int, int]],
    splits: Splits,
    settings: RenderSettings,
    brightest: int = MAX_SPP,
) -> list[dict[str, Any]]:
    """Return the events of samples of the pixel at (x, y) of the frame (integrator/path_log.hpp).

    `spans`: of each replicate, the first index and the one after the last. Samples beyond the `brightest` have only their
    first and their last event.
    """
    first, end = ((spans[0][k], spans[1][k]) for k in (0, 1))
    try:
        return compiled.log_pixel(
            scene._scene, _pass_settings(scene, settings, splits), x=x, y=y, first=first, end=end, brightest=brightest
        )
    except compiled.CoreError as error:
        raise_primray_error(error)


def render(scene: CoreScene, settings: RenderSettings, progress: Progress | None = None) -> Film:
    """Return a film of one uniform pass of `settings.spp` samples, without measuring the error."""
    film = Film(scene, settings=settings)
    splits = choose_splits(scene, settings)
    render_pass(scene, film, uniform_ends(film, settings.most_samples), splits, settings, progress)
    return film


class Recording:
    """All rays of a single-threaded render, in order, for tracing again with Embree alone (for the benchmark; takes memory)."""

    def __init__(self, scene: CoreScene, settings: RenderSettings) -> None:
        asked = integrator_settings(settings, seed=settings.seed)
        self._recording = compiled.Recording(scene._scene, settings.most_samples, asked, lanes())

    def replay_s(self) -> float:
        """Return the seconds that one thread takes to trace the rays, as packets or single rays as in the render."""
        return self._recording.replay_seconds()


@dataclass(frozen=True)
class FirstHits:
    """Arrays (H, W, C) of first hits: the core's planes by name (aov/first_hit.hpp), and primvars in the order requested."""

    planes: dict[str, npt.NDArray[Any]]
    primvars: list[Floats]


@dataclass(frozen=True)
class FilmSamples:
    """Ranges of the samples that a film has taken, and how they were drawn."""

    first: npt.NDArray[np.uint32]  # (R, tiles)
    end: npt.NDArray[np.uint32]
    seed: int
    screen_block: int
    is_split: bool  # several paths continue from the first hit


BAND = 4 * TILE  # rows rendered between two checks for signals


def first_hits(
    scene: CoreScene,
    planes: Sequence[str],
    primvars: Sequence[tuple[int, int, int]],
    settings: RenderSettings,
    replicate: int = 0,
    occlusion_distance: float = 0.0,
) -> FirstHits:
    """Return what the camera sees first in each pixel.

    `planes`: the core's names; `primvars`: the number of each, that of its wide twin, and its width; `replicate`: which
    independent set of samples filtered planes average over; `occlusion_distance`: in scene units, for the plane of that name.
    """
    try:
        hits = compiled.FirstHits(
            scene._scene, list(planes), list(primvars), replicate=replicate, occlusion_distance=occlusion_distance
        )
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except compiled.CoreError as error:
        raise_primray_error(error)
    _check_textures(scene)
    return FirstHits(hits.take(), hits.take_primvars())


@dataclass(frozen=True)
class PickedPoint:
    """What the ray through the centre of one pixel hits: the point (3,) in the world, its distance, path and instance."""

    position: Doubles
    distance: float  # scene units
    prim: str  # path of the shape, of a prototype's in it
    instance: str  # name; "": none
    material: str  # path, in a prototype likewise; "": none


def pick(scene: CoreScene, x: int, y: int, settings: RenderSettings) -> PickedPoint | None:
    """Return what is seen in one pixel of a scene that has a record, x to the right and y down; None if that is no surface."""
    record = scene.record
    assert record is not None
    hits = compiled.FirstHits(scene._scene, ["position", "distance", "prim", "material", "instance", "outer"], [])
    hits.fill(lanes(), 1, y, y + 1)
    planes = {name: plane[y, x] for name, plane in hits.take().items()}
    row = int(planes["prim"][0])
    if row == -1:
        return None
    prim, instance = scene.name_of_part(row, int(planes["instance"][0]), int(planes["outer"][0]))
    surface = int(planes["material"][0])
    return PickedPoint(
        planes["position"].astype(np.float64),
        float(planes["distance"][0]),
        prim,
        instance,
        record.surface_paths[surface] if surface >= 0 else "",
    )


@dataclass(frozen=True)
class Layers:
    """Surfaces along rays: the number (N) of each ray's, and of all of them, in order, what they are and how far away.

    `what` (M, 3): shape, instance and outer instance as `first_hits` numbers them; `lengths` (M, 2): depth along the camera's
    axis and distance along the ray.
    """

    count: npt.NDArray[np.uint32]
    what: npt.NDArray[np.int32]
    lengths: Floats


def layers(scene: CoreScene, positions: npt.ArrayLike, settings: RenderSettings, *, first_only: bool = False) -> Layers:
    """Return all that rays through points (N, 2) of the film pass, each surface once; points are pixels of the frame.

    Points are seen at the frame's time, with a rolling shutter in the middle of their row's and column's exposure.
    """
    points = np.ascontiguousarray(positions, np.float32).reshape(-1, 2)
    try:
        count, what, lengths = compiled.layers(
            scene._scene, points, first_only=first_only, lanes=lanes(), threads=threads(settings)
        )
    except compiled.CoreError as error:
        raise_primray_error(error)
    _check_textures(scene)
    return Layers(count, what, lengths)


def numbered_layers(
    scene: CoreScene, positions: npt.ArrayLike, settings: RenderSettings, *, first_only: bool = False
) -> compiled.NumberedLayers:
    """Return what `layers` finds, with its parts numbered, to be counted once the things that they belong to are known."""
    points = np.ascontiguousarray(positions, np.float32).reshape(-1, 2)
    try:
        found = compiled.numbered_layers(scene._scene, points, first_only=first_only, lanes=lanes(), threads=threads(settings))
    except compiled.CoreError as error:
        raise_primray_error(error)
    _check_textures(scene)
    return found


@dataclass(frozen=True)
class Returns:
    """What rays get back (core/aov/returns.hpp): the number (N) of each ray's returns, and all of them, in order along rays.

    `what` (M, 4): shape, instance and outer instance as `first_hits` numbers them, and surface; `distance` (M): optical, in
    scene units; `strength` and `cosine` (M): both 1 of a white Lambertian surface that faces the ray.
    """

    count: npt.NDArray[np.uint32]
    what: npt.NDArray[np.int32]
    distance: Doubles
    strength: Floats
    cosine: Floats


def returns(
    scene: CoreScene,
    rays: tuple[Doubles, Doubles, Floats],
    reach: tuple[float, float],
    weights: tuple[float, float, float],
    least_alpha: float,
    settings: RenderSettings,
) -> Returns:
    """Return what comes back along rays: origins (N, 3) and unit directions (N, 3) in the world, and times in the span (N).

    Rays begin and end at distances `reach`, in scene units; `weights` are of R, G and B, `least_alpha` is that of reflections.
    """
    origins, directions, times = rays
    try:
        count, what, distance, strength = compiled.returns(
            scene._scene,
            origins=np.ascontiguousarray(origins, np.float64),
            directions=np.ascontiguousarray(directions, np.float64),
            times=np.ascontiguousarray(times, np.float32),
            reach=reach,
            weights=weights,
            least_alpha=least_alpha,
            least_strength=0.0,
            lanes=lanes(),
            threads=threads(settings),
        )
    except compiled.CoreError as error:
        raise_primray_error(error)
    _check_textures(scene)
    return Returns(count, what, distance, strength[:, 0], strength[:, 1])


@dataclass(frozen=True)
class Extents:
    """Bounds of parts: (N, 4) on the film in pixels of the frame, (N) nearest depth, (N, 2, 3) in axes of their own.

    What there is nothing of has infinite bounds of the wrong sign.
    """

    film: Doubles
    nearest: Doubles
    corners: Doubles
    unseen: npt.NDArray[np.int64]  # (N) points that the camera sees in no direction


def extents(scene: CoreScene, parts: npt.ArrayLike, axes: npt.ArrayLike, settings: RenderSettings) -> Extents:
    """Return the bounds of `parts` (N, 4): shape, instance, outer instance, and the place of its axes in `axes` (B, 3, 4).

    Axes are matrices from the world. Parts are where they are at the frame's time; on the film, with a rolling shutter, at the
    time of the row and column in which each point is seen.
    """
    asked, of = np.ascontiguousarray(parts, np.int32), np.ascontiguousarray(axes, np.float64)
    film, nearest, corners, unseen = compiled.extents(scene._scene, asked, of, threads=threads(settings))
    return Extents(film, nearest, corners, unseen)


def surface_of_part(scene: CoreScene, part: Sequence[int]) -> tuple[Doubles, npt.NDArray[np.uint32]]:
    """Return points (N, 3) in the world and triangles (M, 3) of a part, given by shape, instance and outer instance.

    They are those of the frame's time. Spheres are grids of points on them, curves tubes of 8 sides.
    """
    shape, instance, outer = part
    return compiled.surface_of_part(scene._scene, shape, instance, outer)


def parts_of_groups(scene: CoreScene) -> npt.NDArray[np.int32]:
    """Return group and shape (K, 2) of everything in the core's groups; group 0 is in the world itself."""
    return compiled.parts_of_groups(scene._scene)


def project(scene: CoreScene, points: npt.ArrayLike) -> Doubles:
    """Return x and y in pixels of the frame, NaN where they are not seen, and depth (N, 3) of points (N, 3) of the world."""
    return compiled.project(scene._scene, np.ascontiguousarray(points, np.float64).reshape(-1, 3))


def coverage(
    scene: CoreScene, samples: FilmSamples, settings: RenderSettings
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Return which surfaces cover each pixel, and how much.

    Number of surfaces (H, W); for all of them, pixel by pixel, (N, 4) shape, surface, instance and outer instance as
    `first_hits` numbers them; and the samples covered by each (N), as integers.
    """
    try:
        hits = compiled.FirstHits(scene._scene, [], [])
        link = int(samples.is_split)
        first, end = (np.ascontiguousarray(numbers, np.uint32) for numbers in (samples.first, samples.end))
        hits.want_coverage(samples.seed, samples.screen_block, link, first, end)
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except compiled.CoreError as error:
        raise_primray_error(error)
    return hits.take_coverage()
