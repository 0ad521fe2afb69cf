"""Rendering of both eyes of a stereo camera pair, from one stage: the right picture has the size of the left one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, Unpack

from ..settings import Eye, RenderSettings, with_values
from .render import rendered_frames, with_setting_names

if TYPE_CHECKING:
    import os

    from ..images.image import Image
    from ..images.stereo import StereoImage
    from ..sampling.sampling import Progress
    from ..settings.written import SettingsValues


@with_setting_names
def render_stereo(
    stage: str | os.PathLike[str] | object,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    progress: Progress | Literal[False] | None = None,
    **values: Unpack[SettingsValues],
) -> StereoImage:
    """Render the stereo pair that the chosen camera belongs to, by UsdGeomCamera's stereoRole; all else is as for `render`.

    >>> pair = primray.render_stereo("stereo.usda", resolution=(32, 18), spp=2)
    >>> pair.left.resolution, sorted(pair.report["views"])
    ((32, 18), ['left', 'right'])

    Both eyes have the same seed, so that noise has no parallax. Raises SettingsError with the code stereo-pair if there is no
    pair, stereo-ambiguous if several cameras could belong to it.
    """
    from ..images.stereo import StereoImage

    eyes = StereoSettings(with_values(settings, values))
    left, right = (eyes.noted(image) for image in rendered_frames(stage, eyes, progress=progress))
    return StereoImage(left, right)


class StereoSettings:
    """The settings of the left eye, then those of the right one, whose size is known once the left one is rendered."""

    def __init__(self, settings: RenderSettings) -> None:
        self._settings = settings

    def __iter__(self) -> Iterator[RenderSettings]:
        yield replace(self._settings, eye=Eye.LEFT)
        yield replace(self._settings, eye=Eye.RIGHT, resolution_scale=1.0, resolution=self._resolution)

    def noted(self, image: Image) -> Image:
        assert image.frame is not None
        self._resolution = image.frame.resolution
        return image
