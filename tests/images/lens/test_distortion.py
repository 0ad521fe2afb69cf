"""Distorting lenses against OpenCV, closed forms and themselves: where points land, where rays go, what is not seen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import box, describe, kernels, lambert, light, look_at, perspective, quad, render, translation
from tests.images.lens.lenses import EQUIDISTANT, LENSES, RESOLUTION, camera_with, film_grid, inverse, scene_of
from tests.images.motion.motion_scenes import exposed

from primray.core.single_precision import rebasing_origin
from primray.description import Camera, CameraMotion, Doubles, LightType
from primray.lens.distortion import Distortion, DistortionModel

F_THETA = Distortion(DistortionModel.RADIUS_TO_ANGLE, (0.0, 1.0, 0.0, 0.0, 0.0), 110.0)


@pytest.mark.parametrize("radius", [0.0, 0.05])
@pytest.mark.parametrize("name", LENSES)
def test_rays_go_where_points_project(name: str, radius: float) -> None:
    """Through any point of the lens, at the plane of focus, or at its sphere for lenses that see around."""
    view = look_at([3.0, -2.0, 5.0], [0.1, 0.3, -0.2])
    camera = camera_with(LENSES[name], 0.8, view, lens_radius=radius, focus_distance=4.0, clipping_range=(0.5, 90.0))
    rng = np.random.default_rng(1)
    pixel = np.stack([rng.integers(0, n, 4000) for n in RESOLUTION], axis=1).astype(np.int32)
    film, lens = rng.random((4000, 2), dtype=np.float32), rng.random((4000, 2), dtype=np.float32)
    o, d, near, far = kernels().camera_rays(scene_of(camera), pixel, film, lens)
    seen = far >= 0
    assert seen.mean() > 0.3
    d = d.astype(np.float64)
    on_plane = LENSES[name].model is DistortionModel.RATIONAL
    per_length = -(d @ view[:3, 2]) if on_plane else np.ones(len(d))
    # Lens points are in the focal plane's frame: what is in focus is `focus` along the axis, or from the lens's middle.
    start = o.astype(np.float64) + rebasing_origin(camera) - view[:3, 3]
    if on_plane:
        p = start + d * (4.0 / per_length)[:, None]
    else:
        along = (start * d).sum(axis=1)
        p = start + d * (-along + np.sqrt(along**2 - (start**2).sum(axis=1) + 16.0))[:, None]
    at = camera.project(p[seen] + view[:3, 3], RESOLUTION)
    assert np.abs(at - (pixel + film)[seen]).max() < 2e-3
    if radius == 0:
        np.testing.assert_allclose((near * per_length)[seen], 0.5, rtol=1e-5)
        np.testing.assert_allclose((far * per_length)[seen], 90.0, rtol=1e-5)


def test_a_linear_f_theta_lens_is_equidistant_and_covers_the_angle_it_says() -> None:
    """A white sky through an f-theta lens of 220 degrees: a disc of that angle, and the solid angle that a pixel sees."""
    film = film_grid(2.0)
    a, b = inverse(F_THETA, film), inverse(EQUIDISTANT, film)
    seen = np.isfinite(a).all(axis=1)
    np.testing.assert_array_equal(seen, np.hypot(*film.T) <= np.radians(110.0))
    np.testing.assert_allclose(a, b, atol=1e-14)
    radius = np.hypot(*film.T)
    np.testing.assert_allclose(a[seen, 2], -np.cos(radius[seen]), atol=1e-14)


def sky_through(distortion: Distortion | None, spp: int = 16, lanes: int = 0, **changes: Any) -> Doubles:
    """R, G, B and coverage of a ball around the camera that glows with 1."""
    ball = box([20, 20, 20])
    camera = perspective(translation(0.3, 0.2, 0.1), 2.2, 1.0, distortion=distortion, **changes)
    scene = describe([(ball, np.eye(4))], [lambert(0.0, 1.0)], camera=camera, resolution=(48, 48)).build()
    return np.asarray(render(scene, spp, lanes=lanes).pixels(), np.float64)


def test_beyond_the_field_of_view_there_is_nothing() -> None:
    """Coverage of a pixel is its part within 110 degrees; colour is premultiplied with exactly that."""
    pixels = sky_through(EQUIDISTANT, 64)
    np.testing.assert_array_equal(pixels[..., 0], pixels[..., 3])
    at = (np.arange(48) + 0.5) / 48 * 4.4 - 2.2
    radius = np.hypot(at[:, None], at[None])
    edge = 4.4 / 48 * 0.75
    assert (pixels[radius < np.radians(110) - edge] == 1).all()
    assert (pixels[radius > np.radians(110) + edge] == 0).all()
    area = pixels[..., 3].sum() * (4.4 / 48) ** 2
    assert area == pytest.approx(np.pi * np.radians(110) ** 2, rel=2e-3)


def test_a_dome_is_not_seen_beyond_the_field_of_view() -> None:
    camera = perspective(np.eye(4), 2.2, 1.0, distortion=EQUIDISTANT)
    scene = describe([], [], [light(LightType.DOME)], camera=camera, resolution=(48, 48)).build()
    pixels = render(scene, 16).pixels()
    assert pixels[0, 0, 0] == 0
    assert pixels[24, 24, 0] == 1


@pytest.mark.parametrize("name", ["rational", "fisheye", "f-theta"])
def test_marks_land_where_they_project(name: str) -> None:
    """The picture's centroid of a small square that glows, for places over the frame, behind the camera's plane too."""
    lens = LENSES[name]
    around = [(0.0, 0.0), (0.4, 0.3), (-0.7, 0.5), (0.9, -0.6)]
    if name != "rational":
        around.append((1.45, 0.2))
    for x, y in around:
        d = inverse(lens, np.array([[x, y]]))[0]
        d /= np.linalg.norm(d)
        mark = quad([[-0.02, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [-0.02, 0.02, 0]])
        facing = look_at(d, [0.0, 0.0, 0.0])
        facing[:3, :3] *= [-1, 1, -1]
        camera = camera_with(lens)
        scene = describe([(mark, facing)], [lambert(0.0, 1.0)], camera=camera, resolution=RESOLUTION).build()
        glow = np.asarray(render(scene, 64).pixels()[..., 0], np.float64)
        j, i = np.mgrid[: RESOLUTION[1], : RESOLUTION[0]] + 0.5
        found = np.array([(i * glow).sum(), (j * glow).sum()]) / glow.sum()
        assert np.abs(found - camera.project(d[None], RESOLUTION)[0]).max() < 0.1


@pytest.mark.parametrize("name", LENSES)
def test_lanes_do_not_show(name: str) -> None:
    first = sky_through(LENSES[name], 8, 1)
    for lanes in (4, 8):
        np.testing.assert_array_equal(sky_through(LENSES[name], 8, lanes), first)


def test_a_camera_that_moves_and_distorts() -> None:
    """Two poses that are alike make the still's picture; a pan blurs as the mean of stills along it."""
    still = camera_with(LENSES["fisheye"], 0.9)
    made = describe([(box([1, 1, 1]), translation(0, 0, -3))], [lambert(0.0, 1.0)], camera=still, resolution=RESOLUTION)

    def at(shift: float) -> Camera:
        return replace(still, world_from_camera=translation(shift, 0, 0))

    def pictured(camera: Camera) -> Doubles:
        described = replace(made, description=replace(made.description, camera=camera))
        return np.asarray(render(described.build(), 32).pixels(), np.float64)

    alike = exposed(made, camera=CameraMotion(np.array([0.0, 1.0]), (still, still)))
    np.testing.assert_allclose(render(alike.build(), 32).pixels(), pictured(still), atol=1e-6)
    moved = exposed(made, camera=CameraMotion(np.array([0.0, 1.0]), (at(0.0), at(0.5))))
    mean = np.mean([pictured(at(0.5 * (k + 0.5) / 16)) for k in range(16)], axis=0)
    blurred = np.asarray(render(moved.build(), 256).pixels(), np.float64)
    assert np.abs(blurred - mean).max() < 0.15
    assert np.abs(blurred.mean(axis=0) - mean.mean(axis=0)).max() < 0.01
