"""Camera rays against Camera.project: windows, offsets, lens; and worlds far from the origin or of another size."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import (
    box,
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

from primray.core.single_precision import rebasing_origin
from primray.description import Camera, Doubles, LightType, Projection, Shape, Sphere

RESOLUTION = (640, 400)
VIEW = look_at([3.0, -2.0, 5.0], [0.1, 0.3, -0.2])
SHIFTED = (-0.3, 0.7, -0.15, 0.4)

CAMERAS: dict[str, Camera] = {
    "perspective": perspective(VIEW, 0.3, 1.6),
    "window off centre": Camera("", VIEW, Projection.PERSPECTIVE, SHIFTED, (0.1, 100.0)),
    "narrow": perspective(VIEW, 0.02, 1.6),
    "wide": perspective(VIEW, 5.0, 1.6),
    "orthographic": orthographic(VIEW, 2.0, 1.6),
    "orthographic off centre": Camera("", VIEW, Projection.ORTHOGRAPHIC, SHIFTED, (0.1, 100.0)),
    "lens": perspective(VIEW, 0.3, 1.6, lens_radius=0.05, focus_distance=4.0),
    "far away": perspective(translation(1e7, -3e7, 2e7) @ VIEW, 0.3, 1.6),
}


def trace(
    camera: Camera, n: int = 5000, lens: float | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Film positions, and origins, directions, near and far of their rays; with a box filter, u = 0.5 is the pixel's centre."""
    rng = np.random.default_rng(1)
    pixel = np.stack([rng.integers(-200, size + 200, n) for size in RESOLUTION], axis=1).astype(
        np.int32
    )  # beyond the frame too
    film = rng.random((n, 2), dtype=np.float32)
    lens_numbers = rng.random((n, 2), dtype=np.float32) if lens is None else np.full((n, 2), lens, np.float32)
    scene = describe([(ground(), np.eye(4))], [lambert(0.5)], camera=camera, resolution=RESOLUTION).build()
    o, d, near, far = kernels().camera_rays(scene, pixel, film, lens_numbers)
    return (
        pixel + film.astype(np.float64),
        o + rebasing_origin(camera),
        d.astype(np.float64),
        near.astype(float),
        far.astype(float),
    )


@pytest.mark.conforms(
    "Camera.projection",
    "Camera.focalLength",
    "Camera.horizontalAperture",
    "Camera.verticalAperture",
    "Camera.horizontalApertureOffset",
    "Camera.verticalApertureOffset",
    "Camera.focusDistance",
)
@pytest.mark.parametrize("name", CAMERAS)
def test_rays_go_where_points_project(name: str) -> None:
    camera = CAMERAS[name]
    film, o, d, _, _ = trace(camera)
    depth = -(d @ camera.world_from_camera[:3, 2])
    distance = camera.focus_distance if camera.lens_radius > 0 else 4.0
    p = o + d * (distance / depth)[:, None]
    assert np.abs(camera.project(p, RESOLUTION) - film).max() < 1e-3
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)


@pytest.mark.conforms("Camera.clippingRange")
@pytest.mark.parametrize("name", CAMERAS)
def test_clipping_is_by_depth(name: str) -> None:
    camera = CAMERAS[name]
    _, _, d, near, far = trace(camera)
    depth = -(d @ camera.world_from_camera[:3, 2])
    np.testing.assert_allclose(near * depth, camera.clipping_range[0], rtol=1e-5)
    np.testing.assert_allclose(far * depth, camera.clipping_range[1], rtol=1e-5)


@pytest.mark.conforms("Camera.fStop", "Camera.focusDistance")
def test_circle_of_confusion() -> None:
    """A point at depth z blurs to a disc of radius lens_radius |z - f| / (z f) at unit distance, evenly filled."""
    camera = CAMERAS["lens"]
    film, o, d, _, _ = trace(camera, 40_000)
    z = 7.0
    p = o + d * (z / -(d @ camera.world_from_camera[:3, 2]))[:, None]
    blur = (camera.project(p, RESOLUTION) - film) * (2 * 0.3 / RESOLUTION[1])
    radius = np.linalg.norm(blur, axis=1)
    exact = 0.05 * (z - 4.0) / (z * 4.0)
    assert radius.max() == pytest.approx(exact, rel=5e-3)
    # The mean square of an even disc is half its radius squared; 40000 samples: standard error 0.3 %.
    assert np.mean(radius**2) == pytest.approx(exact**2 / 2, rel=0.015)
    assert np.abs(blur.mean(axis=0)).max() < 5 * exact / 2 / np.sqrt(len(radius))


@pytest.mark.conforms("Camera.clippingRange")
def test_clipping_cuts_the_image() -> None:
    """White quads at depths 1, 2 and 3; clipping from 1.5 to 2.5 leaves the second."""
    quads = [
        (quad([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]], i), translation(0.5 * (z - 2), 0, -z))
        for i, z in enumerate((1, 2, 3))
    ]
    surfaces = [lambert(0.0, emission=e) for e in (1.0, 2.0, 4.0)]
    camera = perspective(np.eye(4), 0.5, clipping_range=(1.5, 2.5))
    result = render(describe(quads, surfaces, camera=camera, resolution=(40, 40)).build(), 4)
    assert set(np.unique(replicate_means(result)[:, 18:22])) == {0.0, 2.0}
    assert set(np.unique(result.pixels(1.0)[18:22, ..., 3])) == {0.0, 1.0}


@pytest.mark.conforms("Camera.exposure")
def test_exposure_and_coverage() -> None:
    scene = describe(
        [(Sphere("/s", 0.5, 0), translation(0, 0, -3))],
        [lambert(0.0, emission=1.0)],
        camera=perspective(np.eye(4), 0.4),
        resolution=(32, 32),
    )
    pixels = render(scene.build(), 64).pixels(4.0)
    np.testing.assert_allclose(pixels[..., :3], 4 * pixels[..., 3:].repeat(3, axis=2), rtol=1e-6)
    # A sphere of radius r at distance D is a cone of tangent r / sqrt(D^2 - r^2).
    exact = np.pi * (0.5**2 / (9 - 0.25)) / 0.8**2
    assert pixels[..., 3].mean() == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize("away", [(1e6, -2e6, 3e6), (1e8, 0, 1e8)])
def test_far_worlds_look_the_same(away: tuple[float, float, float]) -> None:
    """What is far is rounded where it is described: matrices in double, so to 1e-8 of a unit at 1e8."""
    lights = [light(LightType.RECT, translation(0, 2, 0) @ look_at([0, 0, 0], [0, -1, 0], up=(1, 0, 0)), 3.0)]
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(3), np.eye(4)),
        (box([0.5, 0.5, 0.5]), translation(0, 0.25, 0)),
        (Sphere("/s", 0.3, 0), translation(0.8, 0.3, 0)),
    ]
    here = describe(shapes, [lambert(0.7)], lights, perspective(look_at([0, 1, 3], [0, 0.2, 0]), 0.4), (32, 32))
    a, b = (replicate_means(render(d.build(), 32)).mean(axis=0) for d in (here, here.moved(translation(*away))))
    assert np.mean(np.abs(a - b) < 1e-3) > 0.98
    assert np.mean(a) == pytest.approx(np.mean(b), rel=2e-3)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_scaled_worlds_look_the_same(size: float) -> None:
    lights = [
        light(LightType.SPHERE, translation(0.5, 1.5, 0.5), 3.0, radius=0.3),
        light(LightType.POINT, translation(-1, 1, 1), 1.0),
    ]
    shapes: list[tuple[Shape, Doubles]] = [(ground(3), np.eye(4)), (Sphere("/s", 0.3, 0), translation(0.3, 0.3, 0))]

    def scaled(s: float) -> np.ndarray:
        m = np.diag([s, s, s, 1.0])
        camera = look_at([0, 1, 3], [0, 0.2, 0])
        camera[:3, 3] *= s
        point = light(LightType.POINT, m @ lights[1].world_from_light, float(s * s))
        d = describe(
            [(shape, m @ matrix) for shape, matrix in shapes], [lambert(0.7)],
            [light(LightType.SPHERE, m @ lights[0].world_from_light, 3.0, radius=0.3), point],
            perspective(camera, 0.4, clipping_range=(1e-3 * s, 1e6 * s)), (32, 32),
        )  # fmt: skip
        return replicate_means(render(d.build(), 32)).mean(axis=0)

    a, b = scaled(1.0), scaled(size)
    assert np.mean(np.abs(a - b) < 1e-3 * a.mean()) > 0.98
