"""Both eyes of a stereo pair of cameras, from one stage: the right one's picture is of the left one's size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, Unpack

from ..settings import Eye, RenderSettings, SettingsValues, with_values
from .render import rendered_frames
from .settings_by_name import naming_settings

if TYPE_CHECKING:
    import os

    from ..images.image import Image
    from ..images.stereo import StereoImage
    from ..sampling.sampling import Progress


@naming_settings
def render_stereo(
    stage: str | os.PathLike[str] | object,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    progress: Progress | Literal[False] | None = None,
    **values: Unpack[SettingsValues],
) -> StereoImage:
    """Render the pair of cameras that the chosen one is of, as UsdGeomCamera's stereoRole names them; all else is as for
    `render`.

    >>> pair = primray.render_stereo("stereo.usda", resolution=(32, 18), spp=2)
    >>> pair.left.resolution, sorted(pair.report["views"])
    ((32, 18), ['left', 'right'])

    Both eyes have the same seed, so that noise has no depth of its own. SettingsError of the codes stereo-pair where there is
    no pair, stereo-ambiguous where several cameras may be of it.
    """
    from ..images.stereo import StereoImage

    eyes = StereoSettings(with_values(settings, values))
    left, right = (eyes.noted(image) for image in rendered_frames(stage, eyes, progress=progress))
    return StereoImage(left, right)


class StereoSettings:
    """The settings of the left eye, then of the right one: that it is as large is known once the left one is rendered."""

    def __init__(self, settings: RenderSettings) -> None:
        self._settings = settings

    def __iter__(self) -> Iterator[RenderSettings]:
        yield replace(self._settings, eye=Eye.LEFT)
        yield replace(self._settings, eye=Eye.RIGHT, resolution_scale=1.0, resolution=self._resolution)

    def noted(self, image: Image) -> Image:
        assert image.frame is not None
        self._resolution = image.frame.resolution
        return image
