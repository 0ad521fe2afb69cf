"""Scenes with volumes whose pictures are known: grids of voxels, cameras, quadrature, and the check against a value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.described import Described, look_at, orthographic, render, replicate_means, translation

from primray.description import Camera, Doubles, VolumeEmission, VolumeMedium
from primray.volumes.volume_grid import FOG_VOLUME, VolumeGrid

Array = npt.NDArray[Any]
Color = tuple[float, float, float]
TOLERANCE = 0.002


def grid_of(
    leaf_origins: npt.ArrayLike, leaf_values: Array, tiles: Sequence[tuple[int, int, int, int]] = (), tile_values: Any = ()
) -> VolumeGrid:
    """Return a grid of leaves (L, 512) or (L, 512, 3), and tiles by first voxel and side."""
    background = np.zeros(leaf_values.shape[2:], np.float32)
    places = np.array(tiles, np.int32).reshape(-1, 4)
    values = np.array(tile_values, np.float32).reshape(len(places), *background.shape)
    origins = np.array(leaf_origins, np.int32).reshape(-1, 3)
    return VolumeGrid(
        "density", FOG_VOLUME, np.eye(4), background, origins, leaf_values, places[:, :3], places[:, 3], values, None, 0, 0, 0
    )  # fmt: skip


def voxels(values: npt.ArrayLike, first: Sequence[int] = (0, 0, 0), *, half: bool = False) -> VolumeGrid:
    """Return a grid with the dense `values` (X, Y, Z) or (X, Y, Z, 3) from the voxel `first` on; empty leaves are left out."""
    dense = np.asarray(values, np.float32)
    low = np.array(first) // 8 * 8
    before = np.array(first) - low
    pad = [(int(b), int(-(b + n) % 8)) for b, n in zip(before, dense.shape[:3], strict=True)]
    dense = np.pad(dense, [*pad, *[(0, 0)] * (dense.ndim - 3)])
    origins, leaves = [], []
    for x, y, z in np.ndindex(*(n // 8 for n in dense.shape[:3])):
        leaf = dense[8 * x : 8 * x + 8, 8 * y : 8 * y + 8, 8 * z : 8 * z + 8]
        if leaf.any():
            origins.append(low + 8 * np.array((x, y, z)))
            leaves.append(leaf.reshape(512, *dense.shape[3:]))
    stored = np.array(leaves, np.float16 if half else np.float32).reshape(-1, 512, *dense.shape[3:])
    return grid_of(np.array(origins).reshape(-1, 3), stored)


def block(value: float | Color = 1.0, side: int = 8, **more: Any) -> VolumeGrid:
    """Return a cube of one value: along an axis, through the inside, its integral is `value` times `side`."""
    return voxels(np.broadcast_to(np.array(value, np.float32), (side, side, side, *np.shape(value))), **more)


def medium(
    grid: VolumeGrid,
    extinction: float | Color = 1.0,
    albedo: float | Color = 0.0,
    *,
    matrices: Sequence[Doubles] | None = None,
    **more: Any,
) -> VolumeMedium:
    places = np.array([np.eye(4)] if matrices is None else list(matrices)).reshape(-1, 4, 4)
    return VolumeMedium(
        path="/smoke", grid=grid, extinction=color(extinction), albedo=color(albedo), matrices=places, **more
    )  # fmt: skip


def glow(grid: VolumeGrid, emission: float | Color = 1.0, *, matrices: Sequence[Doubles] | None = None) -> VolumeEmission:
    places = np.array([np.eye(4)] if matrices is None else list(matrices)).reshape(-1, 4, 4)
    return VolumeEmission(path="/fire", grid=grid, emission=color(emission), matrices=places)


def color(value: float | Color) -> Color:
    return value if isinstance(value, tuple) else (value,) * 3


def along(
    direction: Sequence[float] | Doubles, through: Sequence[float] | Doubles, half: float = 1.0, distance: float = 50.0
) -> Camera:
    """Return a camera of parallel rays along `direction`, `half` wide about the point `through`, from `distance` before it."""
    d = np.array(direction, np.float64) / np.linalg.norm(direction)
    up = (0, 1, 0) if abs(d[1]) < 0.9 else (1, 0, 0)
    eye = np.array(through, np.float64) - distance * d
    return orthographic(look_at(eye, through, up), half, clipping_range=(0.0, 4.0 * distance))


MIDDLE = translation(3.5, 3.5, 3.5)


def depth_along(grid: VolumeGrid, origin: npt.ArrayLike, direction: npt.ArrayLike, end: float, steps: int = 20_000) -> Any:
    """Return the integral of a grid's interpolated values from `origin` on, in index space, per unit of `direction`."""
    t = (np.arange(steps) + 0.5) * (end / steps)
    points = np.asarray(origin, np.float64) + t[:, None] * np.asarray(direction, np.float64)
    return grid.sample(points).sum(axis=0) * (end / steps)


def picture(scene: Described, spp: int, **values: Any) -> Array:
    """Return the pixels (H, W, 3) of unsplit paths; none of the samples is invalid."""
    result = render(scene.build(), spp, **{"threads": 2, "splits": 1, **values})
    assert result.invalid_samples == 0
    return replicate_means(result).mean(axis=0)


def check(pixels: Array, expected: npt.ArrayLike, tolerance: float = TOLERANCE) -> None:
    """Check the mean of pixels (H, W, 3), which all have one expected value, within `tolerance` or 4.5 standard errors.

    There are enough samples only if 3 standard errors are within the tolerance.
    """
    wanted = np.broadcast_to(np.asarray(expected, np.float64), 3)
    flat = pixels.reshape(-1, 3)
    found, error = flat.mean(axis=0), flat.std(axis=0) / np.sqrt(len(flat))
    summary = f"found {found}, expected {wanted}, ratio - 1 {found / wanted - 1}, error {error / wanted}"
    assert (3 * error <= tolerance * wanted).all(), f"too few samples: {summary}"
    assert (np.abs(found - wanted) <= np.maximum(tolerance * wanted, 4.5 * error)).all(), summary
