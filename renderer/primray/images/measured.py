"""A rendered picture as it would be read from its EXR: what comparisons judge."""

from __future__ import annotations

import numpy as np

from .files.exr_header import chromaticities_of
from .image import Image
from .image_file import COLORS, MeasuredImage


def measured(image: Image) -> MeasuredImage:
    """Its colours, alpha (if it has one) and errors, and what a file's header would say of it."""
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
