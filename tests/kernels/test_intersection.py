"""What rays meet, against embreex's own API and plain double-precision arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import box, describe, kernels, lambert, mesh, placement, rotation, scaling, translation
from tests.kernels.scenes import grouped

from primray.description import Placed, Prototype, Shape, Sphere

N = 4000


def triangles(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = (rng.normal(size=(n, 1, 3)) + 0.3 * rng.normal(size=(n, 3, 3))).reshape(-1, 3).astype(np.float32)
    return points, np.arange(3 * n, dtype=np.int32).reshape(-1, 3)


def rays(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """From around towards the middle."""
    rng = np.random.default_rng(seed)
    o = rng.normal(size=(N, 3)) * 3
    d = rng.normal(size=(N, 3)) - o
    return o, (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32)


@pytest.mark.parametrize("lanes", [0, 1])
@pytest.mark.parametrize("packet", [True, False])
def test_against_embreex(lanes: int, packet: bool) -> None:
    rtcore_scene = pytest.importorskip("embreex.rtcore_scene")
    mesh_construction = pytest.importorskip("embreex.mesh_construction")
    points, index = triangles(500, seed=1)
    o, d = rays(seed=2)
    oracle = rtcore_scene.EmbreeScene(robust=True)
    mesh_construction.TriangleMesh(oracle, points, index)
    expected = oracle.run(o.astype(np.float32), d, output=1)
    h = kernels().intersect(
        describe([(mesh(points, index), np.eye(4))], [lambert(0.5)]).build(),
        o.astype(np.float32).astype(float),
        d,
        lanes,
        packet,
    )
    hit = expected["primID"] >= 0
    assert 0.2 < hit.mean() < 0.98
    # Our scene is scaled by a power of two, so that only rays through an edge may differ.
    assert np.mean(h["primitive"] == expected["primID"]) > 0.9995
    same = hit & (h["primitive"] == expected["primID"])
    np.testing.assert_allclose(h["t"][same], expected["tfar"][same], rtol=1e-4)
    assert (h["geometry"][~hit & (h["primitive"] < 0)] == -1).all()


def test_points_normals_and_offsets() -> None:
    points, index = triangles(500, seed=3)
    o, d = rays(seed=4)
    m = translation(0.1, 0.2, -0.3) @ rotation([1, 2, 3], 40) @ scaling(-1.2, 0.8, 1.1)
    h = kernels().intersect(describe([(mesh(points, index), m)], [lambert(0.5)]).build(), o, d)
    hit = h["primitive"] >= 0
    p = points.astype(np.float64) @ m[:3, :3].T + m[:3, 3]
    a, b, c = (p[index[h["primitive"][hit], k]] for k in range(3))
    n = -np.cross(b - a, c - a)  # a mirrored mesh keeps its outside
    n /= np.linalg.norm(n, axis=1)[:, None]
    exact = o[hit] + d[hit] * (np.sum((a - o[hit]) * n, axis=1) / np.sum(d[hit] * n, axis=1))[:, None]
    # Away from slivers, whose normals have few digits.
    good = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.02
    steep = good & (np.abs(np.sum(d[hit] * n, axis=1)) > 0.05)
    assert np.abs(h["p"][hit] - exact)[steep].max() < 2e-5
    assert (np.sum(h["ng"][hit] * n, axis=1)[good] > 1 - 1e-5).all()
    # The point is on its plane to within its own bound.
    off_plane = np.abs(np.sum((h["p"][hit] - a) * n, axis=1))
    assert (off_plane[good] < h["offset"][hit][good]).all()


def test_instances_and_spheres() -> None:
    """Instances that mirror and shear, against the same shapes moved one by one."""
    rng = np.random.default_rng(5)
    matrices = [
        translation(*rng.normal(size=3))
        @ rotation(rng.normal(size=3), 70)
        @ scaling(*rng.uniform(0.2, 0.7, 3) * [(-1) ** i, 1, 1])
        for i in range(12)
    ]
    shapes: tuple[Shape, ...] = (box([1, 1, 1]), Sphere("/s", 0.4, 0))
    prototype = Prototype("/p", (Placed(0, translation(0.3, 0, 0)), Placed(1, translation(-0.4, 0.2, 0))))
    instanced = describe(
        [], [lambert(0.5)], prototypes=[prototype], prototype_shapes=shapes, placements=[placement(0, matrices)]
    ).build()
    flat = describe(
        [(s, m @ placed.matrix) for m in matrices for s, placed in zip(shapes, prototype.shapes, strict=True)],
        [lambert(0.5)],
    ).build()
    o, d = rays(seed=6)
    a, b = kernels().intersect(instanced, o, d), kernels().intersect(flat, o, d)
    assert 0.1 < np.mean(a["geometry"] >= 0) < 0.9
    same = (a["geometry"] == b["geometry"]) & (np.abs(a["t"] - b["t"]) < 1e-3)
    assert np.mean(same | ((a["geometry"] < 0) & (b["geometry"] < 0))) > 0.998
    hit = same & (a["geometry"] >= 0)
    np.testing.assert_allclose(a["ng"][hit], b["ng"][hit], atol=2e-3)
    assert np.abs(a["p"][hit] - b["p"][hit]).max() < 1e-4


def test_two_levels_and_one_meet_the_same() -> None:
    """Instances kept in two levels and multiplied out: the same hits to rounding, but for near misses."""
    o, d = rays(seed=8)
    a, b = (kernels().intersect(grouped(flat).build(), o, d) for flat in (False, True))
    hit, same = a["geometry"] >= 0, np.isclose(a["t"], b["t"], rtol=1e-4, atol=1e-5)
    assert 0.1 < hit.mean() < 0.9
    assert np.mean(same) > 0.999
    both = hit & same
    for name, tolerance in (("p", 1e-5), ("ng", 1e-3), ("ns", 1e-3), ("surface", 0)):
        assert np.mean(np.abs(a[name] - b[name])[both] <= tolerance) > 0.999
    assert (a["offset"][both] >= 0.5 * b["offset"][both]).all()


def test_packets_and_single_rays_meet_the_same_bits_in_two_levels() -> None:
    scene = grouped().build()
    o, d = rays(seed=9)
    found = [
        kernels().intersect(scene, o, d, lanes, packet) for lanes, packet in ((1, False), (4, True), (16, True), (16, False))
    ]
    hit = found[0]["geometry"] >= 0
    for other in found[1:]:
        assert np.array_equal(other["geometry"] >= 0, hit)
        for name, values in found[0].items():
            np.testing.assert_array_equal(values[hit], other[name][hit], err_msg=name)


def test_sphere_is_exact() -> None:
    m = translation(0.5, -0.3, 0.2) @ rotation([1, 1, 0], 35) @ scaling(1.0, 0.4, 0.7)
    o, d = rays(seed=7)
    h = kernels().intersect(describe([(Sphere("/s", 1.3, 0), m)], [lambert(0.5)]).build(), o, d)
    inverse = np.linalg.inv(m)
    q, w = o @ inverse[:3, :3].T + inverse[:3, 3], d.astype(float) @ inverse[:3, :3].T
    a, b, c = np.sum(w * w, axis=1), np.sum(q * w, axis=1), np.sum(q * q, axis=1) - 1.3**2
    disc = b * b - a * c
    with np.errstate(invalid="ignore"):
        t0, t1 = (-b - np.sqrt(disc)) / a, (-b + np.sqrt(disc)) / a
    t = np.where(t0 > 0, t0, t1)
    clear = np.abs(disc) > 1e-4
    hit = (disc > 0) & (t > 0)
    assert np.array_equal((h["geometry"] >= 0)[clear], hit[clear])
    both = clear & hit
    np.testing.assert_allclose(h["t"][both], t[both], rtol=2e-5, atol=2e-5)
    n = (q + w * t[:, None])[both] @ inverse[:3, :3]
    n /= np.linalg.norm(n, axis=1)[:, None]
    assert np.sum(n * h["ng"][both], axis=1).min() > 1 - 1e-6


def test_the_clock_by_which_packets_or_single_rays_are_chosen_goes_on() -> None:
    """One that stood still would choose packets always; no picture would show it, only its time."""
    before = kernels().timestamp_counter()
    assert kernels().timestamp_counter() > before
