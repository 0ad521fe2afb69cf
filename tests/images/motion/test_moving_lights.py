"""Lights that move give what they give on average over their way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    quad,
    render,
    rotation,
    translation,
)
from tests.images.motion.motion_scenes import exposed, moving, square

from primray.description import (
    Doubles,
    Light,
    LightType,
    MatrixMotion,
    MovingInstances,
    Placed,
    Placement,
    PointMotion,
    Prototype,
    Shaping,
    Surface,
)

WHITE = lambert(1.0)
DOWN = rotation([1, 0, 0], -90)  # a light's -z to -y
ABOVE = look_at([0, 0.05, 0], [0, 0, 0], [0, 0, -1])


def path(matrices: Sequence[Doubles], times: Sequence[float] = ()) -> MatrixMotion:
    steps = np.array(matrices)
    return MatrixMotion(np.array(times or np.linspace(0, 1, len(steps))), steps, True)


def seen_from_above(lights: Sequence[Light], half: float = 1e-3, **more: object) -> Described:
    """The radiance of a white ground about the origin: irradiance over pi."""
    camera = orthographic(ABOVE, half)
    return exposed(describe([(ground(20.0), np.eye(4))], [WHITE, lambert(0.0, 1.0)], lights, camera, (8, 8), **more))  # type: ignore[arg-type]


def irradiance(scene: Described, spp: int = 2048) -> tuple[float, float]:
    """Mean, and its standard error, of the two replicates' means."""
    film = render(scene.build(), spp, max_depth=1, splits=1, threads=2)
    n = film.counts.astype(np.float64)
    means = film.replicates[..., 0] / n
    pixels = means.mean(axis=0).ravel()
    return float(pixels.mean() * np.pi), float(pixels.std() / np.sqrt(pixels.size) * np.pi)


def close(scene: Described, expected: float, spp: int = 2048) -> None:
    found, error = irradiance(scene, spp)
    assert abs(found - expected) < max(4 * error, 1e-4 * expected), (found, expected, error)
    assert error < 0.02 * expected


def test_a_point_light_on_its_way() -> None:
    """The mean of I h (h^2 + x^2)^-1.5 for x from -s to s: I / (h sqrt(h^2 + s^2))."""
    h, s = 2.0, 3.0
    lamp = replace(
        light(LightType.POINT, translation(-s, h, 0), 5.0), motion=path([translation(-s, h, 0), translation(s, h, 0)])
    )
    close(seen_from_above([lamp]), 5.0 / (h * np.hypot(h, s)))


@pytest.mark.parametrize("kind", [LightType.SPHERE, LightType.RECT, LightType.DISK, LightType.CYLINDER])
@pytest.mark.parametrize("others", [0, 5])
def test_area_lights_as_stills_on_average(kind: LightType, others: int) -> None:
    """As the mean of renders of the light where it stands at 64 times; among others it is chosen by weights, or by a tree."""
    sizes = {"radius": 0.4, "width": 0.8, "height": 1.2, "length": 1.0}

    def stand(t: float) -> Doubles:
        return translation(-3 + 5 * t, 1.5 + t, 0) @ rotation([0, 0, 1], 40 * t - 20) @ DOWN

    rest = [light(LightType.SPHERE, translation(2.0 * k - 4, 3, 2), 0.4, radius=0.2) for k in range(others)]
    lamp = replace(light(kind, stand(0), 3.0, **sizes), motion=path([stand(t) for t in np.linspace(0, 1, 9)]))
    still = [light(kind, stand((k + 0.5) / 64), 3.0 / 64, **sizes) for k in range(64)]
    expected, error = irradiance(seen_from_above([*still, *rest]))
    found, own = irradiance(seen_from_above([lamp, *rest]))
    assert abs(found - expected) < 4 * np.hypot(error, own) + 2e-3 * expected, (found, expected, error, own)


def test_shaping_turns_with_the_light() -> None:
    """A narrow cone that swings over the point shines on it for a part of the time."""
    cone = Shaping(cone_angle_deg=10.0)
    stand = [translation(0, 4, 0) @ rotation([0, 0, 1], a) @ DOWN for a in (-40, 40)]
    lamp = replace(light(LightType.SPHERE, stand[0], 100.0, radius=0.05, shaping=cone), motion=path(stand))
    still = light(LightType.SPHERE, translation(0, 4, 0), 100.0, radius=0.05)
    expected, _ = irradiance(seen_from_above([still]))
    found, error = irradiance(seen_from_above([lamp]))
    assert abs(found - expected * 20 / 80) < 4 * error + 0.01 * expected, (found, expected, error)


def test_a_sun_that_sets() -> None:
    """The mean cosine over angles from 0 to 90 degrees: 2 / pi."""
    stand = [rotation([0, 0, 1], a) @ DOWN for a in (0, 90)]
    sun = replace(light(LightType.DISTANT, stand[0], 2.0), motion=path(stand))
    close(seen_from_above([sun]), 2.0 * 2 / np.pi, 512)


def test_a_dome_that_turns() -> None:
    """Half of a sky bright, turned about the horizontal once around: half a sky's irradiance on average."""
    texture = np.zeros((64, 128, 3), np.float32)
    texture[:32] = 1.0
    stand = [rotation([0, 0, 1], a) for a in np.linspace(0, 360, 5)]
    sky = replace(light(LightType.DOME, np.eye(4), 1.0), motion=path(stand))
    found, error = irradiance(seen_from_above([sky], dome_texture=texture))
    assert abs(found - np.pi / 2) < 4 * error + 0.02, (found, error)
    camera = describe([], [WHITE], [replace(sky, texture=None)], orthographic(ABOVE, 1.0), (4, 4))
    assert render(exposed(camera).build(), 16).pixels()[..., 0].min() > 0.99


def panel(level: MovingInstances, surface: Surface) -> Described:
    shape = replace(square(0.5), surface=1)
    prototypes = [Prototype("/p", (Placed(1, np.eye(4)),))]
    scene = seen_from_above([], prototypes=prototypes, prototype_shapes=[shape], placements=[Placement(0, (level,))])
    return replace(scene, description=replace(scene.description, surfaces=(WHITE, surface)))


def from_panels(centers: np.ndarray, h: float = 2.0) -> float:
    """The mean irradiance at the origin from squares of side 1 and radiance 1 at that height."""
    y = (np.arange(64) + 0.5) / 64 - 0.5
    x, z = np.meshgrid(y, y)
    return float(np.mean([(h * h / ((x + c) ** 2 + z**2 + h * h) ** 2).mean() for c in centers]))


@pytest.mark.parametrize("turns", [False, True])
def test_a_mesh_that_emits_moves(turns: bool) -> None:
    stand = [translation(x, 2, 0) @ DOWN for x in (-3, 3)]
    close(panel(moving(stand, turns=turns), lambert(0.0, 4.0)), 4 * from_panels((np.arange(256) + 0.5) * 6 / 256 - 3))


def test_a_mesh_that_emits_and_deforms() -> None:
    """Its vertices move as the panel did."""
    corners = np.array([[-0.5, 2, -0.5], [0.5, 2, -0.5], [0.5, 2, 0.5], [-0.5, 2, 0.5]])
    shape = quad(corners, 1)
    shape = replace(shape, motion=PointMotion(np.array([0.0, 1.0]), np.stack([corners - [3, 0, 0], corners + [3, 0, 0]])))
    scene = seen_from_above([])
    d = scene.description
    placed = (*d.static, Placed(1, np.eye(4)))
    lit = replace(scene, description=replace(d, shapes=(*d.shapes, shape), static=placed, surfaces=(WHITE, lambert(0.0, 4.0))))
    close(lit, 4 * from_panels((np.arange(256) + 0.5) * 6 / 256 - 3))


def test_a_shadow_that_passes() -> None:
    """A square passes between a sun and the ground: half of the time it hides the point."""
    stand = [translation(x, 2, 0) @ DOWN for x in (-1, 1)]
    scene = panel(moving(stand), lambert(0.5))
    d = scene.description
    sun = light(LightType.DISTANT, DOWN, 1.0)
    camera = orthographic(look_at([0, -50, 0], [0, 0, 0], [0, 0, -1]), 1e-3)
    lit = replace(scene, description=replace(d, lights=(sun,), camera=camera))
    found, error = irradiance(lit, 512)
    # From below the ground is dark; so look from above, past the square's own reflection: only shadows count at depth 1.
    assert found < 1e-6
    past = replace(
        lit, description=replace(lit.description, camera=orthographic(look_at([0, 1, 0], [0, 0, 0], [0, 0, -1]), 1e-3))
    )
    found, error = irradiance(past, 512)
    assert abs(found - 0.5) < 4 * error + 2e-3, (found, error)
