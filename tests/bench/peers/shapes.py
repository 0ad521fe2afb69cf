"""Meshes and images that the compared scenes are made of, as arrays; all of it from a few numbers and fixed seeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Triangles:
    points: Array  # (N, 3)
    faces: npt.NDArray[np.int32]  # (M, 3)
    normals: Array | None = None  # (N, 3), smooth; None: faceted


def rectangle(center: Array | tuple[float, ...], half_u: tuple[float, ...], half_v: tuple[float, ...]) -> Triangles:
    """Its normal is u x v."""
    c, u, v = np.asarray(center, float), np.asarray(half_u, float), np.asarray(half_v, float)
    return Triangles(np.stack([c - u - v, c + u - v, c + u + v, c - u + v]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def block(center: tuple[float, ...], half: tuple[float, ...], turn_deg: float = 0.0) -> Triangles:
    """A box about `center`, turned about y, its faces looking out."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float) * half
    turn = float(np.radians(turn_deg))
    about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]], np.int32)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Triangles(corners @ about_y.T + np.asarray(center), faces)


def ball(steps: int, radius: float = 1.0, center: tuple[float, ...] = (0.0, 0.0, 0.0), smooth: bool = False) -> Triangles:
    """An octahedron whose triangles are cut in four `steps` times, on the sphere: 8 x 4^steps triangles."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]], np.int32
    )  # counter-clockwise from outside
    for _ in range(steps):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        a, b, c = (number.reshape(-1, 3) + len(points)).T  # in the middles of the sides
        points = np.concatenate([points, points[edges].mean(axis=1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        p, q, r = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((p, a, c), (a, q, b), (c, b, r), (a, b, c))]).astype(np.int32)
    return Triangles(points * radius + np.asarray(center), faces, points if smooth else None)


def tube(path: Array, radius: float, sides: int, closed: bool) -> Triangles:
    """Circles of that radius along a path (N, 3) in a plane of constant z; if not closed, with flat ends."""
    ahead = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    if not closed:
        ahead[[0, -1]] = path[1] - path[0], path[-1] - path[-2]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    across = np.cross((0.0, 0.0, 1.0), ahead)
    turn = np.arange(sides) * (2 * np.pi / sides)
    circle = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * np.array([0.0, 0.0, -1.0])
    points = (path[:, None] + radius * circle).reshape(-1, 3)
    ring, side = np.divmod(np.arange(len(path) * sides if closed else (len(path) - 1) * sides), sides)
    after, beside = (ring + 1) % len(path) * sides, (side + 1) % sides
    a, b, c, d = ring * sides + side, after + side, after + beside, ring * sides + beside
    faces = [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    if not closed:
        last = (len(path) - 1) * sides
        fan = np.stack([np.zeros(sides - 2, int), np.arange(1, sides - 1), np.arange(2, sides)], axis=1)
        faces += [fan, last + fan[:, ::-1]]
    return Triangles(points, np.concatenate(faces).astype(np.int32))


def disc(
    center: Array | tuple[float, ...], half_u: tuple[float, ...], half_v: tuple[float, ...], sides: int = 256
) -> Triangles:
    """The ellipse that a rectangle of the same terms is about."""
    c, u, v = np.asarray(center, float), np.asarray(half_u, float), np.asarray(half_v, float)
    turn = np.arange(sides) * (2 * np.pi / sides)
    rim = c + np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    k = np.arange(1, sides - 1)
    return Triangles(rim, np.stack([np.zeros_like(k), k, k + 1], axis=1).astype(np.int32))


def perpendicular(axis: Array) -> Array:
    """To it, of some length."""
    return np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])


def cylinder(center: Array | tuple[float, ...], half: tuple[float, ...], radius: float, sides: int = 256) -> Triangles:
    """Its lateral area, looking out."""
    c, h = np.asarray(center, float), np.asarray(half, float)
    across = perpendicular(h)
    across *= radius / np.linalg.norm(across)
    turn = np.arange(sides) * (2 * np.pi / sides)
    beside = np.cross(h, across) / np.linalg.norm(h)
    circle = c + np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * beside
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = np.concatenate([np.stack([k, after, after + sides], axis=1), np.stack([k, after + sides, k + sides], axis=1)])
    return Triangles(np.concatenate([circle - h, circle + h]), faces.astype(np.int32))


def bumps(points: Array, octaves: int, frequency: float, seed: int) -> Array:
    """Sums of five plane waves an octave, amplitudes halved and frequencies doubled from one to the next: (N, K) to (N,)."""
    rng = np.random.default_rng(seed)
    height = np.zeros(len(points))
    for octave in range(octaves):
        for _ in range(5):
            direction = rng.normal(size=points.shape[1])
            wave = points @ (direction * (frequency * 2.0**octave / float(np.linalg.norm(direction))))
            height += 0.2 * 0.5**octave * np.sin(wave + rng.uniform(0, 2 * np.pi))
    return height


def terrain(side: int, size: float) -> Triangles:
    """side x side vertices over a square of that size, with hills that also lean sideways."""
    at = np.linspace(-size / 2, size / 2, side)
    flat = np.stack(np.meshgrid(at, at, indexing="xy"), axis=-1).reshape(-1, 2)
    lean = [0.25 * bumps(flat, 5, 2.2, seed) for seed in (11, 12)]
    points = np.stack([flat[:, 0] + lean[0], 1.4 * bumps(flat, 8, 0.8, 10), flat[:, 1] + lean[1]], axis=1)
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + side, k + 1], axis=1), np.stack([k + 1, k + side, k + side + 1], axis=1)])
    return Triangles(points, faces.astype(np.int32))


def sky(
    width: int,
    zenith: tuple[float, ...],
    horizon: tuple[float, ...],
    ground: tuple[float, ...],
    sun: tuple[tuple[float, ...], float, tuple[float, ...]] | None = None,
) -> npt.NDArray[np.float32]:
    """A latitude-longitude image, (width / 2, width, 3), as UsdLux's DomeLight has it: its middle looks along +z, +x is to the
    left of it, the top is +y. `sun`: direction towards it, angular radius in degrees, radiance."""
    down, right = np.mgrid[0 : width // 2, 0:width]
    latitude = np.pi * (0.5 - (down + 0.5) / (width // 2))
    longitude = np.pi * (1 - 2 * (right + 0.5) / width)
    across = np.cos(latitude)
    towards = np.stack([np.sin(longitude) * across, np.sin(latitude), np.cos(longitude) * across], axis=-1)
    height = towards[..., 1:2]
    blend = np.sqrt(np.clip(height, 0, 1))
    image = np.where(height > 0, np.asarray(horizon) * (1 - blend) + np.asarray(zenith) * blend, np.asarray(ground))
    if sun is not None:
        direction, radius_deg, radiance = sun
        unit = np.asarray(direction) / np.linalg.norm(direction)
        image = np.where((towards @ unit)[..., None] > np.cos(np.radians(radius_deg)), np.asarray(radiance), image)
    return image.astype(np.float32)


def rotations(quaternions: Array) -> Array:
    """(N, 4) as w, x, y, z to (N, 3, 3)."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def look_at(eye: tuple[float, ...], target: tuple[float, ...]) -> Array:
    """World from camera, 4 x 4, column vectors: it looks down its -z, +y up."""
    back = np.asarray(eye, float) - np.asarray(target, float)
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, np.asarray(eye, float)], axis=1)
    return matrix
