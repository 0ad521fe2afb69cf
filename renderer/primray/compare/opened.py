"""Conversion of files, images and arrays to pictures that can be compared."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SettingsError
from ..images.aov import Aov
from ..images.image import Image
from ..images.image_file import MeasuredImage, read_image
from ..images.measured import measured
from .aov_tests import aovs_in
from .numpy_pictures import SUFFIX, measured_array, read_array

Comparable = str | os.PathLike[str] | Image | MeasuredImage | np.ndarray[Any, Any]


def read_picture(path: str | os.PathLike[str]) -> MeasuredImage:
    """Read a picture file, or the array of a .npy file."""
    return read_array(path) if _is_array_file(path) else read_image(path)


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
    raise SettingsError(f"pictures are compared as a primray.Image, an array or a file's path, not {kind}")


def aovs_of(picture: Comparable) -> Mapping[str, Aov]:
    """Return the AOVs of a picture; arrays have none."""
    if isinstance(picture, str | os.PathLike):
        return {} if _is_array_file(picture) else aovs_in(picture)
    return picture.aovs if isinstance(picture, Image) else {}


def _is_array_file(path: str | os.PathLike[str]) -> bool:
    return Path(path).suffix.lower() == SUFFIX
