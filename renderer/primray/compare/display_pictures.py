"""Comparison with references that are views (PNG, JPEG, TIFF), as display values of the picture rendered now.

A view has no error channels. Its noise is that of the picture, propagated through the view, plus quantization; the reference is
assumed to have the same, scaled by its number of samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..images.exposure import View
from ..images.image_file import MeasuredImage
from ..images.reading import space_of

NOTE = "the reference is a display picture without errors: it is taken to be as noisy as the picture rendered now"
STEPS = {"uint8": 255, "uint16": 65535}


def with_noise(
    reference: MeasuredImage, shown: MeasuredImage, record: MeasuredImage, of_reference: float
) -> tuple[MeasuredImage, MeasuredImage]:
    """Return the reference and the view `shown` of `record`, with standard errors.

    `of_reference` scales the errors of the reference. Identical pictures need none.
    """
    if record.stderr is None or (reference.pixels.shape == shown.pixels.shape and (reference.pixels == shown.pixels).all()):
        return reference, shown
    noise = _through_view(record, shown)
    made = []
    for picture, scale in ((reference, of_reference), (shown, 1.0)):
        step = 1.0 / STEPS.get(picture.stored, 255) / 12**0.5  # standard deviation of uniform quantization
        made.append(replace(picture, stderr=np.sqrt((scale * noise) ** 2 + step**2).astype(np.float32)))
    return made[0], made[1]


def _through_view(record: MeasuredImage, shown: MeasuredImage) -> Floats:
    """Return standard errors (H, W, 3) of display values, infinite where unknown.

    Each is half the difference of the view at plus and minus one error.
    """
    assert record.stderr is not None
    view = View(space=space_of(record.chromaticities))
    alpha = np.ones_like(record.pixels[..., :1])
    if shown.alpha is not None and record.alpha is not None:
        alpha = np.clip(record.alpha[..., None], 0, 1)
    inverse = np.divide(1, alpha, out=np.zeros_like(alpha), where=alpha > 0)
    known = np.isfinite(record.stderr)
    rgb = np.nan_to_num(record.pixels * inverse)
    error = np.where(known, record.stderr, 0) * inverse
    low, high = (np.clip(np.nan_to_num(view.shown((rgb + sign * error).astype(np.float32))), 0, 1) for sign in (-1, 1))
    found: Floats = np.where(known, np.abs(high - low) / 2 * alpha, np.inf).astype(np.float32)
    return found
