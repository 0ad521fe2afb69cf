"""Colour management through OpenColorIO: rendering space to a display's view, and texture spaces to rendering space.

The configuration is $OCIO's, else OpenColorIO's own default (an ACES config for CG). The rendering space is linear
Rec.709. OpenColorIO is imported when a colour is first converted, so that the command line starts quickly.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np

from .description import Floats
from .errors import SettingsError

BUILTIN_CONFIG = "ocio://default"
# Names under which configurations know linear Rec.709: the interop id, ACES configs of 2.x and 1.x, older ones.
RENDERING_SPACE_NAMES = ("lin_rec709_scene", "Linear Rec.709 (sRGB)", "lin_rec709", "lin_srgb", "Utility - Linear - sRGB")


@lru_cache(maxsize=4)
def _load_config(source: str) -> Any:
    import PyOpenColorIO as ocio

    try:
        return ocio.Config.CreateFromFile(source)
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise SettingsError(f"the OCIO configuration cannot be read: {error}", where=source, code="ocio-config") from error


def _config() -> Any:
    return _load_config(os.environ.get("OCIO") or BUILTIN_CONFIG)


def config_name() -> str:
    """The configuration in use, as its file says it is called."""
    source = os.environ.get("OCIO") or BUILTIN_CONFIG
    return str(_config().getName()) or source


def displays() -> list[str]:
    return list(_config().getDisplays())


def views(display: str | None = None) -> list[str]:
    """Names of the views of `display` (None: the default one), the default view first."""
    config = _config()
    display = display or config.getDefaultDisplay()
    names = list(config.getViews(display))
    names.sort(key=lambda name: name != config.getDefaultView(display))
    return names


def check_view(view: str | None, display: str | None = None) -> tuple[str, str]:
    """The display and view meant (None: the defaults); SettingsError that lists the known ones."""
    config = _config()
    if display is not None and display not in displays():
        raise SettingsError(f"no display {display!r}; {config_name()} has: {', '.join(displays())}", code="unknown-display")
    chosen = display or config.getDefaultDisplay()
    if view is not None and view not in views(chosen):
        raise SettingsError(f"no view {view!r} on {chosen!r}; there are: {', '.join(views(chosen))}", code="unknown-view")
    return chosen, view or config.getDefaultView(chosen)


def to_display(rgb: Floats, view: str | None = None, display: str | None = None, exposure: float = 0.0) -> Floats:
    """Rendering space (H, W, 3) to display values, nominally [0,1]; `exposure` in stops, applied first."""
    import PyOpenColorIO as ocio

    display, view = check_view(view, display)
    transform = ocio.DisplayViewTransform(src=_rendering_space(), display=display, view=view)
    return _apply(transform, rgb * np.float32(2.0**exposure))


def to_rendering_space(rgb: Floats, color_space: str) -> Floats:
    """(H, W, 3) in a named colour space of the configuration to rendering space; SettingsError if it has none so named."""
    import PyOpenColorIO as ocio

    if _config().getColorSpace(color_space) is None:
        raise SettingsError(f"{config_name()} has no colour space {color_space!r}", code="unknown-color-space")
    return _apply(ocio.ColorSpaceTransform(src=color_space, dst=_rendering_space()), rgb)


def _rendering_space() -> str:
    config = _config()
    for name in RENDERING_SPACE_NAMES:
        space = config.getColorSpace(name)
        if space is not None:
            return str(space.getName())
    known = ", ".join(RENDERING_SPACE_NAMES)
    raise SettingsError(f"{config_name()} has no linear Rec.709 space (looked for {known})", code="ocio-config")


def _apply(transform: Any, rgb: Floats) -> Floats:
    import PyOpenColorIO as ocio

    out = np.array(rgb, np.float32, order="C")
    try:
        processor = _config().getProcessor(transform).getDefaultCPUProcessor()
    except ocio.Exception as error:
        raise SettingsError(f"the OCIO configuration cannot convert this: {error}", code="ocio-config") from error
    # Pixels are independent, and an ACES view costs 0.6 microseconds for each: share the rows among the cores.
    with ThreadPoolExecutor(min(8, len(os.sched_getaffinity(0)))) as threads:
        list(threads.map(processor.applyRGB, np.array_split(out, min(out.shape[0], 64))))
    return out
