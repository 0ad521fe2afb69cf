"""What a camera sees of spheres and boxes, in double and in closed form, to compare AOVs with at every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pxr import Usd

from primray.description import Camera, Doubles, Projection

CAMERA = """
def Camera "cam"
{
    float focalLength = 24
    float horizontalAperture = 24
    float verticalAperture = 18
    float2 clippingRange = (0.1, 1e9)
    double3 xformOp:translate = PLACE
    float3 xformOp:rotateXYZ = TURN
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""
DOME = 'def DomeLight "sky"\n{\n    float inputs:intensity = 0.25\n}\n'


def stage_of(text: str, place: Sequence[float] = (0, 0, 6), turn: Sequence[float] = (0, 0, 0), light: str = DOME) -> Usd.Stage:
    """In memory, with a camera that looks along -Z before it is turned."""
    stage = Usd.Stage.CreateInMemory()
    camera = CAMERA.replace("PLACE", str(tuple(map(float, place)))).replace("TURN", str(tuple(turn)))
    assert stage.GetRootLayer().ImportFromString("#usda 1.0\n" + text + camera + light)
    return stage


@dataclass(frozen=True)
class Ball:
    center: Sequence[float] | Doubles
    radius: float


@dataclass(frozen=True)
class Box:
    low: Sequence[float] | Doubles
    high: Sequence[float] | Doubles


@dataclass(frozen=True)
class Seen:
    """By pixel (H, W, ...): `what` is the number of the shape or -1; `sure`: a 500th of a pixel to the side is the same."""

    what: np.ndarray
    t: Doubles
    point: Doubles
    normal: Doubles
    direction: Doubles
    sure: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))


def rays(camera: Camera, resolution: tuple[int, int], shift: tuple[float, float] = (0.0, 0.0)) -> tuple[Doubles, Doubles]:
    """Origins and unit directions (H, W, 3) through the pixels' centres, `shift` pixels beside them."""
    width, height = resolution
    left, right, bottom, top = camera.window
    x = left + (np.arange(width) + 0.5 + shift[0]) * (right - left) / width
    y = top - (np.arange(height) + 0.5 + shift[1]) * (top - bottom) / height
    sx, sy = np.meshgrid(x, y)
    zero = np.zeros_like(sx)
    if camera.projection is Projection.ORTHOGRAPHIC:
        o, d = np.stack([sx, sy, zero], axis=2), np.stack([zero, zero, zero - 1], axis=2)
    else:
        o, d = np.stack([zero] * 3, axis=2), np.stack([sx, sy, zero - 1], axis=2)
    m = camera.world_from_camera
    d = d @ m[:3, :3].T
    return o @ m[:3, :3].T + m[:3, 3], d / np.linalg.norm(d, axis=2, keepdims=True)


def look(camera: Camera, resolution: tuple[int, int], shapes: Sequence[Ball | Box]) -> Seen:
    seen = _look(*rays(camera, resolution), shapes)
    sure = np.ones(seen.what.shape, bool)
    for x in (-0.002, 0.002):
        for y in (-0.002, 0.002):
            beside = _look(*rays(camera, resolution, (x, y)), shapes)
            sure &= (beside.what == seen.what) & (np.linalg.norm(beside.normal - seen.normal, axis=2) < 0.2)
    return Seen(seen.what, seen.t, seen.point, seen.normal, seen.direction, sure)


def _look(o: Doubles, d: Doubles, shapes: Sequence[Ball | Box]) -> Seen:
    t = np.full(o.shape[:2], np.inf)
    what = np.full(o.shape[:2], -1)
    normal = np.zeros_like(o)
    for number, shape in enumerate(shapes):
        hit_t, hit_normal = _ball(o, d, shape) if isinstance(shape, Ball) else _box(o, d, shape)
        nearer = hit_t < t
        t, what = np.where(nearer, hit_t, t), np.where(nearer, number, what)
        normal = np.where(nearer[..., None], hit_normal, normal)
    with np.errstate(invalid="ignore"):
        point = np.where(np.isfinite(t)[..., None], o + d * np.where(np.isfinite(t), t, 0)[..., None], 0.0)
    return Seen(what, t, point, normal, d)


def _ball(o: Doubles, d: Doubles, ball: Ball) -> tuple[Doubles, Doubles]:
    to = np.asarray(ball.center) - o
    along = (to * d).sum(axis=2)
    beside2 = (to * to).sum(axis=2) - along**2
    with np.errstate(invalid="ignore"):
        half = np.sqrt(ball.radius**2 - beside2)
        near, far = along - half, along + half
        t = np.where(near > 0, near, np.where(far > 0, far, np.inf))
    t = np.where(beside2 < ball.radius**2, t, np.inf)
    with np.errstate(invalid="ignore"):
        normal = (o + d * t[..., None] - np.asarray(ball.center)) / ball.radius
    normal *= -np.sign((normal * d).sum(axis=2, keepdims=True))
    return t, np.where(np.isfinite(t)[..., None], normal, 0.0)


def _box(o: Doubles, d: Doubles, box: Box) -> tuple[Doubles, Doubles]:
    """Kay and Kajiya 1986: slabs; seen from outside."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (np.asarray(box.low) - o) / d, (np.asarray(box.high) - o) / d
    entry, leave = np.fmin(a, b), np.fmax(a, b)
    axis = entry.argmax(axis=2)
    t = entry.max(axis=2)
    hit = (t < leave.min(axis=2)) & (t > 0)
    normal = np.zeros_like(o)
    np.put_along_axis(normal, axis[..., None], -np.sign(np.take_along_axis(d, axis[..., None], axis=2)), axis=2)
    return np.where(hit, t, np.inf), np.where(hit[..., None], normal, 0.0)
