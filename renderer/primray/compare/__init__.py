"""Have two pictures changed, beyond their noise? Differences, tests of them, a verdict, and the pytest fixture.

The package shares its name with the function `primray.compare`. Importing it costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import numpy as np

    from ..images.image import Image
    from ..images.image_file import MeasuredImage
    from .comparison import Comparison
    from .opened import Comparable
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
) -> Comparison | SequenceComparison: ...


def compare(
    a: Comparable,
    b: Comparable,
    *,
    alpha: float = 0.001,
    tolerance: float = 0.01,
    tile: int = 32,
    aovs: Iterable[str] = (),
) -> Comparison | SequenceComparison:
    """Whether picture `b` has changed from `a` beyond their noise, each an image, an array or the path of a file.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=8)
    >>> image.save("before.exr").name
    'before.exr'
    >>> primray.compare("before.exr", image).verdict
    <Verdict.UNCHANGED: 'unchanged'>

    `alpha` is the rate of false alarms, over all tiles together; `tolerance` the smallest relative difference that matters;
    tiles are `tile` pixels across. `aovs` names outputs beside the pictures that are judged as well, ["all"] all that both
    have: means of samples by their errors (`aov_errors`), ids by names, what is exact by its values. SettingsError if the two
    cannot be compared.

    Where neither has standard errors (arrays, .npy files, PNGs, EXRs of others) values alone are judged: `Comparison.by` is
    "values", or "display" for display values (PNG, JPEG, TIFF; arrays of uint8 and uint16), whose differences are shares of
    white. Two folders, or two names with a place for the frame's number ("a/shot.####.exr", "b/shot.%04d.exr"), are compared
    pair by pair; the result is a SequenceComparison then.
    """
    from .aov_tests import compare_with_aovs
    from .comparison import compare as compare_measured
    from .opened import aovs_of, opened
    from .sequences import compare_pairs, pairing

    asked = [aovs] if isinstance(aovs, str) else list(aovs)
    if isinstance(a, str | os.PathLike) and isinstance(b, str | os.PathLike):
        found = pairing(os.fspath(a), os.fspath(b))
        if found is not None:
            return compare_pairs(found, alpha=alpha, tolerance=tolerance, tile=tile, aovs=asked)
    pictures = opened(a), opened(b)
    if not asked:
        return compare_measured(*pictures, alpha=alpha, tolerance=tolerance, tile=tile)
    both = aovs_of(a), aovs_of(b)
    return compare_with_aovs(pictures, both, asked, alpha=alpha, tolerance=tolerance, tile=tile)
