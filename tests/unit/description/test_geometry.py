"""Boxes of shapes."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Curves, geometry


def test_the_box_of_curves_contains_their_spheres_whatever_the_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    balls = np.random.default_rng(3).normal(size=(41, 4)).astype(np.float32)
    monkeypatch.setattr(geometry, "_BALLS", 8)
    low, high = Curves("/curves", balls, np.array([], np.int32), 0).box()
    centres, radii = balls[:, :3].astype(np.float64), balls[:, 3:]
    assert (low == (centres - radii).min(axis=0)).all()
    assert (high == (centres + radii).max(axis=0)).all()
