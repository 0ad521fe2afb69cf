"""Geometry that emits and moves is sampled where it stands at the rays' times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.described import Described, lambert, light, render, rotation, scaling, translation
from tests.images.motion.motion_scenes import moving, square
from tests.images.motion.test_moving_lights import DOWN, WHITE, close, irradiance, seen_from_above
from tests.statistics.lights.shaping import shaped
from tests.statistics.lights.test_shaping import ALL_ROUND

from primray.description import (
    Doubles,
    Light,
    LightType,
    MatrixInstances,
    MovingInstances,
    Placed,
    Placement,
    Prototype,
    Shadow,
    Shape,
    Shaping,
    Sphere,
)

GLOW = lambert(0.0, 4.0)
RADIUS = 0.1
HERE = np.eye(4)


def lit_by(
    shape: Shape, level: MovingInstances | MatrixInstances, lights: list[Light] | None = None, inside: Doubles = HERE
) -> Described:
    """A white ground below instances of a shape that wears GLOW and stands so in its prototype."""
    scene = seen_from_above(
        lights or [], prototypes=[Prototype("/p", (Placed(1, inside),))], prototype_shapes=[replace(shape, surface=1)],
        placements=[Placement(0, (level,))],
    )  # fmt: skip
    return replace(scene, description=replace(scene.description, surfaces=(WHITE, GLOW)))


def from_spheres(centers: np.ndarray, radius: float = RADIUS) -> float:
    """The mean irradiance at the origin from spheres of radiance 4 (K, 3), all above the ground: pi L r^2 cos / d^2."""
    d2 = (centers**2).sum(axis=1)
    return float(np.mean(np.pi * 4 * radius**2 * centers[:, 1] / d2**1.5))


def middles(count: int = 512) -> np.ndarray:
    return (np.arange(count) + 0.5) / count


def lamps(count: int) -> list[Light]:
    return [light(LightType.SPHERE, translation(2.0 * k - 4, 3, 2), 0.01, radius=0.2) for k in range(count)]


def background(count: int) -> float:
    centers = np.array([[2.0 * k - 4, 3, 2] for k in range(count)])
    return 0.01 / 4 * count * from_spheres(centers, 0.2) if count else 0.0


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("others", [0, 2, 6])
def test_a_sphere_that_emits_moves(turns: bool, others: int) -> None:
    """Among others it is chosen by weights, or by a tree."""
    stand = [translation(-3, 1, 0), translation(3, 2, 0)]
    t = middles()[:, None]
    path = np.array([[-3.0, 1, 0]]) * (1 - t) + np.array([[3.0, 2, 0]]) * t
    scene = lit_by(Sphere("/s", RADIUS, 1), moving(stand, turns=turns), lamps(others))
    close(scene, from_spheres(path) + background(others))


def test_a_sphere_that_swings() -> None:
    """Off the centre about which it turns, in uneven segments."""
    angles, times = (-80.0, 0.0, 60.0), [0.0, 0.25, 1.0]
    stand = [translation(0, 0.2, 0) @ rotation([0, 0, 1], a) for a in angles]
    now = np.radians(np.interp(middles(), times, angles))
    path = np.stack([-2 * np.sin(now), 0.2 + 2 * np.cos(now), 0 * now], axis=1)
    scene = lit_by(Sphere("/s", RADIUS, 1), moving(stand, times, turns=True), inside=translation(0, 2, 0))
    close(scene, from_spheres(path))


@pytest.mark.parametrize("turns", [False, True])
def test_ellipsoids_as_stills_on_average(turns: bool) -> None:
    """A sphere that its instance stretches, turns and makes larger."""
    stand = [
        translation(-2, 1.5, 0) @ rotation([0, 0, 1], -30) @ scaling(1, 3, 2),
        translation(2, 2, 1) @ rotation([0, 0, 1], 50) @ scaling(3, 1, 4),
    ]
    level = moving(stand, turns=turns)
    found, own = irradiance(lit_by(Sphere("/s", RADIUS, 1), level))
    # As many stills as one scene can hold, each of them dimmer.
    expected, errors = zip(
        *(irradiance(lit_by(Sphere("/s", RADIUS, 1), at_time(level, (k + 0.5) / 16)), 256) for k in range(16)), strict=True
    )
    error = float(np.hypot(own, np.linalg.norm(errors) / 16))
    assert abs(found - np.mean(expected)) < 4 * error + 2e-3 * found, (found, np.mean(expected), error)
    assert own < 0.01 * found


def at_time(level: MovingInstances, t: float) -> MatrixInstances:
    from primray.usd.motion.matrices import interpolated_matrices, polar_decomposition

    a, b = level.matrices[0], level.matrices[1]
    m = interpolated_matrices(polar_decomposition(a), polar_decomposition(b), t) if level.turns else a + t * (b - a)
    return MatrixInstances(m)


def swinging(t: float) -> Doubles:
    """Turns about two axes, off the point below."""
    return translation(0.5, 4, 0.2) @ rotation([0, 0, 1], 80 * t - 40) @ rotation([1, 0, 0], -90)


def spinning(t: float) -> Doubles:
    """Turns about the way that it looks, which slants."""
    return translation(-1.5, 3, 0.2) @ rotation([0, 0, 1], 20) @ DOWN @ rotation([0, 0, 1], 90 * t + 10)


TURNS = {"swinging": swinging, "spinning": spinning}
SHAPINGS = {
    "cone": Shaping(cone_angle_deg=15.0, cone_softness=0.6),
    "focus": Shaping(focus=8.0, focus_tint=(0.1, 0.1, 0.1)),
    "profile": Shaping(ies=ALL_ROUND),
}
SHAPES: dict[str, tuple[Shape, float]] = {"sphere": (Sphere("/s", 0.1, 1), 0.0), "panel": (square(0.2), 0.2)}


def quadrature(lamp: Light, stand: Callable[[float], Doubles], half: float, steps: int = 400) -> float:
    """Mean irradiance at the origin over the turn; `half`: of a square's side, 0: the sphere."""
    total = 0.0
    for t in middles(steps):
        m = stand(t)
        now = replace(lamp, world_from_light=m)
        if half > 0:
            x, y = (a.ravel() * half for a in np.meshgrid(2 * middles(12) - 1, 2 * middles(12) - 1))
            p = np.stack([x, y, 0 * x], axis=1) @ m[:3, :3].T + m[:3, 3]
            d = np.linalg.norm(p, axis=1)
            weight = np.abs(p @ m[:3, 2]) / d**3 * (2 * half) ** 2 / len(p)
        else:
            r2, phi = (a.ravel() for a in np.meshgrid(middles(6), 2 * np.pi * middles(24)))
            c = m[:3, 3]
            far2 = c @ c
            sine2 = r2 * 0.1**2 / far2
            n = c / np.sqrt(far2)
            u = np.cross(n, [1.0, 0, 0]) / np.linalg.norm(np.cross(n, [1.0, 0, 0]))
            ring = np.outer(np.cos(phi), u) + np.outer(np.sin(phi), np.cross(n, u))
            p = n * np.sqrt(1 - sine2)[:, None] + ring * np.sqrt(sine2)[:, None]
            d = np.ones(len(p))
            weight = np.full(len(p), np.pi * 0.1**2 / far2 / len(p))
        w = p / d[:, None]
        total += float((shaped(now, -w)[:, 1] * w[:, 1] * weight).sum())
    return lamp.emission[1] * total / steps


@pytest.mark.parametrize("shaping", SHAPINGS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("others", [0, 6])
def test_shaping_turns_with_the_shape(shaping: str, shape: str, turn: str, others: int) -> None:
    made, half = SHAPES[shape]
    lamp = light(LightType.GEOMETRY, None, 50.0, shaping=SHAPINGS[shaping], own_color=True)
    stand = TURNS[turn]
    scene = lit_by(replace(made, light=lamp), moving([stand(t) for t in (0, 0.4, 1)], [0, 0.4, 1], turns=True), lamps(others))
    found, error = irradiance(scene, 4096)
    expected = quadrature(lamp, stand, half) + background(others)
    assert abs(found - expected) < 4 * error + 2e-3 * expected, (found, expected, error)
    assert error < 0.03 * expected


def test_bits_do_not_depend_on_lanes_or_threads() -> None:
    """Spheres that stretch, and shaped shapes that turn, some with special shadows, beside others that stand."""
    cone = light(LightType.GEOMETRY, None, 50.0, shaping=SHAPINGS["cone"], own_color=True)
    profile = replace(cone, shaping=SHAPINGS["profile"], shadow=Shadow(color=(0.2, 0.1, 0.3)))
    shapes = [Sphere("/s", 0.2, 1), replace(square(0.2), light=cone, surface=1), Sphere("/t", 0.1, 1, light=profile)]
    placed = [Placed(k + 1, translation(0.4 * k, 0, 0)) for k in range(3)]
    stretched = [swinging(t) @ scaling(1 + t, 1, 1 - 0.5 * t) for t in (0, 0.4, 1)]
    scene = seen_from_above(
        lamps(3), half=1.0, prototypes=[Prototype("/p", tuple(placed))], prototype_shapes=shapes,
        placements=[Placement(0, (moving(stretched, [0, 0.4, 1], turns=True),)), Placement(0, (moving(stretched[::2]),)),
                    Placement(0, (MatrixInstances(translation(1, 1, 1)[None, :3]),))],
    )  # fmt: skip
    built = replace(scene, description=replace(scene.description, surfaces=(WHITE, GLOW))).build()
    first = render(built, 32, lanes=1).pixels()
    assert first[..., :3].mean() > 0.01
    for lanes, threads in ((4, 1), (8, 2), (8, 5), (1, 2)):
        again = render(built, 32, lanes=lanes, threads=threads).pixels()
        np.testing.assert_array_equal(first, again, err_msg=f"{lanes} lanes, {threads} threads")
