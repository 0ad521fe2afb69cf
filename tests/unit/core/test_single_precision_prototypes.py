"""Skewed instances become prototypes of their own; the others keep theirs, with their primvars."""

from __future__ import annotations

import numpy as np
import pytest

from primray.core import single_precision
from primray.core.single_precision import separate_skewed
from primray.description import (
    Camera,
    Interpolation,
    Placed,
    Placement,
    Primvar,
    Projection,
    Prototype,
    SceneDescription,
    Sphere,
)
from primray.description.placement import IDENTITY, Instances, MatrixInstances, PointInstances

SHAPES = (Sphere("/ball", 1.0, 0),)
FLAT = np.diag([1.0, 1, 0, 1])[:3]
SHEARED = np.array([[1, 1, 0, 5], [0, 1e-3, 0, 6], [0, 0, 1.0, 7]])


def scene(*levels: Instances) -> SceneDescription:
    rows = int(np.prod([len(level) for level in levels]))
    primvars = (Primvar("c", Interpolation.INSTANCE, np.arange(rows, dtype=np.float32)[:, None]),)
    prototype = Prototype("/toy", (Placed(0, np.eye(4)),))
    camera = Camera("", np.eye(4), Projection.PERSPECTIVE, (-1, 1, -1, 1), (0.1, 10))
    placements = (Placement(0, levels, primvars),)
    return SceneDescription(SHAPES, (), (), (prototype,), placements, (), camera, (8, 8), "Y", 1.0, None)


def world(d: SceneDescription) -> dict[float, np.ndarray]:
    """World matrices by the instance's primvar."""
    found = {}
    for p in d.placements:
        (placed,) = d.prototypes[p.prototype].shapes
        rows = np.concatenate(list(p.chunks()))
        for row, value in zip(rows, p.primvars[0].values[:, 0], strict=True):
            found[float(value)] = row @ placed.matrix
    return found


NOTHING = np.zeros((3, 4))
LEVEL = MatrixInstances(np.stack([IDENTITY, FLAT, SHEARED, NOTHING, IDENTITY * np.nan]))


@pytest.mark.parametrize("levels", [(LEVEL,), (MatrixInstances(np.stack([IDENTITY, SHEARED])), LEVEL)], ids=["one", "two"])
def test_everything_stands_where_it_did(levels: tuple[Instances, ...]) -> None:
    before, after = scene(*levels), separate_skewed(scene(*levels), SHAPES)
    assert len(after.prototypes) > 2
    expected, found = world(before), world(after)
    assert expected.keys() == found.keys()
    for value, matrix in expected.items():
        np.testing.assert_allclose(found[value], matrix, rtol=1e-15)
    for p in after.placements[1:]:
        np.testing.assert_array_equal(next(p.chunks())[0][:, :3], np.eye(3))


@pytest.mark.parametrize(
    "level",
    [
        MatrixInstances(np.diag([1e-6, 1, 1e6, 1])[None, :3]),
        PointInstances(IDENTITY, np.ones((9, 3), np.float32), scales=np.full((9, 3), (1e-6, 1, 1e6), np.float32)),
        PointInstances(IDENTITY, np.ones((9, 3), np.float32), scales=np.zeros((9, 3), np.float32)),
    ],
    ids=["stretched", "scales", "no size"],
)
def test_others_are_left_alone(level: Instances) -> None:
    d = scene(level)
    assert separate_skewed(d, SHAPES) is d


def test_flat_ones_of_an_instancer() -> None:
    scales = np.ones((9, 3), np.float32)
    scales[4, 1] = 0
    after = separate_skewed(scene(PointInstances(IDENTITY, np.zeros((9, 3), np.float32), scales=scales)), SHAPES)
    assert [len(p) for p in after.placements] == [8, 1]
    assert isinstance(after.placements[0].levels[0], PointInstances)
    np.testing.assert_array_equal(after.prototypes[1].shapes[0].matrix, np.diag([1.0, 0, 1, 1]))


def test_no_more_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(single_precision, "MAX_COPIES", 2)
    after = separate_skewed(scene(MatrixInstances(np.repeat(FLAT[None], 5, axis=0))), SHAPES)
    assert [len(p) for p in after.placements] == [3, 1, 1]
