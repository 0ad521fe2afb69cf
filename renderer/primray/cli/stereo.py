"""`primray render --stereo`: both eyes of each picture, into one EXR or one file each, with one report.

This module does not import Typer (see quick.py).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from ..errors import PrimrayError, SettingsError
from ..settings import Eye
from .output_targets import is_standard, is_tev
from .pictures import Looks, finished_report, has_samples, is_finished, is_written, save, save_all, tell, write_report

if TYPE_CHECKING:
    from ..images.image import Image
    from ..render import OpenedStage
    from ..render.stereo import StereoImage
    from .shots import Shot


def require_whole_renders(given: dict[str, object]) -> None:
    """Raise SettingsError for flags of single pictures: a stereo pair has neither checkpoints nor snapshots."""
    for flag, value in given.items():
        if value is not None:
            raise SettingsError(f"{flag} cannot be combined with --stereo; render each eye separately", code="stereo-flags")


def require_files(outputs: list[str]) -> None:
    """Raise SettingsError for standard output, which holds only one picture."""
    for output in outputs:
        if is_standard(output):
            raise SettingsError("a stereo pair cannot go to standard output; name a file", where=output, code="stereo-flags")


def render_pair(scene: str | OpenedStage, shot: Shot, looks: Looks) -> StereoImage | None:
    """Render both eyes; return None if interrupted before both have samples."""
    from ..incremental.scene import quiet_frames
    from ..render.stereo import StereoImage, StereoSettings
    from .console import Show, showing

    showing_now: list[Show] = []
    eyes = StereoSettings(shot.settings)
    progress: Callable[[float, int, int], bool | None] = lambda *now: showing_now[-1](*now)  # noqa: E731
    images = quiet_frames(scene, eyes, progress=progress, on_interrupt="partial")
    found: list[Image] = []
    for eye in Eye:
        with showing(f"{shot.files[0]} ({eye.value})", looks.as_json) as show:
            showing_now.append(show)
            try:
                found.append(eyes.noted(next(images)))
            except PrimrayError:
                if found:
                    _keep_left(found[0], shot, looks)
                raise
        if found[-1].report["interrupted"] and (eye is Eye.LEFT or not has_samples(found[-1])):
            return None
    return StereoImage(*found)


def _keep_left(image: Image, shot: Shot, looks: Looks) -> None:
    """Write the left eye's picture under its own name, after the right one's has failed."""
    from ..render.stereo import name_of_eye

    own = [name_of_eye(file, Eye.LEFT) for file in shot.files if not is_tev(file)]
    written, _ = save_all(own, partial(save, image), looks, image)
    print(f"only the left eye was saved: {', '.join(written) or 'no file'}", file=sys.stderr)


def write_pair(pair: StereoImage, shot: Shot, looks: Looks) -> bool:
    """Write both pictures and report the results; return False if a file could not be written.

    Such a file is reported, and the others are written.
    """
    from ..render.stereo import is_joint, name_of_eye

    start = time.perf_counter()
    joint = [file for file in shot.files if is_joint(file) and not is_tev(file)]
    kept = [file for file in joint if is_written(partial(_write_joint, pair, file, shot, looks), looks)]
    looks = looks.settled_if_it_can_be(pair.left)
    whole, reports = kept == joint and all(map(is_finished, pair.views.values())), {}
    for eye, image in pair.views.items():
        own = [name_of_eye(file, eye) for file in shot.files if file not in joint]
        written, _ = save_all(own, partial(save, image), looks, image)
        whole = whole and written == own
        reports[eye.value] = finished_report(image, [*kept, *written], time.perf_counter() - start, looks)
    if shot.report is not None:
        whole = write_report(shot.report_file_of({"views": reports}), shot.report, looks) and whole
    for eye, image in pair.views.items():
        tell(image, {"view": eye.value, **reports[eye.value]}, looks)
    return whole


def _write_joint(pair: StereoImage, file: str, shot: Shot, looks: Looks) -> None:
    from ..images.image import check_output_path
    from ..render.stereo import StereoImage

    held = StereoImage(shot.image_in(file, pair.left), shot.image_in(file, pair.right))
    held.write(check_output_path(file), looks.encoding)
