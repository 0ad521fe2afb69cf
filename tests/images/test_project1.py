"""The box of CSE 168's first project, from its stage: pixels wholly inside a face or the sky against the closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import primray

STAGE = Path(__file__).parents[2] / "scenes/analytic/cse168_project1.usda"
HALF = np.array([0.25, 0.1, 0.15])
LIGHT = np.array([1.0, 2.0, 1.5])
INTENSITY = 10 * np.array([1.0, 0.2, 0.2])
SKY = np.array([0.8, 0.9, 1.0])
EYE = np.array([0.0, 2.0, 5.0])
WIDTH, HEIGHT = 800, 600


def radiance(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Exact radiance (N, 3) and face (N,), 0 for the sky, through film points in pixels; a convex box shadows nothing."""
    tan = np.tan(np.radians(25))
    sx, sy = (2 * x / WIDTH - 1) * tan * 1.33, (1 - 2 * y / HEIGHT) * tan
    back = EYE / np.linalg.norm(EYE)
    right = np.array([1.0, 0.0, 0.0])
    up = np.cross(back, right)
    d = sx[:, None] * right + sy[:, None] * up - back
    with np.errstate(divide="ignore", invalid="ignore"):
        t0, t1 = (-HALF - EYE) / d, (HALF - EYE) / d
    enter, leave = np.minimum(t0, t1), np.maximum(t0, t1)
    axis = np.argmax(enter, axis=1)
    t = enter[np.arange(len(d)), axis]
    hit = t < leave.min(axis=1)
    p = EYE + t[:, None] * d
    normal = np.zeros_like(d)
    normal[np.arange(len(d)), axis] = -np.sign(d[np.arange(len(d)), axis])
    to_light = LIGHT - p
    r2 = np.sum(to_light**2, axis=1)
    cosine = np.maximum(np.sum(normal * to_light, axis=1), 0) / np.sqrt(r2)
    L = np.where(hit[:, None], INTENSITY * (cosine / r2)[:, None] / np.pi, SKY)
    return L, np.where(hit, 1 + axis, 0)


def test_every_pixel_inside_a_face_or_the_sky() -> None:
    settings = primray.RenderSettings(spp=64, filter=primray.Filter.BOX)
    image = primray.render(str(STAGE), settings)
    assert image.pixels.shape == (HEIGHT, WIDTH, 4)
    # The rows and columns around the box; all else is sky, checked below.
    ys, xs = np.mgrid[220:400, 300:500]
    corners = [radiance((xs + i).ravel(), (ys + j).ravel())[1] for i in (0, 1) for j in (0, 1)]
    inside = np.all([c == corners[0] for c in corners], axis=0)
    steps = (np.arange(4) + 0.5) / 4
    exact = np.mean([radiance((xs + i).ravel(), (ys + j).ravel())[0] for i in steps for j in steps], axis=0)
    measured = image.pixels[220:400, 300:500, :3].reshape(-1, 3)
    relative = np.abs(measured - exact)[inside] / exact[inside]
    assert len(set(corners[0][inside])) == 3  # the sky, the top and the front
    assert relative.max() < 1e-4
    outside = np.ones((HEIGHT, WIDTH), bool)
    outside[220:400, 300:500] = False
    np.testing.assert_allclose(image.pixels[outside][:, :3], np.broadcast_to(SKY, (outside.sum(), 3)), rtol=1e-6)
