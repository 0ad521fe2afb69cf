"""A rendered picture as it would be read back from its EXR, for comparisons."""

from __future__ import annotations

import numpy as np

from .files.exr_header import chromaticities_of
from .image import Image
from .image_file import COLORS, MeasuredImage


def measured(image: Image) -> MeasuredImage:
    """Return the image's colours, alpha (if any), errors and header entries."""
    colors = [image.channels.index(name) for name in COLORS]
    alpha = image.pixels[..., image.channels.index("A")] if "A" in image.channels else None
    return MeasuredImage(
        np.ascontiguousarray(image.pixels[..., colors]),
        None if alpha is None else np.ascontiguousarray(alpha),
        image.errors,
        image.metadata,
        "the image",
        chromaticities_of(image.color_space),
        image.frame,
    )
