"""Which triangles have area: what floats decide for many is what double says of each."""

from __future__ import annotations

import numpy as np

from primray.usd.mesh import triangulate
from primray.usd.mesh.triangulate import BLOCK


def test_floats_never_decide_wrongly() -> None:
    rng = np.random.default_rng(1)
    count = 3 * BLOCK + 17
    corners = rng.normal(size=(count, 3, 3)).astype(np.float32)
    corners *= np.float32(10.0) ** rng.integers(-30, 18, (count, 1, 1)).astype(np.float32)
    kind = rng.integers(0, 7, count)
    corners[kind == 1, 2] = corners[kind == 1, 1]  # two corners in one place
    corners[kind == 2, 2] = (corners[kind == 2, 0] + corners[kind == 2, 1]) / 2  # a line, or a sliver of rounding
    corners[kind == 3, 2] = 2 * corners[kind == 3, 1] - corners[kind == 3, 0]
    corners[kind == 4] += np.float32(1e4)
    corners[kind == 5, :, :2] = corners[kind == 5, :1, :2]  # a line along an axis
    # On a line, but for the rounding of their differences to floats.
    along = rng.integers(-1023, 1024, (count, 1, 3)) * np.array([-0.75, 1, 2**13 + 1])[:, None]
    corners[kind == 6] = along[kind == 6]
    points, triangles = corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    found = triangulate.triangulate(points, np.full(count, 3, np.int32), triangles.ravel())
    p = corners.astype(np.float64)
    exact = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]).any(axis=1)
    assert 0.1 < exact.mean() < 0.9
    np.testing.assert_array_equal(found.faces, np.flatnonzero(exact))
