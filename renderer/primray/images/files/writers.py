"""Picture writers based on OpenImageIO: multi-part EXRs, integer views, and scene-linear pictures in other formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Floats
from ...color.color_space import REC709, ColorSpace, matrix, transformed
from ...errors import PrimrayError
from ...textures.image_errors import last_error
from .encoding import Part

LARGEST_RGBE = np.float32(2.0**127 * 255 / 256)


def write_parts_of(path: str, parts: Sequence[Part]) -> None:
    """Write an EXR of these parts; PrimrayError ("write-failed") if OpenImageIO cannot."""
    import OpenImageIO as oiio

    out = oiio.ImageOutput.create(path)
    if out is None:
        raise PrimrayError(f"the file cannot be written: {last_error(oiio)}", where=path, code="write-failed")
    specs = [spec for spec, _ in parts]
    done = out.open(path, specs) if len(specs) > 1 else out.open(path, specs[0])
    for number, (spec, values) in enumerate(parts):
        done = done and (number == 0 or out.open(path, spec, "AppendSubimage")) and out.write_image(values)
    if not done or not out.close():
        raise PrimrayError(f"the file cannot be written: {last_error(out)}", where=path, code="write-failed")


def write_view(encoded: npt.NDArray[Any], path: str) -> None:
    """Write display values (H, W, C) unchanged, 8 or 16 bits by their type."""
    import OpenImageIO as oiio

    height, width, channels = encoded.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT16 if encoded.dtype == np.uint16 else oiio.UINT8)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("CompressionQuality", 95)
    write_parts_of(path, [(spec, encoded)])


def write_radiance(pixels: Floats, space: ColorSpace, path: str) -> None:
    """Write (H, W, 4) over black as RGBE. Readers assume Rec.709: no alpha, no negative values, 8 bits of mantissa."""
    rgb = transformed(np.where(np.isfinite(pixels[..., :3]), pixels[..., :3], np.float32(0)), matrix(space, REC709))
    _write_floats(np.clip(rgb, 0, LARGEST_RGBE), path)


def write_linear(pixels: Floats, space: ColorSpace, path: str) -> None:
    """Write (H, W, 4) as 32-bit floats in Rec.709, the space assumed of files that do not name one; alpha is associated."""
    rgb = transformed(pixels[..., :3], matrix(space, REC709))
    _write_floats(np.concatenate([rgb, pixels[..., 3:]], axis=2), path)


def _write_floats(values: Floats, path: str) -> None:
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], oiio.FLOAT)
    spec.attribute("oiio:ColorSpace", REC709.name)
    write_parts_of(path, [(spec, np.ascontiguousarray(values, np.float32))])
