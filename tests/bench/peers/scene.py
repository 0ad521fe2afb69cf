"""The terms in which compared scenes are described, that every renderer has.

y up, metres, linear Rec.709, a pinhole camera, box filter one pixel wide, nothing clamped, nothing denoised.
depth: surface scatterings (1 = direct light). Looks and lamps: scenes.py. What moves does so while the shutter is open, from
half a frame before the frame to half a frame after it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .shapes import Array, Triangles, rotations

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_deg: float  # horizontal


@dataclass(frozen=True)
class Look:
    kind: str  # diffuse, metal, plastic, glass, glow, ember, layered or hair
    color: Rgb = (1.0, 1.0, 1.0)
    roughness: float = 0.0
    ior: float = 1.5


@dataclass(frozen=True)
class Layered(Look):
    """Of the kind "layered"."""

    metalness: float = 0.0
    transmission: float = 0.0
    coat: float = 0.0
    fuzz: float = 0.0
    subsurface: float = 0.0
    radius: Rgb = (1.0, 1.0, 1.0)  # mean free paths


@dataclass(frozen=True)
class Lamp:
    kind: str  # rect, disc, tube, ball, sun or sky
    radiance: Rgb = (1.0, 1.0, 1.0)  # of a sun: its irradiance
    center: tuple[float, ...] = ()
    half_u: tuple[float, ...] = ()
    half_v: tuple[float, ...] = ()
    radius: float = 0.0
    direction: tuple[float, ...] = ()  # that light travels in
    image: str = ""


@dataclass(frozen=True)
class Glide:
    """Of a mesh, described about its own origin: it stands at `center` at the frame, turned by nothing."""

    center: tuple[float, float, float]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from opening to closing, at constant speed
    turn_deg: float = 0.0  # likewise, about its y axis


@dataclass(frozen=True)
class Pan:
    """Of the camera: in place of its eye and target."""

    eye: tuple[float, float, float]
    down_deg: float
    shift: tuple[float, float, float]
    turn_deg: float  # about y through the eye, at constant speed; at the frame it looks along -z


@dataclass(frozen=True)
class Placed:
    """One mesh many times over, turned and scaled evenly."""

    mesh: str
    look: str
    positions: npt.NDArray[np.float32]  # (N, 3)
    quaternions: npt.NDArray[np.float16]  # (N, 4): w, x, y, z; half floats are what a PointInstancer has
    scales: npt.NDArray[np.float32]  # (N,)
    swarm: npt.NDArray[np.int32] | None = None  # (N,): each moves with its swarm, by its shift from opening to closing
    shifts: Array | None = None  # (G, 3)

    def matrices(self) -> Array:
        """(N, 4, 4), column vectors."""
        found = np.tile(np.eye(4), (len(self.positions), 1, 1))
        found[:, :3, :3] = rotations(self.quaternions.astype(float)) * self.scales[:, None, None]
        found[:, :3, 3] = self.positions
        return found


@dataclass(frozen=True)
class Strands:
    points: Array  # (N, K, 3): control points of uniform cubic B-splines
    radius: float
    look: str


@dataclass
class Scene:
    name: str
    resolution: tuple[int, int]
    depth: int
    camera: Camera
    looks: dict[str, Look] = field(default_factory=dict)
    meshes: dict[str, Triangles] = field(default_factory=dict)
    objects: list[tuple[str, str]] = field(default_factory=list)  # mesh, look
    placed: Placed | None = None
    lamps: list[Lamp] = field(default_factory=list)
    images: dict[str, npt.NDArray[np.float32]] = field(default_factory=dict)
    glides: dict[str, Glide] = field(default_factory=dict)  # by mesh
    ends: dict[str, Array] = field(default_factory=dict)  # by mesh: points (N, 3) at closing; its own are those at opening
    pan: Pan | None = None
    strands: Strands | None = None

    @property
    def moves(self) -> bool:
        swarms = self.placed is not None and self.placed.swarm is not None
        return bool(self.glides or self.ends or self.pan or swarms)

    def add(self, name: str, mesh: Triangles, look: str) -> None:
        self.meshes[name] = mesh
        self.objects.append((name, look))
