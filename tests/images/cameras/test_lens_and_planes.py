"""Blades, clipping planes, what is behind an orthographic camera, and times of rays, against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    asked,
    core_module,
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    quad,
    render,
    replicate_means,
    translation,
)
from tests.kernels.scenes import SCENES

from primray.core.single_precision import rebasing_origin
from primray.description import Camera, CameraMotion, Doubles, Exposure, LightType, Sphere, Surface

RESOLUTION = (640, 400)
VIEW = look_at([3.0, -2.0, 5.0], [0.1, 0.3, -0.2])
RADIUS, FOCUS = 0.05, 4.0
LENS = perspective(VIEW, 0.3, 1.6, lens_radius=RADIUS, focus_distance=FOCUS)


def rays(
    camera: Camera, n: int = 20_000, lens: Doubles | None = None, lanes: int = 0
) -> tuple[Doubles, Doubles, Doubles, Doubles]:
    """Origins and directions of unit depth in the camera's space, and the depths between which they see."""
    rng = np.random.default_rng(1)
    pixel = np.stack([rng.integers(0, RESOLUTION[0], n), rng.integers(0, RESOLUTION[1], n)], axis=1).astype(np.int32)
    film = rng.random((n, 2), dtype=np.float32)
    numbers = rng.random((n, 2), dtype=np.float32) if lens is None else lens.astype(np.float32)
    scene = describe([(ground(), np.eye(4))], [lambert(0.5)], camera=camera, resolution=RESOLUTION).build()
    more = {"lanes": lanes} if lanes else {}
    o, d, near, far = kernels().camera_rays(scene, pixel, film, numbers, **more)
    rotate, eye = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    o, d = (o.astype(np.float64) + rebasing_origin(camera) - eye) @ rotate, d.astype(np.float64) @ rotate
    depth = -d[:, 2]
    return o, d / depth[:, None], near * depth, far * depth


def corners(blades: int, rotation_deg: float) -> Doubles:
    turns = np.radians(rotation_deg) + 2 * np.pi * np.arange(blades) / blades
    return RADIUS * np.stack([np.cos(turns), np.sin(turns)], axis=1)


@pytest.mark.parametrize(("blades", "rotation_deg"), [(3, 0.0), (4, 45.0), (5, 90.0), (6, -725.0), (7, 12.5), (60, 0.0)])
def test_blades_are_a_regular_polygon_evenly_filled(blades: int, rotation_deg: float) -> None:
    o, _, _, _ = rays(replace(LENS, blades=blades, blade_rotation_deg=rotation_deg), 40_000)
    lens = o[:, :2]
    assert np.abs(o[:, 2]).max() < 1e-6
    # Within every side, and up to it: the distance of a side's line is R cos(pi / n).
    apothem = RADIUS * np.cos(np.pi / blades)
    normals = corners(blades, rotation_deg + 180 / blades) / RADIUS
    reach = (lens @ normals.T).max(axis=0)
    assert reach.max() < apothem * (1 + 1e-5)
    assert reach.min() > apothem * (0.995 if blades < 10 else 0.9)
    if blades < 10:  # and into every corner
        nearest = np.linalg.norm(lens[:, None] - corners(blades, rotation_deg)[None], axis=2).min(axis=0)
        assert nearest.max() < 0.03 * RADIUS
    # An even polygon's mean square distance from its centre is R^2 (2 + cos(2 pi / n)) / 6; 40000 samples: 0.3 %.
    exact = RADIUS**2 * (2 + np.cos(2 * np.pi / blades)) / 6
    assert np.mean(lens**2) * 2 == pytest.approx(exact, rel=0.015)
    assert np.abs(lens.mean(axis=0)).max() < 5 * RADIUS / 2 / np.sqrt(len(lens))
    # Evenly by parts: each triangle of the fan has its share, and half of it lies within 1 / sqrt(2) of the way out.
    turns = (np.arctan2(lens[:, 1], lens[:, 0]) - np.radians(rotation_deg)) / (2 * np.pi) % 1
    if blades < 10:
        shares = np.bincount((turns * blades).astype(int) % blades, minlength=blades) / len(lens)
        assert np.abs(shares * blades - 1).max() < 5 * np.sqrt(blades / len(lens))
    out = (lens @ normals.T).max(axis=1) / apothem
    assert np.mean(out < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.015)


def test_lanes_agree_on_blades_and_planes() -> None:
    camera = replace(LENS, blades=7, blade_rotation_deg=33.0, clipping_planes=((0.1, 0.5, -1.0, -3.0), (0.0, 1.0, 0.0, 0.2)))
    one = rays(camera, lanes=1)
    for lanes in (4, 8, 16):
        if lanes <= core_module().MAX_LANES:
            for a, b in zip(one, rays(camera, lanes=lanes), strict=True):
                np.testing.assert_array_equal(a, b)


@pytest.mark.conforms("Camera.fStop", "Camera.focusDistance")
@pytest.mark.parametrize("blades", [0, 3, 6])
@pytest.mark.parametrize("z", [2.0, 7.0, 1e3])
def test_circle_of_confusion(blades: int, z: float) -> None:
    """A point at depth z is blurred to the lens's shape, |z - f| / (z f) as large at unit distance; upright if z > f."""
    camera = replace(LENS, blades=blades)
    n = 20_000
    rng = np.random.default_rng(2)
    numbers = rng.random((n, 2))
    if blades:  # all of them at corners, but for a hair
        numbers = np.stack([np.full(n, 1 - 2**-24), (rng.integers(0, blades, n) + 1e-6) / blades], axis=1)
    else:
        numbers[:, 0] = 1 - 2**-24
    o, d, _, _ = rays(camera, n, numbers)
    at_focus, at_z = o + d * FOCUS, o + d * z
    # Where the film shows what is in focus, less where it would show the point without a lens.
    blur = at_z[:, :2] / z - at_focus[:, :2] / FOCUS
    exact = RADIUS * abs(z - FOCUS) / (z * FOCUS)
    np.testing.assert_allclose(np.linalg.norm(blur, axis=1), exact, rtol=5e-3)
    if blades:
        shape = -blur * np.sign(z - FOCUS) * z * FOCUS / abs(z - FOCUS)  # a film point sees the other way around
        nearest = np.linalg.norm(shape[:, None] - corners(blades, 0.0)[None], axis=2).min(axis=1)
        assert nearest.max() < 5e-3 * RADIUS


# Clipping planes.


def cut(o: Doubles, d: Doubles, planes: Any, near: float, far: float) -> tuple[Doubles, Doubles]:
    """By the definition: depths along each ray at which no plane cuts off."""
    low, high = np.full(len(o), near), np.full(len(o), far)
    for a, b, c, e in planes:
        at, slope = o @ [a, b, c] + e, d @ [a, b, c]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -at / slope
        low = np.where((slope > 0) & (t > low), t, low)
        high = np.where((slope < 0) & (t < high), t, high)
        high = np.where((slope == 0) & (at < 0), -np.inf, high)
    return low, high


PLANES: dict[str, list[Any]] = {
    "one that faces away": [(0.0, 0.0, 1.0, 5.0)],
    "one that faces the camera": [(0.0, 0.0, -1.0, -2.0)],
    "askew": [(0.3, -0.7, -0.2, -0.5)],
    "not normalised": [(3e8, -7e8, -2e8, -5e8)],
    "a box": [(1, 0, 0, 0.4), (-1, 0, 0, 0.4), (0, 1, 0, 0.4), (0, -1, 0, 0.4), (0, 0, -1, -3), (0, 0, 1, 6)],
    "nothing left": [(0.0, 0.0, -1.0, -6.0), (0.0, 0.0, 1.0, 5.0)],
    "everything, by a plane without a normal": [(0.0, 0.0, 0.0, -1.0)],
    "nothing, by a plane without a normal": [(0.0, 0.0, 0.0, 1.0)],
    "parallel to an orthographic view": [(1.0, 0.0, 0.0, 0.1)],
    "many": [(np.sin(k), np.cos(k), 0.1, 0.5 + 0.01 * k) for k in range(200)],
}


@pytest.mark.conforms("Camera.clippingPlanes")
@pytest.mark.parametrize("kind", ["perspective", "lens", "orthographic"])
@pytest.mark.parametrize("name", PLANES)
def test_clipping_planes(name: str, kind: str) -> None:
    planes = PLANES[name]
    cameras = {"perspective": perspective(VIEW, 0.3, 1.6), "lens": LENS, "orthographic": orthographic(VIEW, 0.5, 1.6)}
    camera = replace(
        cameras[kind],
        clipping_range=(0.5, 50.0),
        clipping_planes=tuple((float(a), float(b), float(c), float(e)) for a, b, c, e in planes),
    )
    o, d, near, far = rays(camera, 3000)
    low, high = cut(o, d, planes, 0.5, 50.0)
    seen = high > low
    sure = np.abs(high - low) > 1e-4
    assert ((far > near) == seen)[sure].all()
    np.testing.assert_allclose(near[seen & sure], low[seen & sure], rtol=2e-4, atol=1e-5)
    np.testing.assert_allclose(far[seen & sure], high[seen & sure], rtol=2e-4, atol=1e-5)
    assert np.isfinite(near).all()
    assert (far >= near).all()


@pytest.mark.conforms("Camera.clippingPlanes")
def test_planes_cut_the_image_also_through_gaps() -> None:
    """Quads at depths 1 to 4, the first two half there: what the plane cuts off is not seen, nor through them."""
    quads = [
        (quad([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], i), translation(0, 0, -z)) for i, z in enumerate((1, 2, 3, 4))
    ]
    black = Surface(
        "", use_specular_workflow=True, diffuse_color=(0.0,) * 3, specular_color=(0.0,) * 3, presence=True, thin=True
    )
    surfaces = [replace(black, emissive_color=(e,) * 3, opacity=o) for e, o in ((1.0, 0.5), (2.0, 0.5), (4.0, 1.0), (8.0, 1.0))]

    def mean(*planes: tuple[float, float, float, float]) -> float:
        camera = perspective(np.eye(4), 0.01, clipping_planes=planes)
        scene = describe(quads, surfaces, camera=camera, resolution=(8, 8)).build()
        return float(replicate_means(render(scene, 1024, max_depth=1)).mean())

    # Half of each, and what is behind it through the other half.
    assert mean() == pytest.approx(0.5 + 0.5 * 1 + 0.25 * 4, rel=0.02)
    assert mean((0, 0, -1, -1.5)) == pytest.approx(1 + 0.5 * 4, rel=0.02)  # from depth 1.5 on
    assert mean((0, 0, 1, 2.5)) == pytest.approx(0.5 + 0.5, rel=0.02)  # to depth 2.5: not through the second
    assert mean((0, 0, -1, -1.5), (0, 0, 1, 2.5)) == pytest.approx(1, rel=0.02)


@pytest.mark.conforms("Camera.clippingPlanes")
def test_planes_are_the_cameras_alone() -> None:
    """What is cut off still throws its shadow."""
    shapes = [(ground(3), np.eye(4)), (quad([[-1, 1, 1], [1, 1, 1], [1, 1, -1], [-1, 1, -1]]), np.eye(4))]
    view = look_at([0, 3, 0], [0, 0, 0], up=(0, 0, -1))
    camera = perspective(view, 0.2, clipping_planes=((0.0, 0.0, -1.0, -2.5),))
    scene = describe(shapes, [lambert(0.5)], [light(LightType.DISTANT, look_at([0, 1, 0], [0, 0, 0], up=(1, 0, 0)))], camera)
    assert render(scene.build(), 4, max_depth=1).pixels()[..., :3].max() == 0
    bare = replace(scene, description=replace(scene.description, static=scene.description.static[:1]))
    assert render(bare.build(), 4, max_depth=1).pixels()[..., :3].min() > 0


@pytest.mark.conforms("Camera.clippingRange")
@pytest.mark.parametrize("behind", [1.5, 40.0])
def test_orthographic_cameras_see_behind_themselves(behind: float) -> None:
    camera = orthographic(VIEW, 1.0, clipping_range=(-60.0, 100.0))
    at = VIEW @ translation(0.2, 0.1, behind)
    scene = describe([(Sphere("/s", 0.3, 0), at)], [lambert(0.0, emission=1.0)], camera=camera, resolution=(64, 64)).build()
    pixels = render(scene, 16).pixels()
    assert pixels[..., 3].mean() == pytest.approx(np.pi * 0.3**2 / 4, rel=0.01)
    cuts_off = replace(camera, clipping_planes=((0.0, 0.0, 1.0, -behind - 1),))  # what is not yet further behind
    leaves = replace(camera, clipping_planes=((0.0, 0.0, -1.0, behind + 1),))
    for other, seen in ((replace(camera, clipping_range=(0.0, 100.0)), False), (cuts_off, False), (leaves, True)):
        scene = describe([(Sphere("/s", 0.3, 0), at)], [lambert(0.0, emission=1.0)], camera=other, resolution=(64, 64)).build()
        assert render(scene, 4).pixels().any() == seen


# Times.


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close")
def test_rays_of_a_path_have_one_time() -> None:
    made = SCENES["blades, planes, shutter"]()
    eye = made.description.camera
    motion = CameraMotion(np.array([0.0, 1.0]), (eye, eye))
    exposure = Exposure(-0.2, 0.3, (-0.2, 0.3))
    scene = replace(made, description=replace(made.description, exposure=exposure, camera_motion=motion)).build()
    for lanes in (1, core_module().MAX_LANES):
        recording = core_module().Recording(scene, 8, asked(max_depth=4), lanes)
        shadow, times = recording.times
        camera_rays = render(scene, 8, max_depth=4, splits=1).camera_rays
        assert 0 <= times.min() < 0.01
        assert 0.99 < times.max() < 1
        # As many times as there are paths, whatever rays they have.
        assert len(np.unique(times)) == pytest.approx(camera_rays, rel=0.01)
        assert set(np.unique(times[shadow > 0])) <= set(np.unique(times[shadow == 0]))
        assert np.histogram(np.unique(times), 16, (0, 1))[0] / camera_rays == pytest.approx(1 / 16, rel=0.1)


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close")
def test_an_instant_has_no_times() -> None:
    shadow, times = core_module().Recording(SCENES["materials"]().build(), 4, asked(max_depth=3), 1).times
    assert len(shadow) > 1000
    assert not times.any()
