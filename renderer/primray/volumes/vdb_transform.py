"""Transforms of OpenVDB grids (openvdb/math/Maps.h): linear maps as a matrix; frustums are recognized but not supported."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Doubles
from .vdb_bytes import VdbBytes

FRUSTUM = "NonlinearFrustumMap"


def read_transform(source: VdbBytes) -> tuple[str, Doubles | None]:
    """Return a map's type and its (4, 4) matrix from index space for column vectors, None for a frustum.

    VdbError for a type that is unknown, since its length is unknown too.
    """
    kind = source.text("the transform's type")
    if kind == FRUSTUM:
        source.skip(8 * 8, "the frustum's box, taper and depth")
        inner = source.text("the type of the frustum's second map")
        _matrix(source, inner)
        return kind, None
    return kind, _matrix(source, kind)


def _matrix(source: VdbBytes, kind: str) -> Doubles:
    if kind not in _READERS:
        raise source.error(f"its transform has the unknown type {kind[:60]!r}")
    return _READERS[kind](source)


def _affine(source: VdbBytes) -> Doubles:
    """Return the transpose of the file's matrix, which is for row vectors."""
    return source.array("<f8", 16, "the transform's matrix").reshape(4, 4).T.astype(np.float64)


def _scale(source: VdbBytes) -> Doubles:
    matrix = np.diag([*source.array("<f8", 3, "the transform's scale"), 1.0])
    source.skip(4 * 3 * 8, "what follows from the transform's scale")  # voxel size and three kinds of inverses
    return matrix


def _translation(source: VdbBytes) -> Doubles:
    matrix = np.eye(4)
    matrix[:3, 3] = source.array("<f8", 3, "the transform's translation")
    return matrix


def _scale_translation(source: VdbBytes) -> Doubles:
    moved = _translation(source)
    return moved @ _scale(source)


_READERS: dict[str, Callable[[VdbBytes], Doubles]] = {
    "AffineMap": _affine,
    "UnitaryMap": _affine,
    "ScaleMap": _scale,
    "UniformScaleMap": _scale,
    "TranslationMap": _translation,
    "ScaleTranslateMap": _scale_translation,
    "UniformScaleTranslateMap": _scale_translation,
}
