"""How far the boundaries of volumes are moved inwards."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import box, lambert, scaling, translation

from primray.core.volume_bounds import INSET, inset_points, inset_radius, volume_insets
from primray.description import HomogeneousVolume, Surface, volume_boundary

FOG = volume_boundary(HomogeneousVolume())


def test_surfaces_of_volumes_have_different_insets() -> None:
    glass = Surface("/g", volume=HomogeneousVolume())
    found = volume_insets([lambert(0.5), FOG, glass, FOG])
    assert found.tolist() == [0.0, INSET, 0.0, 2 * INSET]


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_faces_move_inwards(size: float, mirror: float) -> None:
    mesh = box((2, 2, 2))
    matrix = translation(3 * size, 0, 0) @ scaling(mirror * size, size, 2 * size)
    inset = np.full(len(mesh.triangles), INSET)
    moved = inset_points(mesh.points, mesh.triangles, inset, matrix, np.zeros(3)).astype(np.float64)
    before = mesh.points @ matrix[:3, :3].T
    after = moved @ matrix[:3, :3].T
    inwards = np.abs(before) - np.abs(after)
    reach = 4 * size
    assert (inwards > 0.2 * INSET * reach).all()
    assert (inwards < 1.1 * INSET * reach).all()


def test_a_singular_matrix_moves_nothing() -> None:
    mesh = box((2, 2, 2))
    inset = np.full(len(mesh.triangles), INSET)
    assert inset_points(mesh.points, mesh.triangles, inset, scaling(1, 1, 0), np.zeros(3)) is mesh.points


def test_spheres_become_smaller() -> None:
    found = inset_radius(2.0, INSET, translation(10, 0, 0) @ scaling(3, 3, 3), np.zeros(3))
    assert found == pytest.approx(2.0 - 16 * INSET / 3, rel=1e-9)
    assert inset_radius(-2.0, INSET, np.eye(4), np.zeros(3)) < -1.9
    assert inset_radius(1.0, INSET, scaling(0, 0, 0), np.zeros(3)) == 1.0
