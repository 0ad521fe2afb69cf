"""Dicing a whole description: how fine each cage becomes by where it stands, its limits, and what its mesh carries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.cages import cube, grid
from tests.described import describe, lambert, light, look_at, orthographic, perspective, rotation, scaling, translation

from primray import core
from primray.description import (
    Interpolation,
    LightType,
    MatrixInstances,
    Mesh,
    Placed,
    Placement,
    Primvar,
    Prototype,
    SceneDescription,
    SubdivisionMesh,
)
from primray.description.shading import PrimvarInput
from primray.settings import RenderSettings
from primray.tessellation.dice import Dicing, dice, dicing_by_settings
from primray.tessellation.footprint import MAX_LEVEL, footprints

CAMERA = perspective(look_at([0, 0, 10], [0, 0, 0]), 0.2)  # 4 units high at the origin


def scene(*placed: tuple[SubdivisionMesh, Any], camera: Any = CAMERA, size: int = 256) -> SceneDescription:
    made = describe(list(placed), [lambert(0.5)], camera=camera)
    return replace(made.description, resolution=(size, size))


def instanced(cage: SubdivisionMesh, rows: Any, camera: Any = CAMERA) -> SceneDescription:
    prototype = Prototype("/p", (Placed(0, np.eye(4)),))
    made = describe(
        [],
        [lambert(0.5)],
        prototypes=[prototype],
        prototype_shapes=(cage,),
        placements=[Placement(0, (MatrixInstances(rows),))],
        camera=camera,
    )
    return replace(made.description, resolution=(256, 256))


def diced(description: SceneDescription, pixels: float = 8.0, **more: Any) -> tuple[list[Mesh], list[str]]:
    made, warnings = dice(core.compiled, description, Dicing(pixels, **more), 2)
    meshes = [s for s in made.shapes if isinstance(s, Mesh)]
    assert len(meshes) == len(made.shapes)
    return meshes, [code for code, _, _ in warnings]


def test_nearer_is_finer() -> None:
    far, near = (len(diced(scene((cube(), translation(0, 0, z))))[0][0].triangles) for z in (-40, 0))
    assert near > 8 * far


def test_size_counts_whichever_matrix_it_is_in() -> None:
    a = diced(scene((cube(), scaling(0.5, 0.5, 0.5))))[0][0]
    b = diced(scene((replace(cube(), points=cube().points * np.float32(0.5)), np.eye(4))))[0][0]
    assert len(a.triangles) == len(b.triangles)
    turned = diced(scene((cube(), rotation([1, 2, 3], 50) @ scaling(0.5, -0.5, 0.5))))[0][0]
    assert 0.5 < len(turned.triangles) / len(a.triangles) < 2


def test_outside_the_view_is_coarser() -> None:
    inside, outside = (len(diced(scene((cube(), translation(x, 0, 0))))[0][0].triangles) for x in (0, 6))
    assert 4 < inside / outside < 64
    behind = len(diced(scene((cube(), translation(0, 0, 20))))[0][0].triangles)
    assert behind < inside / 4


def test_orthographic() -> None:
    camera = orthographic(look_at([0, 0, 10], [0, 0, 0]), 2.0)
    near, far = (len(diced(scene((cube(), translation(0, 0, z)), camera=camera))[0][0].triangles) for z in (5, -500))
    assert near == far
    assert len(diced(scene((cube(), np.eye(4)), camera=camera), 16.0)[0][0].triangles) < near / 2


def test_a_plane_towards_the_camera_is_finest_in_front() -> None:
    ground = replace(grid(4, 4), points=(grid(4, 4).points - np.array([2, 2, 0], np.float32)) * np.float32(100))
    camera = perspective(look_at([0, 0, 2], [0, 100, 0], (0, 0, 1)), 0.4)
    (mesh,), codes = diced(scene((ground, np.eye(4)), camera=camera), flatness=0.0)
    assert len(mesh.triangles) < 60_000
    p = mesh.points[mesh.triangles].astype(np.float64)
    size = np.linalg.norm(p[:, 0] - p[:, 1], axis=1)
    distance = np.linalg.norm(p.mean(axis=1) - [0, 0, 2], axis=1)
    front = p[:, :, 1].min(axis=1) > 0
    assert size[front & (distance < 10)].max() < size[front & (distance > 100)].max() / 4
    assert codes == []


def test_instances_take_the_most_demanding() -> None:
    matrices = [translation(0, 0, z) for z in (-200, -100, 0)] + [scaling(0.01, 0.01, 0.01)]
    rows = np.array([m[:3] for m in matrices])
    together = diced(instanced(cube(), rows))[0][0]
    alone = diced(instanced(cube(), rows[2:3]))[0][0]
    assert len(together.triangles) == len(alone.triangles)
    many = np.repeat(rows[2:3], 50, axis=0)  # more than are looked at one by one
    assert len(diced(instanced(cube(), many))[0][0].triangles) >= len(alone.triangles)


def test_a_million_instances_are_cheap() -> None:
    """Looked at in whole arrays; the bound is some ten times what it takes."""
    import time

    rng = np.random.default_rng(0)
    rows = np.zeros((1_000_000, 3, 4))
    rows[:, [0, 1, 2], [0, 1, 2]] = 0.1
    rows[:, :, 3] = rng.uniform(-500, 0, (len(rows), 3))
    rows[123, 0, 0] = np.nan
    description = instanced(cube(), rows)
    start = time.process_time()
    (footprint,) = footprints(description).values()
    assert time.process_time() - start < 10
    assert len(footprint.views) == 4
    assert np.isfinite(footprint.density)
    best = np.argmin(np.linalg.norm(rows[:, :, 3] - [0, 0, 10], axis=1))
    density = 0.1 * 256 / 0.4 / np.linalg.norm(rows[best, :, 3] - [0, 0, 10])
    assert 0 < footprint.density < 1.5 * density


def test_camera_inside_a_cage() -> None:
    camera = perspective(look_at([0.1, 0, 0], [1, 0.2, 0]), 0.5)
    (mesh,), _ = diced(scene((cube(), np.eye(4)), camera=camera))
    assert 1000 < len(mesh.triangles) < 500_000


def test_levels_are_limited() -> None:
    close = perspective(look_at([0, 0, 1.0], [0, 0, 0]), 0.001)
    (mesh,), codes = diced(scene((cube(), translation(0, 0, 0.2)), camera=close), 0.5, max_level=4)
    assert codes == ["dicing-limited"]
    assert len(mesh.triangles) <= 6 * 4**4 * 2
    assert MAX_LEVEL == 10


def test_triangles_are_limited_in_all() -> None:
    description = scene(*((cube(), translation(x, 0, 0)) for x in (-1, 0, 1)))
    free, _ = diced(description, 1.0)
    meshes, codes = diced(description, 1.0, max_triangles=20_000)
    assert sum(len(m.triangles) for m in free) > 100_000
    assert 2_000 < sum(len(m.triangles) for m in meshes) <= 20_000
    assert codes == ["dicing-limited"]
    meshes, codes = diced(description, 1.0, max_triangles=3)  # fewer than the cages themselves have
    assert codes == ["dicing-limited"]
    assert all(len(m.triangles) >= 12 for m in meshes)


def test_memory_limits_triangles() -> None:
    assert dicing_by_settings(RenderSettings(max_memory_bytes=1 << 20)).max_triangles < 4000
    assert dicing_by_settings(RenderSettings(dicing_rate=2.5)).pixels == 2.5


def test_threads_do_not_matter() -> None:
    description = scene(*((cube(), translation(x, 0, 0)) for x in (-1, 0, 1)))
    for a, b in zip(*(dice(core.compiled, description, Dicing(4.0), n)[0].shapes for n in (1, 3)), strict=True):
        assert isinstance(a, Mesh)
        assert isinstance(b, Mesh)
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.triangles, b.triangles)


def coloured(interpolation: Interpolation, rows: int, **more: Any) -> SubdivisionMesh:
    values = np.random.default_rng(3).random((rows, 3)).astype(np.float32)
    return cube(colors=Primvar("displayColor", interpolation, values), **more)


@pytest.mark.parametrize("pixels", [4.0, 1e5])
@pytest.mark.parametrize(
    ("interpolation", "rows"),
    [
        (Interpolation.FACE, 6),
        (Interpolation.POINT, 8),
        (Interpolation.VARYING, 8),
        (Interpolation.CORNER, 24),
        (Interpolation.CONSTANT, 1),
    ],
)
def test_colors_and_primvars(interpolation: Interpolation, rows: int, pixels: float) -> None:
    """What a mesh carries has as many rows as its reader expects; the core takes it."""
    c = coloured(interpolation, rows)
    assert c.colors is not None
    c = replace(
        c, primvars=(replace(c.colors, name="other"), Primvar("k", Interpolation.CONSTANT, np.ones((1, 2), np.float32)))
    )
    description = scene((c, np.eye(4)))
    (mesh,), _ = diced(description, pixels)
    t, n = len(mesh.triangles), len(mesh.points)
    expected = {Interpolation.FACE: t, Interpolation.CORNER: 3 * t, Interpolation.CONSTANT: 1}.get(interpolation, n)
    assert len(mesh.primvars[0].values) == expected
    assert mesh.primvars[1].values.shape == (1, 2)
    assert mesh.colors is not None
    assert c.colors is not None
    if interpolation is Interpolation.FACE:
        assert len(np.unique(mesh.colors, axis=0)) == 6
    assert mesh.colors.min() >= c.colors.values.min() - 1e-6
    core.build(replace(description, shapes=(mesh,)), {}, RenderSettings(resolution=(8, 8)))


def test_surfaces_follow_faces_and_hidden_ones_go() -> None:
    c = replace(cube(), surface=np.array([0, 1, -1, 0, 1, -1], np.int32))
    (mesh,), _ = diced(scene((c, np.eye(4))))
    assert isinstance(mesh.surface, np.ndarray)
    assert set(mesh.surface.tolist()) == {0, 1}
    whole = diced(scene((cube(), np.eye(4))))[0][0]
    rows = {p.tobytes() for p in whole.points}
    assert all(p.tobytes() in rows for p in mesh.points)


def test_cages_that_stand_once_have_the_footprint_that_any_number_would() -> None:
    """Found for all of them in one go: the same bits as for each alone, where an instance makes it look one by one."""
    camera = perspective(look_at([3, 1, 10], [0.2, 0, 0.1]), 0.3)
    matrices = [translation(i, 0.3 * i, -0.1 * i) @ rotation([1, 2, i], 20 * i) @ scaling(1, 1 + i, 0.3) for i in range(9)]
    together = footprints(scene(*[(cube(), m) for m in matrices], camera=camera))
    for k, m in enumerate(matrices):
        alone = instanced(cube(), np.asarray(m)[None, :3], camera)
        (expected,) = footprints(alone).values()
        np.testing.assert_array_equal(together[k].views, expected.views)
        assert together[k].density == expected.density == 0.0


def test_a_cage_whose_matrix_is_not_finite_has_no_view() -> None:
    broken = np.eye(4)
    broken[0, 0] = np.nan
    seen = footprints(scene((cube(), broken), (cube(), np.eye(4))))
    assert [len(seen[k].views) for k in (0, 1)] == [0, 1]


def test_faces_that_differ_have_straight_edges() -> None:
    """In a flat but uneven cage edges inside the surface may be any curve, unless what lies beside them differs."""
    c = grid(6, 6)
    points = c.points.copy()
    points[24, :2] += 0.4  # off the middle
    c = replace(c, points=points - np.array([3, 3, 0], np.float32))
    plain = len(diced(scene((c, np.eye(4))))[0][0].triangles)
    striped = replace(c, surface=(np.arange(36) % 2).astype(np.int32))
    made = describe([(striped, np.eye(4))], [lambert(0.5), lambert(0.2)], camera=CAMERA)
    assert len(diced(replace(made.description, resolution=(256, 256)))[0][0].triangles) > 2 * plain
    colours = np.random.default_rng(2).random((36, 3)).astype(np.float32)
    coloured = replace(c, colors=Primvar("displayColor", Interpolation.FACE, colours))
    assert len(diced(scene((coloured, np.eye(4))))[0][0].triangles) > 2 * plain
    assert plain == 72


@pytest.mark.parametrize("scheme", ["catmullClark", "bilinear"])
def test_pictures_of_flat_faces(scheme: str) -> None:
    """A tilted plane, coloured by a primvar, looks the same whether its faces are split or not."""
    c = replace(grid(3, 3), scheme=scheme)
    ramp = Primvar("ramp", Interpolation.POINT, (c.points / 3 + [0, 0, 0.5]).astype(np.float32))
    c = replace(c, points=c.points - np.array([1.5, 1.5, 0], np.float32), primvars=(ramp,))
    surface = replace(lambert(0.5), inputs=(("diffuse_color", PrimvarInput("ramp", (0.0, 0.0, 0.0))),))
    sun = light(LightType.DISTANT, rotation([1, 0.3, 0], -20))
    made = describe([(c, rotation([1, 1, 0], 35))], [surface], [sun], camera=CAMERA)
    description = replace(made.description, resolution=(64, 64))
    settings = RenderSettings(resolution=(64, 64), spp=4)
    pictures = []
    for flatness in (0.0, 0.1):
        (mesh,), _ = diced(description, flatness=flatness)
        assert (len(mesh.triangles) == 18) == (flatness > 0)
        scene = core.build(replace(description, shapes=(mesh,)), {}, settings)
        pictures.append(core.render(scene, settings, None).pixels[..., :3])
    assert np.ptp(pictures[0], axis=(0, 1)).min() > 0.05
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-3)
