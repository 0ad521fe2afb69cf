"""Values of `RenderSettings.camera`: a prim's path or name, a Camera, or a matrix. Checked without importing NumPy."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import SettingsError
from .setting import number, refused, text, texts

if TYPE_CHECKING:
    from ..camera import Camera

Matrix = tuple[tuple[float, ...], ...]  # 4 rows of 4: world_from_camera, for column vectors

WANTED = "a prim's path or name, a primray.Camera, or a 4 x 4 matrix (world_from_camera)"
RIGID = 1e-5  # tolerance of a rotation's orthonormality: thousandths of a pixel
LAST_ROW = (0.0, 0.0, 0.0, 1.0)
AFFINE = 1e-6  # tolerance of the last row


def camera_choice(name: str, value: Any) -> str | Camera | Matrix:
    """Return the checked value; SettingsError for other values and for invalid cameras.

    A Gf.Matrix4d is for row vectors and is transposed.
    """
    if isinstance(value, str | os.PathLike) or hasattr(value, "GetPath") or hasattr(value, "pathString"):
        return text(name, value)
    if hasattr(value, "world_from_camera"):
        return _checked(name, value)
    return _rigid(name, value.GetTranspose() if hasattr(value, "GetTranspose") else value)


def camera_itself(name: str, value: Any) -> Camera:
    """Return the checked camera; SettingsError for all but a Camera."""
    if not hasattr(value, "world_from_camera"):
        raise refused(name, "a primray.Camera", value)
    return _checked(name, value)


def _rigid(name: str, value: Any) -> Matrix:
    try:
        rows = tuple(tuple(float(item) for item in row) for row in value)
    except (TypeError, ValueError):
        raise refused(name, WANTED, value) from None
    if len(rows) != 4 or any(len(row) != 4 for row in rows) or not all(math.isfinite(item) for row in rows for item in row):
        raise refused(name, f"{WANTED} of finite numbers", value)
    if not _is_affine(rows[3]):
        of_rows = _is_affine([row[3] for row in rows])
        hint = "this one is for row vectors, as USD's are: transpose it" if of_rows else f"this one's is {rows[3]}"
        raise SettingsError(f"a matrix for column vectors ends with the row 0, 0, 0, 1; {hint}", where=name)
    _check_rotation(name, rows)
    return (*rows[:3], LAST_ROW)


def _is_affine(last: Sequence[float]) -> bool:
    """Return whether a last row is 0, 0, 0, 1 up to rounding, as in computed inverses."""
    return all(abs(a - b) <= AFFINE for a, b in zip(last, LAST_ROW, strict=True))


def _check_rotation(name: str, rows: Matrix) -> None:
    x, y, z = (tuple(row[k] for row in rows[:3]) for k in range(3))
    lengths = [_dot(a, b) - float(a is b) for a in (x, y, z) for b in (x, y, z)]
    if max(map(abs, lengths)) > RIGID:
        raise SettingsError(
            "the camera's matrix must be rigid (rotation and translation); this one scales or shears", where=name
        )
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    if _dot(cross, z) < 0:
        raise SettingsError("the camera's matrix must be rigid (rotation and translation); this one mirrors", where=name)


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return sum(p * q for p, q in zip(a, b, strict=True))


def _checked(name: str, given: Any) -> Camera:
    import numpy as np

    from ..camera import Camera, Projection

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
    nearest = number(name, given.nearest)
    require(0 <= nearest < math.inf, f"nearest must be 0 or more, not {nearest}")
    if given.distortion is not None:
        _check_distortion(given, require)
    _check_flaws(name, given, require)
    return replace(given, world_from_camera=matrix)


# Lens flaws that can be requested, and how many numbers each takes.
LENS_FLAWS = {"natural-vignetting": 1, "mechanical-vignetting": 2, "lateral-chromatic": 3, "longitudinal-chromatic": 3}


def read_lens_flaws(name: str, value: Any) -> tuple[str, ...]:
    """Return the checked texts "NAME=NUMBERS"; SettingsError for unknown names or invalid numbers."""
    given = texts(name, value)
    flaws_of(given)
    return given


def flaws_of(given: tuple[str, ...]) -> dict[str, tuple[float, ...]]:
    """Return the numbers by name; the last of equal names counts."""
    found: dict[str, tuple[float, ...]] = {}
    for one in given:
        name, _, written = one.partition("=")
        if name not in LENS_FLAWS:
            raise SettingsError(f"unknown lens flaw {name!r}; there are {', '.join(LENS_FLAWS)}", where="lens_flaws")
        try:
            numbers = tuple(float(number) for number in written.split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != LENS_FLAWS[name] or not all(map(math.isfinite, numbers)) or not _fits(name, numbers):
            wanted = {"mechanical-vignetting": "DISTANCE,RADIUS, 0 or more", "natural-vignetting": "0 or 1"}.get(name, "R,G,B")
            above = ", above 0" if name == "lateral-chromatic" else ""
            raise SettingsError(f"{name} must be {name}={wanted}{above}, not {one}", where="lens_flaws")
        found[name] = numbers
    return found


def _fits(name: str, numbers: tuple[float, ...]) -> bool:
    if name == "mechanical-vignetting":
        return min(numbers) >= 0
    return name != "lateral-chromatic" or min(numbers) > 0


def _check_flaws(name: str, given: Camera, require: Callable[[bool, str], None]) -> None:
    distance, radius = (number(name, length) for length in given.rim)
    fits = 0 <= distance < math.inf and 0 <= radius < math.inf
    require(fits, f"rim must be a distance and a radius, 0 or more, not {given.rim}")
    sizes = [number(name, size) for size in given.channel_magnification]
    fits = len(sizes) == 3 and all(0 < size < math.inf for size in sizes)
    require(fits, f"channel_magnification must be three numbers above 0, not {given.channel_magnification}")
    shifts = [number(name, shift) for shift in given.channel_focus_shift]
    nearest = given.focus_distance if given.lens_radius > 0 else math.inf
    fits = len(shifts) == 3 and all(math.isfinite(shift) and nearest + shift > 0 for shift in shifts)
    require(
        fits, f"channel_focus_shift must be three distances that keep the focus in front of it, not {given.channel_focus_shift}"
    )


def _check_distortion(given: Camera, require: Callable[[bool, str], None]) -> None:
    from ..camera import Projection
    from ..lens.distortion import COEFFICIENT_COUNTS, WITH_TABLE, Distortion, DistortionModel

    lens = given.distortion
    if not isinstance(lens, Distortion):
        require(False, f"distortion must be a Distortion, not {lens!r}")
        return
    require(given.projection is Projection.PERSPECTIVE, "distortion must be None: it is orthographic")
    wanted = COEFFICIENT_COUNTS[lens.model]
    finite = all(isinstance(k, int | float) and math.isfinite(k) for k in lens.coefficients)
    require(finite and len(lens.coefficients) == wanted, f"distortion needs {wanted} finite coefficients: {lens.model.value}")
    require(0 < lens.most_angle_deg <= 180, f"most_angle_deg must be above 0, 180 or less, not {lens.most_angle_deg}")
    require(
        (lens.table is not None) == (lens.model in WITH_TABLE),
        "distortion must have a table if its model is TABLE or RAYS, and only then",
    )
    if lens.table is not None:
        places = lens.table.places
        require(
            (places is not None) == (lens.model is DistortionModel.RAYS),
            "a table has places if its model is RAYS, and only then",
        )
