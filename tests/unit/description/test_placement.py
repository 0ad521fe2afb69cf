"""Instances as data: products of levels in chunks, their boxes, and what belongs to each instance staying in step."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from primray.description import Doubles, Interpolation, Primvar
from primray.description.placement import (
    CHUNK,
    IDENTITY,
    Instances,
    MatrixInstances,
    Placement,
    PointInstances,
    chunks,
    compose,
    placed_box,
    rows_of_levels,
    transformed_box,
)


def square(upper: Doubles) -> Doubles:
    return np.concatenate([upper, np.broadcast_to([0.0, 0, 0, 1], (len(upper), 1, 4))], axis=1)


def matrices(count: int, seed: int = 1) -> MatrixInstances:
    return MatrixInstances(np.random.default_rng(seed).normal(size=(count, 3, 4)))


def points(count: int, seed: int = 2, primvars: tuple[Primvar, ...] = ()) -> PointInstances:
    rng = np.random.default_rng(seed)
    outer = rng.normal(size=(3, 4))
    positions, scales = rng.normal(size=(2, count, 3)).astype(np.float32)
    return PointInstances(outer, positions, rng.normal(size=(count, 4)).astype(np.float16), scales, primvars)


def whole(levels: tuple[Instances, ...], size: int = CHUNK) -> Doubles:
    return np.concatenate(list(chunks(levels, size)))


def numbered(name: str, count: int) -> Primvar:
    return Primvar(name, Interpolation.INSTANCE, np.arange(count, dtype=np.float32)[:, None])


@pytest.mark.parametrize("size", [1, 3, 7, 20, 64, 10**6])
def test_chunks_are_the_products_in_order_whatever_their_size(size: int) -> None:
    levels = (points(4), matrices(3), points(5, 7))
    a, b, c = (square(level.rows(0, len(level))) for level in levels)
    expected = np.einsum("aij,bjk,ckl->abcil", a, b, c).reshape(-1, 4, 4)[:, :3]
    found = list(chunks(levels, size))
    assert max(map(len, found)) <= size
    np.testing.assert_allclose(np.concatenate(found), expected, rtol=1e-12, atol=1e-12)
    assert len(Placement(0, levels)) == len(expected)


def test_rows_do_not_depend_on_where_a_chunk_begins() -> None:
    level = points(50)
    all_rows = level.rows(0, 50)
    for start, stop in pairwise((0, 1, 17, 40, 50)):
        np.testing.assert_array_equal(level.rows(start, stop), all_rows[start:stop])


def test_an_empty_level_places_nothing_and_no_level_is_the_identity() -> None:
    assert list(chunks((matrices(3), matrices(0)))) == []
    assert [rows.tolist() for rows in chunks(())] == [[IDENTITY.tolist()]]


@pytest.mark.parametrize("level", [points(6), matrices(6)])
def test_one_more_matrix_comes_after_the_others(level: Instances) -> None:
    outer = matrices(1, 9).matrices[0]
    found = level.placed(outer)
    np.testing.assert_allclose(found.rows(0, 6), compose(outer[None], level.rows(0, 6)), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("levels", [(points(40),), (matrices(40),), (points(5), matrices(3), points(4))])
def test_boxes_hold_all_images_and_are_not_far_too_big(levels: tuple[Instances, ...]) -> None:
    box = (np.array([-0.5, 0.2, -1.0]), np.array([0.7, 0.3, 2.0]))
    low, high = placed_box(levels, box)
    exact = transformed_box(whole(levels), box)
    assert (low <= exact[0].min(axis=0) + 1e-12).all()
    assert (high >= exact[1].max(axis=0) - 1e-12).all()
    assert ((high - low) < 40 * (exact[1].max(axis=0) - exact[0].min(axis=0))).all()


def test_a_box_leaves_out_what_is_not_finite() -> None:
    level = matrices(3)
    level.matrices[1, 0, 3] = np.nan
    box = (-np.ones(3), np.ones(3))
    for found, expected in zip(placed_box((level,), box), placed_box((level.take(np.array([0, 2])),), box), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_what_is_chosen_takes_its_primvars_along() -> None:
    level = points(10, primvars=(numbered("a", 10),))
    for chosen in (np.array([7, 2, 2]), np.arange(10) % 3 == 0):
        kept = level.take(chosen)
        np.testing.assert_array_equal(kept.primvars[0].values[:, 0], np.arange(10)[chosen])
        np.testing.assert_array_equal(kept.rows(0, len(kept)), level.rows(0, 10)[chosen])


def test_primvars_of_all_levels_have_a_row_an_instance() -> None:
    levels = (
        points(2, primvars=(numbered("outer", 2), numbered("both", 2))),
        matrices(3),
        points(4, 3, (numbered("both", 4),)),
    )
    found = {p.name: p.values[:, 0].astype(int).tolist() for p in rows_of_levels(levels)}
    assert found == {"outer": [0] * 12 + [1] * 12, "both": [0, 1, 2, 3] * 6}
