"""Comparison of pictures beyond their noise: differences, statistical tests, a verdict, and a pytest fixture.

The package shares its name with the function `primray.compare`. Importing it imports nothing heavy.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import numpy as np

    from ..images.image import Image
    from ..images.reading import MeasuredImage
    from .comparable import Comparable
    from .comparison import Comparison
    from .sequences import SequenceComparison


@overload
def compare(
    a: Image | MeasuredImage | np.ndarray[Any, Any],
    b: Comparable,
    *,
    alpha: float = ...,
    tolerance: float = ...,
    tile: int = ...,
    aovs: Iterable[str] = ...,
    allow_bias: bool = ...,
) -> Comparison: ...


@overload
def compare(
    a: str | os.PathLike[str],
    b: Image | MeasuredImage | np.ndarray[Any, Any],
    *,
    alpha: float = ...,
    tolerance: float = ...,
    tile: int = ...,
    aovs: Iterable[str] = ...,
    allow_bias: bool = ...,
) -> Comparison: ...


@overload
def compare(
    a: str | os.PathLike[str],
    b: str | os.PathLike[str],
    *,
    alpha: float = ...,
    tolerance: float = ...,
    tile: int = ...,
    aovs: Iterable[str] = ...,
    allow_bias: bool = ...,
) -> Comparison | SequenceComparison: ...


def compare(
    a: Comparable,
    b: Comparable,
    *,
    alpha: float = 0.001,
    tolerance: float = 0.01,
    tile: int = 32,
    aovs: Iterable[str] = (),
    allow_bias: bool = False,
) -> Comparison | SequenceComparison:
    """Return whether picture `b` has changed from `a` beyond noise; each is an image, an array or the path of a file.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=8)
    >>> image.save("before.exr").name
    'before.exr'
    >>> primray.compare("before.exr", image).verdict
    <Verdict.UNCHANGED: 'unchanged'>

    `alpha` is the false-alarm rate over all tiles together; `tolerance` the smallest relative difference that matters; tiles
    are `tile` pixels across. `aovs` names AOVs to compare as well, ["all"] all that both have: means of samples by their
    errors (`aov_errors`), ids by names, exact values by value. SettingsError if the two cannot be compared: unless
    `allow_bias`, both must have the same `clamp_indirect` and `caustics`.

    If neither has standard errors (arrays, .npy files, PNGs, EXRs of other programs), only values are compared:
    `Comparison.by` is "values", or "display" for display values (PNG, JPEG, TIFF; arrays of uint8 and uint16), whose
    differences are fractions of white. Two folders, or two names with a frame number placeholder ("a/shot.####.exr",
    "b/shot.%04d.exr"), are compared pair by pair, and the result is a SequenceComparison.
    """
    from .aov_tests import compare_with_aovs
    from .comparable import aovs_of, opened
    from .comparison import compare as compare_measured
    from .sequences import compare_pairs, pairing

    asked = [aovs] if isinstance(aovs, str) else list(aovs)
    if isinstance(a, str | os.PathLike) and isinstance(b, str | os.PathLike):
        found = pairing(os.fspath(a), os.fspath(b))
        if found is not None:
            return compare_pairs(found, alpha=alpha, tolerance=tolerance, tile=tile, aovs=asked, allow_bias=allow_bias)
    pictures = opened(a), opened(b)
    if not asked:
        return compare_measured(*pictures, alpha=alpha, tolerance=tolerance, tile=tile, allow_bias=allow_bias)
    both = aovs_of(a), aovs_of(b)
    return compare_with_aovs(pictures, both, asked, alpha=alpha, tolerance=tolerance, tile=tile, allow_bias=allow_bias)
