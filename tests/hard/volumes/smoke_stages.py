"""Stages in memory with smoke from OpenVDB files, for the hard cases of volumes, and what should be left of light behind it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from tests import vdb_writer as vdb
from tests.hard.light.lit_stages import Shown, dome, prim, show
from tests.images.volumes.voxels import depth_along, voxels

from primray.volumes.volume_grid import VolumeGrid

Array = npt.NDArray[Any]
ALL = np.ones(512, bool)
BLACK = "float inputs:scatter = 0"
WHITE = "color3f inputs:scatter_color = (1, 1, 1)"


def grid(dense: npt.ArrayLike, first: Sequence[int] = (0, 0, 0), **more: Any) -> VolumeGrid:
    return voxels(np.asarray(dense, np.float32), first, **more)


def block(side: int = 8, value: float = 1.0, first: Sequence[int] = (0, 0, 0)) -> VolumeGrid:
    return grid(np.full((side,) * 3, value), first)


def write(folder: Path, made: VolumeGrid, **more: Any) -> str:
    """Write a grid to a file of its own, and return the text that names it in a stage."""
    rows = zip(made.leaf_origins.tolist(), made.leaf_values, strict=True)
    leaves = {(x, y, z): vdb.Leaf(values.astype(np.float64), ALL) for (x, y, z), values in rows}
    path = folder / f"smoke{len(os.listdir(folder))}.vdb"
    path.write_bytes(vdb.vdb_bytes([vdb.Grid(leaves=leaves, **more)]))
    return f"@{path}@"


def matrix_ops(matrix: Array) -> str:
    rows = ", ".join("(" + ", ".join(map(repr, row)) + ")" for row in np.asarray(matrix, np.float64).T.tolist())
    return f'matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = ["xformOp:transform"]'


def volume(file: str, matrix: Array | None = None, name: str = "smoke", look: str = "look") -> str:
    field = prim("OpenVDBAsset", "density", f"asset filePath = {file}", 'token fieldName = "density"')
    ops = "" if matrix is None else matrix_ops(matrix)
    lines = (f"rel material:binding = </{look}>", "rel field:density = <density>", ops, field)
    return prim("Volume", name, *lines, apis=["MaterialBindingAPI"])


def look(density: float, *inputs: str, name: str = "look") -> str:
    """Return a material whose extinction is `density` per scene unit and per unit of a voxel's value."""
    shader = prim(
        "Shader", "volume", 'uniform token info:id = "arnold:standard_volume"', f"float inputs:density = {density!r}",
        'string inputs:emission_mode = "none"', *inputs, "token outputs:out",
    )  # fmt: skip
    return prim("Material", name, f"token outputs:arnold:volume.connect = </{name}/volume.outputs:out>", shader)


def camera(eye: npt.ArrayLike, direction: npt.ArrayLike, half: float, far: float) -> str:
    """Return a camera of parallel rays along `direction`, `half` wide about the ray from `eye`."""
    d = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    x = np.cross(d, (0.0, 1.0, 0.0) if abs(d[1]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.stack([x, np.cross(x, d), -d, np.asarray(eye, np.float64)], axis=1)
    return prim(
        "Camera", "camera", 'token projection = "orthographic"', f"float horizontalAperture = {20 * half!r}",
        f"float verticalAperture = {20 * half!r}", f"float2 clippingRange = (0, {far!r})", matrix_ops(pose),
    )  # fmt: skip


def depth(made: VolumeGrid, matrix: Array, eye: npt.ArrayLike, direction: npt.ArrayLike, length: float) -> float:
    """Return the integral of interpolated values along a ray in the world, by its length in the world."""
    inverse = np.linalg.inv(matrix)
    d = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    origin = inverse[:3, :3] @ (np.asarray(eye, np.float64) - matrix[:3, 3])
    return float(depth_along(made, origin, inverse[:3, :3] @ d, length))


def seen(*prims: str, spp: int = 1024, size: int = 32, **settings: Any) -> Shown:
    """Return the picture of a white sky, and what is before it, of unsplit paths without invalid samples."""
    found = show(dome(), *prims, **{"spp": spp, "resolution": (size, size), **settings})
    assert found.invalid_samples == 0
    return found


def agrees(found: Shown, expected: float, tolerance: float = 0.003) -> str:
    """Check a picture of one value within `tolerance` or 4.5 standard errors; return by how much it differs."""
    off = found.mean / expected - 1
    error = found.noise / expected
    assert 3 * error <= tolerance, f"too few samples: {error}"
    assert abs(off) <= max(tolerance, 4.5 * error), f"found {found.mean}, expected {expected}: {off} +- {error}"
    return f"{100 * off:+.2f} % (standard error {100 * error:.2f} %)"
