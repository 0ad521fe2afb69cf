"""Both eyes of a stereo camera pair from one stage: their pictures, and their files.

The right picture has the size of the left one. Files are two views of one EXR, or a file for each eye. The layout follows
OpenEXR's "Storing Multi-View Images" for multi-part files: each part's `view` names its eye, both eyes have the same channel
names, the first part is the left eye's, and no part has `multiView`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from ..errors import SettingsError
from ..images.encoding import Encoding
from ..images.exposure import View
from ..images.exr_parts import PICTURE_PART, VIEW, Parts
from ..images.image import Image, check_output_path, stored_parts, write_parts
from ..settings import Eye, RenderSettings, with_values
from .render import rendered_frames, with_setting_names

if TYPE_CHECKING:
    import os

    from ..images.image import Image
    from ..sampling.sampling import Progress
    from ..settings.written import SettingsValues


NAME = "oiio:subimagename"
_PLACE = re.compile(r"%[Vv]")
_END = re.compile(r"(?P<frame>\.\d+)?(?P<extension>\.\w+)$")


@dataclass(frozen=True, eq=False)
class StereoImage:
    """Pictures of the left and right eye. SettingsError if they differ in size, because one file could not hold both.

    >>> pair = primray.render_stereo("stereo.usda", resolution=(32, 18), spp=2)
    >>> pair.left.camera.path, pair.right.camera.path
    ('/rig/left', '/rig/right')
    >>> [path.name for path in pair.save("shot.exr")], [path.name for path in pair.save("shot.png")]
    (['shot.exr'], ['shot_left.png', 'shot_right.png'])
    """

    left: Image
    right: Image

    def __post_init__(self) -> None:
        if self.left.frame != self.right.frame or self.left.resolution != self.right.resolution:
            sentence = "the eyes differ in resolution or pixel aspect ratio, so one file cannot hold both"
            raise SettingsError(sentence, where="eye", code="stereo-frames")

    @property
    def views(self) -> Mapping[Eye, Image]:
        return {Eye.LEFT: self.left, Eye.RIGHT: self.right}

    @property
    def report(self) -> Mapping[str, Any]:
        """The reports of both eyes."""
        return {"views": {eye.value: image.report for eye, image in self.views.items()}}

    def save(self, path: str | os.PathLike[str], *, view: View | None = None, exposure: float = 0.0) -> list[Path]:
        """Write one EXR with both eyes, or a file for each eye.

        Names with %V (left, right) or %v (l, r), and those of PNG and JPEG, are a file for each eye. `exposure` in stops.
        """
        if is_joint(os.fspath(path)):
            return [self.write(check_output_path(path))]
        files = {eye: check_output_path(name_of_eye(os.fspath(path), eye)) for eye in Eye}
        shown = view or self.left.view_of()
        return [self.views[eye].write(file, shown, exposure) for eye, file in files.items()]

    def write(self, path: Path, encoding: Encoding = Encoding()) -> Path:  # noqa: B008 - immutable
        """Write both eyes as one EXR, to a path that has been checked."""
        parts = []
        for eye, image in self.views.items():
            parts += named_by_view(stored_parts(image, encoding), eye)
        return write_parts(path, parts)


def is_joint(name: str) -> bool:
    """Return whether a file of this name holds both eyes."""
    return name.lower().endswith(".exr") and not _PLACE.search(os.path.basename(name))


def name_of_eye(name: str, eye: Eye) -> str:
    """Return the name with the eye in place of %V or %v, else before the extension and the frame number."""
    folder, slash, own = name.rpartition("/")
    if _PLACE.search(own):
        return folder + slash + _PLACE.sub(lambda place: eye.value if place[0] == "%V" else eye.value[0], own)
    return folder + slash + _END.sub(lambda end: f"_{eye.value}{end[0]}", own, count=1)


def named_by_view(parts: Parts, eye: Eye) -> Parts:
    """Return the parts of one eye, named as one of several views."""
    for spec, _ in parts:
        spec.attribute(NAME, f"{spec.get_string_attribute(NAME, PICTURE_PART)}.{eye.value}")
        spec.attribute(VIEW, eye.value)
        spec.erase_attribute("multiView")
    return parts


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
