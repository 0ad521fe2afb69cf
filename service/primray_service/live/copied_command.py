"""The command that renders what a viewer shows, as a shell takes it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

from primray.cli.flags import CONTENTS, LIGHTING, VIEWPOINT
from primray.live.viewer import Looks
from primray.settings import RenderSettings, rows
from primray.settings.setting import OnOff

END = "END_OF_CAMERA"
SAMPLES = 256  # a pixel: a viewer refines for as long as somebody looks
GIVEN_APART = frozenset({"camera", "session_layer"})
WRITTEN = frozenset((*VIEWPOINT, *LIGHTING, *CONTENTS, "resolution", "resolution_scale", "max_depth")) - GIVEN_APART


def copied_command(path: str, settings: RenderSettings, looks: Looks, camera_layer: str) -> str:
    """Return shell lines that write the camera to a layer beside the picture and render through it."""
    name = Path(path).stem
    layer, picture = f"{name}.camera.usda", f"{name}.exr"
    words = ["primray", "render", path, "--session-layer", layer, "--camera", "/primray_view", *_flags(settings)]
    if settings.time_code is not None:
        words += ["--frames", f"{settings.time_code:g}"]
    words += ["--spp", str(SAMPLES)]
    shown = {"--view": looks.view, "--display": looks.display, "--look": looks.look}
    exposure = looks.exposure if isinstance(looks.exposure, str) else f"{looks.exposure:g}"
    shown["--exposure"] = None if exposure == "0" else exposure
    words += [word for flag, value in shown.items() if value is not None for word in (flag, value)]
    words += ["-o", picture, "-o", f"{name}.png"]
    return f"cat > {shlex.quote(layer)} <<'{END}'\n{camera_layer.rstrip()}\n{END}\n{shlex.join(words)}\n"


def _flags(settings: RenderSettings) -> Iterator[str]:
    """Yield the flags of settings that differ from their defaults."""
    for row in rows(RenderSettings):
        value = getattr(settings, row.name)
        if row.name not in WRITTEN or row.flag is None or value == row.default:
            continue
        yield from _words(row.flag.names[0], row.flag.form, value, row.name)


def _words(flag: str, form: Any, value: Any, name: str) -> list[str]:
    if name == "resolution_scale":
        return [flag, f"{100 * value:g}"]
    if form is OnOff:
        return [flag, (OnOff.ON if value else OnOff.OFF).value]
    if isinstance(value, bool):  # the flag is the other value than the default
        return [flag.split("/")[-1]] if "/" in flag and not value else [flag.split("/")[0]]
    if name in ("resolution",):
        return [flag, *map(str, value)]
    if name == "purposes":
        return [flag, ",".join(value)]
    if isinstance(value, tuple):
        return [word for each in value for word in (flag, str(each))]
    return [flag, str(value.value) if isinstance(value, Enum) else f"{value:g}" if isinstance(value, float) else str(value)]
