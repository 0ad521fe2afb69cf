"""Scenes for the core's tests, described directly in Python, and the core's modules to try them on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any
from unittest import mock

import numpy as np
import numpy.typing as npt
import pytest

from primray import core, errors
from primray.core import compiled
from primray.core.inputs import filled
from primray.core.scene import inverse_cdf
from primray.core.scene_upload import upload
from primray.core.surface_upload import Textures
from primray.description import (
    Camera,
    Doubles,
    Floats,
    Light,
    LightType,
    MatrixInstances,
    Mesh,
    Placed,
    Placement,
    Primvar,
    Projection,
    Prototype,
    SceneDescription,
    Shape,
    Surface,
    TextureFile,
    VolumeEmission,
    VolumeMedium,
    Wrap,
)
from primray.settings import DEFAULT_FILTER_WIDTH, Filter
from primray.textures.texture import Texture

DOME = TextureFile("dome", "raw")

ISAS = tuple(reversed(core.runnable_isas()))


@cache
def core_module(isa: str | None = None) -> Any:
    """One build of the core with Embree loaded: the default one, or that of an ISA class."""
    if isa is None:
        return core.module()
    try:
        return core.load(isa)
    except errors.SettingsError as error:
        pytest.skip(f"skipped: {error.message}")


@contextmanager
def core_in_use(module: Any) -> Iterator[None]:
    """`primray.core.compiled` is another module meanwhile."""
    with mock.patch.object(compiled, "module", return_value=module):
        yield


def asked(**values: Any) -> Any:
    """IntegratorSettings with these fields, for the module's own functions."""
    return filled(core.module().IntegratorSettings(), **values)


def kernels(isa: str | None = None) -> Any:
    """The array versions of what the kernels call."""
    return core_module(isa).testing


def translation(x: float, y: float, z: float) -> Doubles:
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def scaling(x: float, y: float, z: float) -> Doubles:
    return np.diag([x, y, z, 1.0])


def rotation(axis: Sequence[float] | Doubles, angle_deg: float) -> Doubles:
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(angle_deg)
    m = np.eye(4)
    m[:3, :3] += np.sin(a) * k + (1 - np.cos(a)) * (k @ k)
    return m


def look_at(eye: Sequence[float] | Doubles, target: Sequence[float] | Doubles, up: Sequence[float] = (0, 1, 0)) -> Doubles:
    """A camera's matrix: -z towards the target."""
    z = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    m[:3, 3] = eye
    return m


def perspective(world_from_camera: Doubles, half: float, aspect: float = 1.0, **changes: Any) -> Camera:
    """`half`: tangent of half the vertical field of view."""
    window = (-half * aspect, half * aspect, -half, half)
    return replace(Camera("/camera", world_from_camera, Projection.PERSPECTIVE, window, (1e-3, 1e6)), **changes)


def orthographic(world_from_camera: Doubles, half: float, aspect: float = 1.0, **changes: Any) -> Camera:
    return replace(perspective(world_from_camera, half, aspect), projection=Projection.ORTHOGRAPHIC, **changes)


def lambert(albedo: float | tuple[float, float, float], emission: float = 0.0) -> Surface:
    color = albedo if isinstance(albedo, tuple) else (albedo,) * 3
    return Surface("", lambert=True, diffuse_color=color, emissive_color=(emission,) * 3)


def mesh(points: npt.ArrayLike, triangles: npt.ArrayLike, surface: int = 0, normals: Any = None, colors: Any = None) -> Mesh:
    def floats(values: Any) -> Floats | None:
        return None if values is None else np.asarray(values, np.float32)

    return Mesh(
        "/mesh", np.asarray(points, np.float32), np.asarray(triangles, np.int32), floats(normals), floats(colors), surface
    )


def quad(corners: npt.ArrayLike, surface: int = 0) -> Mesh:
    """Four corners, counter-clockwise seen from outside."""
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], surface)


def ground(size: float = 1.0, surface: int = 0) -> Mesh:
    """A square of half-width `size` in the plane y = 0, facing +y."""
    s = size
    return quad([[-s, 0, s], [s, 0, s], [s, 0, -s], [-s, 0, -s]], surface)


def box(size: Sequence[float] | Doubles, surface: int = 0) -> Mesh:
    """A box about the origin with these edges, facing outwards."""
    x, y, z = np.asarray(size) / 2
    points = [[sx * x, sy * y, sz * z] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return mesh(points, [t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])], surface)


def light(
    kind: LightType, world_from_light: Doubles | None = None, emission: float | tuple[float, float, float] = 1.0, **more: Any
) -> Light:
    color = emission if isinstance(emission, tuple) else (emission,) * 3
    return Light(f"/{kind.value}", kind, np.eye(4) if world_from_light is None else world_from_light, color, **more)


@dataclass(frozen=True)
class Described:
    """A description with its textures."""

    description: SceneDescription
    textures: Textures

    def build(self, isa: str | None = None, filter: Filter = Filter.BOX, filter_width: float | None = None) -> Any:
        """The core's scene in the module for `isa`."""
        width = DEFAULT_FILTER_WIDTH[filter] if filter_width is None else filter_width
        taken = {file: list(tiles) for file, tiles in self.textures.items()}
        with core_in_use(core_module(isa)):
            scene, warnings, _ = upload(self.description, taken, width, inverse_cdf(filter, width))
        assert warnings == []
        return scene

    def moved(self, matrix: Doubles) -> Described:
        """The same scene elsewhere in the world."""
        d = self.description
        return replace(
            self,
            description=replace(
                d,
                static=tuple(replace(p, matrix=matrix @ p.matrix) for p in d.static),
                placements=tuple(replace(p, levels=(p.levels[0].placed(matrix[:3]), *p.levels[1:])) for p in d.placements),
                lights=tuple(replace(x, world_from_light=matrix @ x.world_from_light) for x in d.lights),
                media=tuple(replace(x, matrices=matrix @ x.matrices) for x in d.media),
                volume_emissions=tuple(replace(x, matrices=matrix @ x.matrices) for x in d.volume_emissions),
                camera=replace(d.camera, world_from_camera=matrix @ d.camera.world_from_camera),
            ),
        )


def placement(prototype: int, matrices: Sequence[Doubles] | Doubles, primvars: Sequence[Primvar] = ()) -> Placement:
    """One level of instances, by their matrices (3, 4) or (4, 4)."""
    return Placement(prototype, (MatrixInstances(np.array([m[:3] for m in matrices])),), tuple(primvars))


def world_from_prototype(placement: Placement) -> Doubles:
    """(K, 3, 4): all at once."""
    return np.concatenate([*placement.chunks(), np.zeros((0, 3, 4))])


def describe(
    shapes: Sequence[tuple[Shape, Doubles]] = (),
    surfaces: Sequence[Surface] = (),
    lights: Sequence[Light] = (),
    camera: Camera | None = None,
    resolution: tuple[int, int] = (8, 8),
    prototypes: Sequence[Prototype] = (),
    prototype_shapes: Sequence[Shape] = (),
    placements: Sequence[Placement] = (),
    dome_texture: npt.ArrayLike | None = None,
    textures: Textures | None = None,
    media: Sequence[VolumeMedium] = (),
    volume_emissions: Sequence[VolumeEmission] = (),
) -> Described:
    """Shapes with their matrices; prototypes count `prototype_shapes` from len(shapes)."""
    if dome_texture is not None:
        lights = [replace(x, texture=DOME) if x.type is LightType.DOME else x for x in lights]
    description = SceneDescription(
        (*(s for s, _ in shapes), *prototype_shapes), tuple(surfaces), tuple(Placed(i, m) for i, (_, m) in enumerate(shapes)),
        tuple(prototypes), tuple(placements), tuple(lights), camera or perspective(np.eye(4), 1.0), resolution, "Y", 1.0, None,
        media=tuple(media), volume_emissions=tuple(volume_emissions),
    )  # fmt: skip
    images = dict(textures or {})
    if dome_texture is not None:
        images[DOME] = image(dome_texture)
    return Described(description, images)


def image(pixels: npt.ArrayLike, wrap_s: Wrap = Wrap.BLACK, wrap_t: Wrap = Wrap.BLACK) -> list[tuple[int, Texture]]:
    """Pixels (H, W, C) or (H, W), first row at the top, as the one image of a TextureFile."""
    p = np.asarray(pixels, np.float32)
    return [(0, Texture(p if p.ndim == 3 else p[:, :, None], wrap_s=wrap_s, wrap_t=wrap_t))]


def render(
    scene: Any,
    spp: int,
    *,
    isa: str | None = None,
    max_depth: int = core.NO_DEPTH_LIMIT,
    threads: int = 1,
    seed: int = 0,
    lanes: int = 0,
    progress: Any = None,
    splits: int = 0,
    light_samples: int = 1,
    film: Any = None,
    caustics: Any = None,
) -> Rendered:
    """A pass that takes every pixel's samples to `spp`, in a new film or on from where `film` stands; `splits` 0: by pilots."""
    module = core_module(isa)
    lanes = lanes or module.MAX_LANES
    width, height = scene.resolution
    film = film or module.Film(width, height)
    ends = np.repeat(np.array(core.samples_of_replicates(spp), np.uint32)[:, None], film.next.shape[1], axis=1)
    settings = filled(module.IntegratorSettings(), max_depth=max_depth, caustics=caustics)
    if not splits:
        splits, light_samples = module.choose_splits(scene, settings, lanes)
    filled(settings, threads=threads, seed=seed, splits=splits, light_samples=light_samples)
    done = module.render_pass(scene, film, ends, settings, lanes=lanes, progress=progress)
    return Rendered(film, done)


class Rendered:
    """A film and what its last pass did."""

    def __init__(self, film: Any, done: Any) -> None:
        self.film = film
        self.interrupted = bool(done.interrupted)
        self.lane_occupancy = done.busy_lanes / max(done.shaded_lanes, 1)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.film, name)

    def pixels(self, exposure: float = 1.0) -> Floats:
        """Mean R, G, B, coverage (H, W, 4)."""
        return self.film.image(exposure)[0]


def replicate_means(result: Any) -> Doubles:
    """Means of each replicate, (2, H, W, 3)."""
    return result.replicates[..., :3] / np.maximum(result.counts[..., None], 1)
