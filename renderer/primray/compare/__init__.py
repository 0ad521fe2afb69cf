"""Have two pictures changed, beyond their noise? Differences, tests of them, a verdict, and the pytest fixture.

The package shares its name with the function `primray.compare`. Importing it costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..images.aov import Aov
    from ..images.image import Image
    from ..images.image_file import MeasuredImage
    from .comparison import Comparison


def compare(
    a: str | os.PathLike[str] | Image | MeasuredImage,
    b: str | os.PathLike[str] | Image | MeasuredImage,
    *,
    alpha: float = 0.001,
    tolerance: float = 0.01,
    tile: int = 32,
    aovs: Iterable[str] = (),
    allow_bias: bool = False,
) -> Comparison:
    """Whether picture `b` has changed from `a` beyond their noise, each an image or the path of an EXR with error channels.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=8)
    >>> image.save("before.exr").name
    'before.exr'
    >>> primray.compare("before.exr", image).verdict
    <Verdict.UNCHANGED: 'unchanged'>

    `alpha` is the rate of false alarms, over all tiles together; `tolerance` the smallest relative difference that matters;
    tiles are `tile` pixels across. `aovs` names outputs beside the pictures that are judged as well, ["all"] all that both
    have: means of samples by their errors (`aov_errors`), ids by names, what is exact by its values. SettingsError if the two
    cannot be compared: unless `allow_bias`, both must have the same `clamp_indirect` and `caustics`.
    """
    from .aov_tests import compare_with_aovs
    from .comparison import compare as compare_measured

    if isinstance(aovs, str):
        aovs = [aovs]
    pictures, asked = (_opened(a), _opened(b)), list(aovs)
    if not asked:
        return compare_measured(*pictures, alpha=alpha, tolerance=tolerance, tile=tile, allow_bias=allow_bias)
    both = _aovs_of(a), _aovs_of(b)
    criteria = {"alpha": alpha, "tolerance": tolerance}
    return compare_with_aovs(pictures, both, asked, tile=tile, allow_bias=allow_bias, **criteria)


def _aovs_of(picture: object) -> Mapping[str, Aov]:
    from ..images.image import Image
    from .aov_tests import aovs_in

    if isinstance(picture, str | os.PathLike):
        return aovs_in(picture)
    return picture.aovs if isinstance(picture, Image) else {}


def _opened(picture: object) -> MeasuredImage:
    from ..errors import SettingsError
    from ..images.image import Image
    from ..images.image_file import MeasuredImage, read_image
    from ..images.measured import measured

    if isinstance(picture, str | os.PathLike):
        return read_image(picture)
    if isinstance(picture, Image):
        return measured(picture)
    if not isinstance(picture, MeasuredImage):
        kind = type(picture).__name__
        raise SettingsError(f"pictures are compared as a primray.Image or an EXR's path, not {kind}: errors belong to them")
    return picture
