"""Domes with portals that move: pictures are those of domes without, and portals stay before what they guide samples to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.described import Described, lambert, light, mesh, render, rotation, translation
from tests.images.motion.motion_scenes import moving
from tests.images.motion.test_moving_lights import DOWN, WHITE, from_panels, irradiance, path, seen_from_above

from primray.description import Doubles, Light, LightType, Mesh, MovingInstances, Placed, Placement, Portal, Prototype

BLACK = lambert(0.0)
HEIGHT = 2.0


def roof(outer: float = 4000.0, hole: float = 0.5) -> Mesh:
    """A black square in the XY plane with a square hole of side 1 about its middle."""
    ring = [[s, s, 0] for s in (hole, outer)]
    corners = [[x * sx, y * sy, 0] for x, y, _ in ring for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    triangles = [t for i in range(4) for j in [(i + 1) % 4] for t in ([i, j, 4 + j], [i, 4 + j, 4 + i])]
    return replace(mesh(corners, triangles), surface=1)


def under(level: MovingInstances, dome: Light, texture: np.ndarray | None = None) -> Described:
    scene = seen_from_above(
        [dome], prototypes=[Prototype("/p", (Placed(1, np.eye(4)),))], prototype_shapes=[roof()],
        placements=[Placement(0, (level,))], dome_texture=texture,
    )  # fmt: skip
    return replace(scene, description=replace(scene.description, surfaces=(WHITE, BLACK)))


def window(stands: Sequence[Doubles], moves: bool) -> Portal:
    return Portal(stands[0], 1.0, 1.0, path(stands) if moves else None)


def sky(portals: Sequence[Portal] = (), **more: object) -> Light:
    return light(LightType.DOME, np.eye(4), 1.0, portals=tuple(portals), **more)


SHIFT = [translation(x, HEIGHT, 0.2) @ DOWN for x in (-3, 3)]


@pytest.mark.parametrize("count", [1, 20])
def test_a_portal_that_goes_with_its_window(count: int) -> None:
    """The mean irradiance through a hole that passes, with far less noise than with a portal that stays."""
    centers = (np.arange(256) + 0.5) * 6 / 256 - 3
    y = (np.arange(64) + 0.5) / 64 - 0.5
    x, z = np.meshgrid(y, y)
    h = HEIGHT
    expected = float(np.mean([(h * h / ((x + c) ** 2 + (z + 0.2) ** 2 + h * h) ** 2).mean() for c in centers]))
    far = [[translation(30 + 2 * k, HEIGHT, 30) @ m for m in SHIFT] for k in range(count - 1)]  # those weigh little
    errors = []
    for moves in (True, False):
        portals = [window(SHIFT, moves), *(window(stands, moves) for stands in far)]
        found, error = irradiance(under(moving(SHIFT), sky(portals)), 512)
        errors.append(error)
        assert abs(found - expected) < 4 * error + 1e-4 * expected, (moves, found, expected, error)
    assert errors[0] < 0.4 * errors[1], errors


def test_a_portal_that_turns() -> None:
    """A lid that swings: its hole slants, and some of the sky is seen beside it."""
    stands = [translation(0, HEIGHT, 0) @ rotation([0, 0, 1], a) @ DOWN for a in (-50, -10, 60)]
    times = [0.0, 0.3, 1.0]
    level = moving(stands, times, turns=True)
    with_portal = sky([replace(window(stands, True), motion=path(stands, times))])
    found, error = irradiance(under(level, with_portal), 1024)
    expected, own = irradiance(under(level, sky()), 4096)
    assert abs(found - expected) < 4 * np.hypot(error, own), (found, expected, error, own)


def test_a_sky_that_turns_behind_its_window() -> None:
    """Samples through the portal see the sky as it stands then."""
    texture = np.zeros((64, 128, 3), np.float32)
    texture[:, :64] = 1.0
    spin = path([rotation([0, 1, 0], a) for a in (0, 120, 240)])
    stands = [translation(0.8, HEIGHT, 0) @ DOWN] * 2
    portals = [Portal(stands[0], 1.0, 1.0)]
    plain = under(moving(stands), replace(sky(), motion=spin), texture)
    expected, own = irradiance(plain, 4096)
    found, error = irradiance(under(moving(stands), replace(sky(portals), motion=spin), texture), 1024)
    assert abs(found - expected) < 4 * np.hypot(error, own), (found, expected, error, own)
    still, _ = irradiance(under(moving(stands), sky(), texture), 1024)
    assert abs(still - expected) > 20 * own


def test_bits_do_not_depend_on_lanes() -> None:
    texture = np.random.default_rng(1).random((16, 32, 3)).astype(np.float32)
    stands = [translation(0, HEIGHT, 0) @ rotation([0, 0, 1], a) @ DOWN for a in (-50, 60)]
    spin = path([rotation([0, 1, 0], a) for a in (0, 120)])
    built = under(moving(stands, turns=True), replace(sky([window(stands, True)]), motion=spin), texture).build()
    first = render(built, 16, lanes=1).pixels()
    assert first[..., :3].mean() > 0.01
    for lanes, threads in ((4, 1), (8, 2), (8, 5)):
        np.testing.assert_array_equal(first, render(built, 16, lanes=lanes, threads=threads).pixels())


def test_the_middle_of_a_way() -> None:
    """What the first test's oracle says of a hole that stays."""
    stands = [translation(0, HEIGHT, 0) @ DOWN] * 2
    found, error = irradiance(under(moving(stands), sky([Portal(stands[0], 1.0, 1.0)])), 256)
    assert abs(found - from_panels(np.zeros(1))) < 4 * error + 1e-4
