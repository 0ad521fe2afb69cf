"""What `RenderSettings.camera` may be: a prim's path or name, a Camera, or the matrix of one. Checked without NumPy."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .errors import SettingsError
from .setting_values import number, refused, text

if TYPE_CHECKING:
    from .camera import Camera

Matrix = tuple[tuple[float, ...], ...]  # 4 rows of 4: world_from_camera, for column vectors

WANTED = "a prim's path or name, a primray.Camera, or a 4 x 4 matrix (world_from_camera)"
RIGID = 1e-5  # that far from orthonormal a rotation may be: thousandths of a pixel


def camera_choice(name: str, value: Any) -> str | Camera | Matrix:
    """SettingsError for what is none of these, and for a camera that could not look. A Gf.Matrix4d is for row vectors, and is
    transposed."""
    if isinstance(value, str | os.PathLike) or hasattr(value, "GetPath") or hasattr(value, "pathString"):
        return text(name, value)
    if hasattr(value, "world_from_camera"):
        return _checked(name, value)
    return _rigid(name, value.GetTranspose() if hasattr(value, "GetTranspose") else value)


def _rigid(name: str, value: Any) -> Matrix:
    try:
        rows = tuple(tuple(float(item) for item in row) for row in value)
    except (TypeError, ValueError):
        raise refused(name, WANTED, value) from None
    if len(rows) != 4 or any(len(row) != 4 for row in rows) or not all(math.isfinite(item) for row in rows for item in row):
        raise refused(name, f"{WANTED} of finite numbers", value)
    if rows[3] != (0.0, 0.0, 0.0, 1.0):
        of_rows = rows[3][3] == 1 and not any(row[3] for row in rows[:3])
        hint = "this one is for row vectors, as USD's are: transpose it" if of_rows else f"this one's is {rows[3]}"
        raise SettingsError(f"a matrix for column vectors ends with the row 0, 0, 0, 1; {hint}", where=name)
    _check_rotation(name, rows)
    return rows


def _check_rotation(name: str, rows: Matrix) -> None:
    x, y, z = (tuple(row[k] for row in rows[:3]) for k in range(3))
    lengths = [_dot(a, b) - float(a is b) for a in (x, y, z) for b in (x, y, z)]
    if max(map(abs, lengths)) > RIGID:
        raise SettingsError("the camera's matrix must turn and move only; this one scales or shears", where=name)
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    if _dot(cross, z) < 0:
        raise SettingsError("the camera's matrix must turn and move only; this one mirrors", where=name)


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return sum(p * q for p, q in zip(a, b, strict=True))


def _checked(name: str, given: Any) -> Camera:
    import numpy as np

    from .camera import Camera, Projection

    if not isinstance(given, Camera):
        raise refused(name, WANTED, given)

    def require(holds: bool, sentence: str) -> None:
        if not holds:
            raise SettingsError(f"the camera's {sentence}", where=name)

    matrix = np.array(_rigid(name, given.world_from_camera))
    left, right, bottom, top = sides = [number(name, side) for side in given.window]
    finite = all(map(math.isfinite, sides))
    require(finite and left < right and bottom < top, f"window {given.window} is not (left, right, bottom, top), ascending")
    near, far = (number(name, distance) for distance in given.clipping_range)
    require(near < far, f"clipping_range {given.clipping_range} is not (near, far), ascending")
    radius, focus = number(name, given.lens_radius), number(name, given.focus_distance)
    require(math.isfinite(radius) and radius >= 0, f"lens_radius must be 0 (a pinhole) or more, not {radius}")
    require(radius == 0 or 0 < focus < math.inf, f"focus_distance must be above 0 for a lens, not {focus}")
    require(radius == 0 or given.projection is Projection.PERSPECTIVE, "lens_radius must be 0: it is orthographic")
    exposure = number(name, given.exposure_scale)
    require(0 <= exposure < math.inf, f"exposure_scale must be 0 or more, not {exposure}")
    return replace(given, world_from_camera=matrix)
