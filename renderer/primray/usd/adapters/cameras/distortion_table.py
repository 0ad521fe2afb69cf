"""OmniLensDistortionLutAPI's table: an image of directions (X, Y, Z in camera space) over the calibrated sensor."""

from __future__ import annotations

import numpy as np
from pxr import Sdf

from ....description import TextureFile
from ....errors import PrimrayError
from ....lens.distortion import DirectionTable
from ....textures.texture import load_texture
from ...stage.reads import read_asset

NOWHERE = 1e-3  # shorter than this is no direction
UNIT = 0.05  # texels whose length differs more from 1 are no directions


def read_table(asset: object, size: tuple[float, float], center: tuple[float, float]) -> tuple[float, DirectionTable] | str:
    """Return the focal length at the centre in pixels and the table in units of it; or a sentence on why there is none.

    Texels are centred in equal parts of the sensor, from its upper left. The lens sees nothing at texels that are (0, 0, 1)
    (straight back), (0, 0, 0) or not finite. `size` and `center` are the sensor's, in pixels; the table's axis is at the
    sensor's centre and moves with the optical centre.
    """
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return "no image of directions is given"
    if not asset.resolvedPath:
        return f"{asset.path} cannot be found"
    try:
        texture = load_texture(TextureFile(str(asset.resolvedPath), "raw"), read_asset)
    except PrimrayError as error:
        return error.message
    if texture.shape[2] < 3 or texture.stored.dtype.kind != "f":
        return f"{asset.path} does not have three float channels"
    directions = cleaned(texture.channels(0, 3))
    if directions is None:
        return f"{asset.path} does not hold unit directions"
    width, height = size
    focal = _focal(directions, width, height)
    left, top = -width / 2 / focal, height / 2 / focal
    return focal, DirectionTable((left, width / focal + left, top - height / focal, top), directions)


def cleaned(texels: np.ndarray) -> np.ndarray | None:
    """Return unit directions (H, W, 3), float32, NaN where nothing is seen; None if nothing is, or lengths are not 1."""
    found = np.array(texels, np.float64)
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(found, axis=2)
        back = (found[..., 2] > 0) & (np.hypot(found[..., 0], found[..., 1]) <= 1e-6 * length)
        seen = (length > NOWHERE) & np.isfinite(length) & ~back
    if not seen.any() or np.abs(length[seen] - 1).max() > UNIT:
        return None
    found[~seen] = np.nan
    found[seen] /= length[seen][:, None]
    return found.astype(np.float32)


def _focal(directions: np.ndarray, width: float, height: float) -> float:
    """Return the sensor's pixels per radian at the texel whose direction is nearest to straight ahead."""
    ahead = np.nan_to_num(-directions[..., 2], nan=-2.0)
    j, i = np.unravel_index(int(ahead.argmax()), ahead.shape)
    rows, columns = ahead.shape
    scales = []
    for other, pixels in (
        ((j, i + 1 if i + 1 < columns else i - 1), width / columns),
        ((j + 1 if j + 1 < rows else j - 1, i), height / rows),
    ):
        apart = (
            float(np.linalg.norm(directions[other].astype(np.float64) - directions[j, i])) if min(rows, columns) > 1 else 0.0
        )
        if apart > 0 and np.isfinite(apart):
            scales.append(pixels / apart)
    return float(np.mean(scales)) if scales else width / 2
