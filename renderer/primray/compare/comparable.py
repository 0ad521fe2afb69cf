"""Pictures that can be compared: files, images and NumPy arrays (floats are scene-linear, integers are display values)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SettingsError
from ..images.aov import Aov
from ..images.image import Image
from ..images.reading import COLORS, MeasuredImage, read_measured
from ..images.writers import chromaticities_of
from .aov_tests import aovs_in

Comparable = str | os.PathLike[str] | Image | MeasuredImage | np.ndarray[Any, Any]


def read_picture(path: str | os.PathLike[str]) -> MeasuredImage:
    """Read a picture file, or the array of a .npy file."""
    return read_array(path) if _is_array_file(path) else read_measured(path)


def opened(picture: object) -> MeasuredImage:
    """Return any comparable object as a picture; SettingsError for other types."""
    if isinstance(picture, str | os.PathLike):
        return read_picture(picture)
    if isinstance(picture, Image):
        return measured(picture)
    if isinstance(picture, np.ndarray):
        return measured_array(picture, "the array")
    if isinstance(picture, MeasuredImage):
        return picture
    kind = type(picture).__name__
    raise SettingsError(f"a picture to compare must be a primray.Image, an array or a path, not {kind}")


def aovs_of(picture: Comparable) -> Mapping[str, Aov]:
    """Return the AOVs of a picture; arrays have none."""
    if isinstance(picture, str | os.PathLike):
        return {} if _is_array_file(picture) else aovs_in(picture)
    return picture.aovs if isinstance(picture, Image) else {}


def _is_array_file(path: str | os.PathLike[str]) -> bool:
    return Path(path).suffix.lower() == SUFFIX


SUFFIX = ".npy"
_STORED = {"float16": "half", "float32": "float", "float64": "double", "uint8": "uint8", "uint16": "uint16"}


def read_array(path: str | os.PathLike[str]) -> MeasuredImage:
    """Read the array of a .npy file; SettingsError if it has none, or one that is not a picture."""
    name = os.fspath(path)
    try:
        array = np.load(name, allow_pickle=False)
    except FileNotFoundError:
        raise SettingsError("there is no such picture", where=name, code="image-missing") from None
    except (OSError, ValueError, EOFError) as error:
        raise SettingsError(f"the array cannot be read: {error}", where=name, code="image-unreadable") from None
    return measured_array(array, name)


def measured_array(array: np.ndarray[Any, Any], name: str = "") -> MeasuredImage:
    """Return an array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) as a picture that is assumed exact."""
    array = array[..., None] if array.ndim == 2 else array
    if array.ndim != 3 or array.shape[2] not in (1, 3, 4) or 0 in array.shape:
        sentence = f"an array of shape {array.shape} is not a picture; expected (H, W), (H, W, 1), (H, W, 3) or (H, W, 4)"
        raise SettingsError(sentence, where=name, code="image-array")
    stored = _STORED.get(array.dtype.name)
    if stored is None:
        sentence = (
            f"an array of {array.dtype} is not a picture; expected floats (scene-linear), uint8 or uint16 (display values)"
        )
        raise SettingsError(sentence, where=name, code="image-array")
    with np.errstate(over="ignore"):
        values = np.asarray(array, np.float32)
    if array.dtype.kind == "u":
        values = values / np.float32(np.iinfo(array.dtype).max)
    colors = values[..., [0, 0, 0]] if values.shape[2] == 1 else values[..., :3]
    alpha = np.ascontiguousarray(values[..., 3]) if values.shape[2] == 4 else None
    return MeasuredImage(np.ascontiguousarray(colors), alpha, None, name=name, stored=stored)


def measured(image: Image) -> MeasuredImage:
    """Return the image's colours, alpha (if any), errors and header entries."""
    colors = [image.channels.index(name) for name in COLORS]
    alpha = image.pixels[..., image.channels.index("A")] if "A" in image.channels else None
    return MeasuredImage(
        pixels=np.ascontiguousarray(image.pixels[..., colors]),
        alpha=None if alpha is None else np.ascontiguousarray(alpha),
        stderr=image.errors,
        metadata=image.metadata,
        name="the image",
        chromaticities=chromaticities_of(image.color_space),
        frame=image.frame,
    )
