"""Camera motion over the shutter: placement, zoom, focus and clipping, at times chosen by an error bound in pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from pxr import Usd

from ...arrays import Doubles
from ...description import Camera, CameraMotion
from ...diagnostics import Diagnostics
from ..motion.attributes import bend_times, blur_scale_of, is_animated
from ..motion.matrices import quaternions, rotation_matrices, slerp
from ..motion.sample_times import Steps, fractions, sample_times
from ..motion.timing import NEAREST
from ..render_settings.render_product import ProductSettings
from ..scene.context import Context
from ..stage.reads import property_names
from ..stage.values import When
from .camera import read_camera
from .framed_objects import FramedObjects

_OPTICS = """horizontalAperture verticalAperture horizontalApertureOffset verticalApertureOffset focalLength
    clippingRange fStop focusDistance"""
OPTICS = frozenset(_OPTICS.split())
FAR = 1e6  # times the distance of the nearest object
NO_ERROR = 1e-4  # pixels


def camera_when(prim: Usd.Prim, ctx: Context, offset: float) -> When:
    """Return when to read a camera, `offset` time codes after the frame; motion:blurScale applies to cameras, too."""
    return ctx.when.after(offset * blur_scale_of(prim))


def camera_motion(
    prim: Usd.Prim | None,
    frame: Camera,
    ctx: Context,
    product: ProductSettings,
    resolution: tuple[int, int],
    nearest: float,
    most: float,
) -> tuple[CameraMotion, Steps] | None:
    """Return the camera's motion, None if it does not move; `nearest` is the distance of the nearest object it may see."""
    if prim is None or not (moving := list(_animated_attributes(prim, ctx))):
        return None
    scale, timing = blur_scale_of(prim), ctx.timing
    known: dict[float, Camera] = {}

    def at(fraction: float) -> Camera:
        if fraction not in known:
            when = ctx.when.after(scale * timing.offset(fraction))
            found = read_camera(prim, ctx.when, resolution, product, frame.shutter, Diagnostics(), when)
            known[fraction] = with_static_values(found, frame)
        return known[fraction]

    def error(a: float, b: float, time: float) -> float:
        made = interpolated_camera(at(a), at(b), (time - a) / (b - a))
        return _pixel_error(made, at(time), nearest, resolution)

    bent = fractions(bend_times(moving, ctx.when, timing), timing.span, scale)
    if all(at(time) == at(0.0) for time in (0.5, 1.0, *(t for t in bent if 0 < t < 1))):
        return None
    steps = sample_times(error, bent, most, NO_ERROR)
    return CameraMotion(np.array(steps.times), tuple(at(time) for time in steps.times)), steps


def with_static_values(found: Camera, frame: Camera) -> Camera:
    """Return the camera found, with what is not animated as it is at the frame: all of a panorama but its place."""
    if frame.pixels_follow_window:
        found = replace(found, window=frame.window, lens_radius=frame.lens_radius, pixels_follow_window=True)
    return replace(
        found,
        exposure_scale=frame.exposure_scale,
        distortion=frame.distortion,
        natural_vignetting=frame.natural_vignetting,
        rim=frame.rim,
        channel_magnification=frame.channel_magnification,
        channel_focus_shift=frame.channel_focus_shift,
    )


def _animated_attributes(prim: Usd.Prim, ctx: Context) -> Iterator[Usd.Attribute]:
    """Yield attributes of the camera and its ancestors that change while the shutter is open."""
    names = OPTICS & frozenset(property_names(prim))
    yield from (a for name in sorted(names) if is_animated(a := prim.GetAttribute(name), ctx.when, ctx.timing))
    above = prim
    while above and not above.IsPseudoRoot():
        for name in property_names(above):
            if name.startswith("xformOp:") and is_animated(a := above.GetAttribute(name), ctx.when, ctx.timing):
                yield a
        above = above.GetParent()


def interpolated_camera(a: Camera, b: Camera, u: float) -> Camera:
    """Return the camera between two, as the core interpolates it: rotation by slerp, the rest linear."""
    matrix = np.eye(4)
    first, last = (quaternions(camera.world_from_camera[None, :3, :3]) for camera in (a, b))
    matrix[:3, :3] = rotation_matrices(slerp(first, last, u))[0]
    matrix[:3, 3] = _mix(a.world_from_camera[:3, 3], b.world_from_camera[:3, 3], u)
    left, right, bottom, top = _mix(np.array(a.window), np.array(b.window), u).tolist()
    near, far = _mix(np.array(a.clipping_range), np.array(b.clipping_range), u).tolist()
    return replace(
        a,
        world_from_camera=matrix,
        window=(left, right, bottom, top),
        clipping_range=(near, far),
        lens_radius=a.lens_radius + u * (b.lens_radius - a.lens_radius),
        focus_distance=a.focus_distance + u * (b.focus_distance - a.focus_distance),
    )


def nearest_distance(camera: Camera, things: FramedObjects) -> float:
    """Return the distance of the nearest object, at least that of the near plane."""
    eye = camera.world_from_camera[:3, 3]
    apart = np.linalg.norm(np.maximum(np.maximum(things.low - eye, eye - things.high), 0.0), axis=1)
    size = float((things.high.max(axis=0) - things.low.min(axis=0)).max())
    return max(float(apart.min()), camera.clipping_range[0], NEAREST * size, 1e-30)


def _mix(a: Doubles, b: Doubles, u: float) -> Doubles:
    return np.asarray(a + u * (b - a))


def _pixel_error(found: Camera, true: Camera, nearest: float, resolution: tuple[int, int]) -> float:
    """Return the largest error in pixels at the corners and centre of the true camera's view, near and far, undistorted."""
    found, true = replace(found, distortion=None), replace(true, distortion=None)
    left, right, bottom, top = true.window
    window = np.array([(left, bottom), (left, top), (right, bottom), (right, top), ((left + right) / 2, (bottom + top) / 2)])
    apart = 0.0
    distances = {nearest, FAR * nearest, true.focus_distance if true.lens_radius else nearest}
    for distance in distances:
        across = window if true.projection.value == "orthographic" else window * distance
        seen = np.concatenate([across, np.full((5, 1), -distance)], axis=1)
        world = seen @ true.world_from_camera[:3, :3].T + true.world_from_camera[:3, 3]
        with np.errstate(invalid="ignore"):
            off = np.linalg.norm(found.project(world, resolution) - true.project(world, resolution), axis=1)
        apart = max(apart, float(np.where(np.isfinite(off), off, np.inf).max()))
    return max(apart, _defocus_error(found, true, nearest, resolution))


def _defocus_error(found: Camera, true: Camera, nearest: float, resolution: tuple[int, int]) -> float:
    """Return the error in pixels of the circle of confusion for the nearest object and at infinity."""
    left, right, _, _ = true.window
    per_unit = resolution[0] / abs(right - left)

    def blur(camera: Camera, distance: float) -> float:
        if not camera.lens_radius or not camera.focus_distance:
            return 0.0
        return camera.lens_radius * abs(1.0 / camera.focus_distance - 1.0 / distance) * per_unit

    return max(abs(blur(found, d) - blur(true, d)) for d in (nearest, FAR * nearest))
