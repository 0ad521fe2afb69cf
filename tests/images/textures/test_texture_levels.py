"""Mip levels: distant patterns show their mean without noise or bias, and levels that no ray can need are not kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    image,
    kernels,
    look_at,
    perspective,
    placement,
    render,
    scaling,
    translation,
)
from tests.textured import FILE, UNIT_ST, glowing, look_at_plate, plate, texture

from primray.core.scene_upload import upload
from primray.description import Placed, Prototype, Wrap

SIZE = 256
CHECKER = (np.indices((SIZE, SIZE)).sum(axis=0) % 2).astype(np.float32)
EVERY = glowing(texture("r", wrap=Wrap.REPEAT))


def distant(distance: float, tilt: float = 0.0, resolution: int = 16) -> Described:
    """A plate that fills the view at a distance, a checkerboard of 2 x 2 / 256 its own size; seen at an angle of `tilt`."""
    eye = [0.0, distance * np.sin(np.radians(tilt)), distance * np.cos(np.radians(tilt))]
    mesh = plate(np.asarray(UNIT_ST, float) * 40, half=40.0)
    return describe(
        [(mesh, np.eye(4))], [EVERY], camera=perspective(look_at(eye, [0, 0, 0]), 0.3), resolution=(resolution,) * 2,
        textures={FILE: image(CHECKER)},
    )  # fmt: skip


def unfiltered(described: Described, samples: int) -> np.ndarray:
    """The picture from the texels themselves, random points of every pixel, in double."""
    camera, (w, h) = described.description.camera, described.description.resolution
    rng = np.random.default_rng(0)
    x, y = rng.random((2, h, w, samples)) + np.stack(np.meshgrid(np.arange(w), np.arange(h)))[..., None]
    left, right, bottom, top = camera.window
    d = np.stack([left + x / w * (right - left), top - y / h * (top - bottom), -np.ones_like(x)], axis=-1)
    m = camera.world_from_camera
    d = d @ m[:3, :3].T
    p = m[:3, 3] - d * (m[2, 3] / d[..., 2:])
    st = (p[..., :2] / 80 + 0.5) * 40
    texel = np.floor(st * SIZE).astype(int) % SIZE
    return CHECKER[SIZE - 1 - texel[..., 1], texel[..., 0]].mean(axis=-1)


@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_a_distant_checkerboard_has_its_mean(tilt: float) -> None:
    d = distant(10.0, tilt)
    got = render(d.build(), 2).pixels(1.0)[..., 0]
    truth = unfiltered(d, 4096)
    assert abs(got.mean() - truth.mean()) < 3e-3
    # Two samples without filtering have a spread of 0.35 about it.
    assert unfiltered(d, 2).std() > 0.3
    assert got.std() < 0.02


def test_a_near_checkerboard_is_sharp() -> None:
    """Where a texel is 4 pixels wide, the picture is the finest level's."""
    st = np.asarray(UNIT_ST, float) * 8 / SIZE
    d = look_at_plate(EVERY, {FILE: image(CHECKER)}, (32, 32), plate(st))
    got = render(d.build(), 64).pixels(1.0)[..., 0]
    x = (np.arange(32 * 16) + 0.5) / (32 * 16)
    at = np.stack(np.meshgrid(x, 1 - x), axis=-1).reshape(-1, 2) * st[2]
    fine = kernels().texture_lookup(CHECKER[:, :, None], 2, 2, 0, at.astype(np.float32), np.zeros(len(at), np.float32))
    np.testing.assert_allclose(got, fine.reshape(32, 16, 32, 16).mean(axis=(1, 3)), atol=0.01)
    assert got.max() - got.min() > 0.5


@pytest.mark.parametrize(("pixels_per_texel", "level"), [(0.25, 1.0), (0.125, 2.0), (1.0 / 32, 4.0)])
def test_the_level_is_that_of_half_a_pixel(pixels_per_texel: float, level: float) -> None:
    """Noise looks different in every level, and so tells which one was read."""
    size, resolution = 256, 8
    noise = np.random.default_rng(0).random((size, size), np.float32)
    # Off the texels' borders, where neighbouring levels agree.
    offset, extent = 0.3 / pixels_per_texel / size, resolution / pixels_per_texel / size
    st = np.asarray(UNIT_ST, float) * extent + offset
    d = look_at_plate(EVERY, {FILE: image(noise)}, (resolution, resolution), plate(st))
    got = render(d.build(filter_width=1e-3), 2).pixels(1.0)[..., 0].ravel()
    x, y = np.meshgrid((np.arange(resolution) + 0.5) / resolution, 1 - (np.arange(resolution) + 0.5) / resolution)
    at = (np.stack([x, y], axis=-1) * extent + offset).reshape(-1, 2).astype(np.float32)
    wanted = [
        kernels().texture_lookup(noise[:, :, None], 2, 2, 0, at, np.full(len(at), k, np.float32)).ravel()
        for k in (level - 1, level, level + 1)
    ]
    np.testing.assert_allclose(got, wanted[1], atol=2e-3)
    assert min(np.abs(got - w).max() for w in wanted[::2]) > 0.01


def kept(described: Described) -> tuple[int, int]:
    """First level and bytes of the one texture."""
    [info] = described.build().texture_images
    return int(info["first_level"]), int(info["bytes"])


def test_levels_that_no_ray_can_need_are_not_kept() -> None:
    """1024 x 1024 texels on a plate 64 pixels across: two levels fewer, a sixteenth of the memory."""

    def at(resolution: int) -> Described:
        texels = np.random.default_rng(0).random((1024, 1024, 3))
        return look_at_plate(glowing(texture()), {FILE: image(texels)}, (resolution, resolution))

    whole, far = kept(at(1024)), kept(at(64))
    assert whole[0] == 0
    # Half floats: 2 bytes a channel, a third more for the pyramid.
    assert whole[1] == pytest.approx(1024 * 1024 * 3 * 2 * 4 / 3, rel=1e-4)
    assert far[0] == 2  # a footprint is half a pixel: 8 texels, less the margin for rounding
    assert far[1] < whole[1] / 15


def test_images_are_let_go_when_the_core_has_them() -> None:
    d = look_at_plate(glowing(texture()), {FILE: image(np.ones((4, 4, 3)))}, (4, 4))
    taken = {file: list(tiles) for file, tiles in d.textures.items()}
    upload(d.description, taken, 1.0, np.zeros(0, np.float32))
    assert taken == {}


def test_the_bound_counts_distance_scale_and_instances() -> None:
    def first(distance: float, scale: float, *, instanced: bool) -> int:
        m = translation(0, 0, -distance) @ scaling(scale, scale, scale)
        camera = perspective(np.eye(4), 0.5)
        textures = {FILE: image(np.random.default_rng(0).random((512, 512)))}
        surfaces = [glowing(texture("r"))]
        if not instanced:
            return kept(describe([(plate(), m)], surfaces, camera=camera, resolution=(512, 512), textures=textures))[0]
        return kept(describe(
            surfaces=surfaces, camera=camera, resolution=(512, 512), textures=textures, prototype_shapes=[plate()],
            prototypes=[Prototype("/p", (Placed(0, np.eye(4)),))], placements=[placement(0, m[None, :3])],
        ))[0]  # fmt: skip

    for instanced in (False, True):
        levels = [first(100.0 * 2**k, 1.0, instanced=instanced) for k in range(4)]
        assert levels == list(range(levels[0], levels[0] + 4))
        assert first(400.0, 4.0, instanced=instanced) == levels[0]


def test_where_the_camera_may_touch_a_surface_every_level_is_kept() -> None:
    camera = perspective(np.eye(4), 0.5, clipping_range=(0.0, 1e6))
    textures = {FILE: image(np.random.default_rng(0).random((64, 64)))}
    for shape, m in ((plate(half=9), np.eye(4)), (plate(half=9), translation(0, 0, -40))):
        d = describe([(shape, m)], [glowing(texture("r"))], camera=camera, resolution=(8, 8), textures=textures)
        assert (kept(d)[0] == 0) == (m[2, 3] == 0)


def test_dropping_levels_changes_nothing() -> None:
    """The same picture where a second plate, behind the camera but near it, keeps all of the texture's levels."""
    far = distant(30.0)
    d = far.description
    near = plate(0.1 * np.asarray(UNIT_ST), half=1e-3)
    both = replace(far, description=replace(
        d, shapes=(*d.shapes, near), static=(*d.static, Placed(1, d.camera.world_from_camera @ translation(0, 0, 1e-3))),
    ))  # fmt: skip
    assert kept(far)[0] > 0
    assert kept(both)[0] == 0
    a, b = (render(x.build(), 4).pixels(1.0) for x in (far, both))
    np.testing.assert_allclose(a, b, atol=1e-6)
