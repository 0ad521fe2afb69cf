"""Colour management: the rendering space to a display view, and any colour space to the rendering space.

Spaces that USD names are converted by their primaries (color_space.py); OpenColorIO handles views, and spaces that only its
configuration knows. The configuration is $OCIO's, else OpenColorIO's own default (an ACES config for CG). OpenColorIO is
imported when a colour needs it, so that the command line starts quickly.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Doubles, Floats
from ..errors import SettingsError
from ..read_files import is_watching, note_read
from . import color_space
from .color_space import REC709, ColorSpace

BUILTIN_CONFIG = "ocio://default"
SCENE_LINEAR = "scene_linear"  # OpenColorIO's role for a studio's rendering space
# Names of linear spaces in configurations, besides the interop id: ACES configs of 2.x and 1.x, older ones. The spaces are in
# the order in which they are tried as an intermediate for a space that the configuration lacks.
CONFIG_NAMES = {
    "lin_rec709_scene": ("Linear Rec.709 (sRGB)", "lin_rec709", "lin_rec709_srgb", "lin_srgb", "Utility - Linear - sRGB"),
    "lin_ap0_scene": ("ACES2065-1", "lin_ap0", "ACES - ACES2065-1", "aces_interchange"),
    "lin_ap1_scene": ("ACEScg", "lin_ap1", "ACES - ACEScg"),
    "lin_p3d65_scene": ("Linear P3-D65", "lin_p3d65", "Utility - Linear - P3-D65"),
    "lin_rec2020_scene": ("Linear Rec.2020", "lin_rec2020", "Utility - Linear - Rec.2020"),
    "lin_ciexyzd65_scene": ("CIE XYZ-D65 - Scene-referred", "cie_xyz_d65_scene"),
}

# A known space, or the name of one that only the configuration knows.
Source = ColorSpace | str


@contextmanager
def _refused(sentence: str, where: str = "") -> Iterator[None]:
    """Turn every exception of OpenColorIO into a SettingsError that begins with `sentence`.

    ExceptionMissingFile (a missing LUT) is no OpenColorIO Exception in Python, and pybind11 translates C++'s standard
    exceptions to built-in ones: numbers in a LUT that do not parse, names that are not UTF-8.
    """
    import PyOpenColorIO as ocio

    try:
        yield
    except (ocio.Exception, ocio.ExceptionMissingFile, RuntimeError, ValueError, IndexError, TypeError) as error:
        reasons = "; ".join(line.strip(" ;") for line in str(error).splitlines() if line.strip(" ;"))
        raise SettingsError(f"{sentence}: {reasons}", where=where, code="ocio-config") from error


@lru_cache(maxsize=4)
def _load_config(source: str) -> Any:
    import PyOpenColorIO as ocio

    with _refused("the OCIO configuration cannot be read", source):
        return ocio.Config.CreateFromFile(source)


def _source() -> str:
    return os.environ.get("OCIO") or BUILTIN_CONFIG


def _config() -> Any:
    source = _source()
    note_read(source)
    return _load_config(source)


def config_name() -> str:
    """Return the name of the configuration in use, as its file says."""
    return str(_config().getName()) or _source()


def config_id() -> str:
    """Return a digest of the configuration in use."""
    return str(_config().getCacheID())


def displays() -> list[str]:
    return list(_config().getDisplays())


def views(display: str | None = None) -> list[str]:
    """Return the names of the views of `display` (None: the default one), the default view first."""
    config = _config()
    display = display or config.getDefaultDisplay()
    names = list(config.getViews(display))
    names.sort(key=lambda name: name != config.getDefaultView(display))
    return names


def check_view(view: str | None, display: str | None = None) -> tuple[str, str]:
    """Return display and view (None: the defaults); SettingsError for unknown ones, with the list of known ones."""
    config = _config()
    if display is not None and display not in displays():
        raise SettingsError(f"no display {display!r}; {config_name()} has: {', '.join(displays())}", code="unknown-display")
    chosen = display or config.getDefaultDisplay()
    if not chosen or not views(chosen):
        raise SettingsError(
            f"{config_name()} has no {'view' if chosen else 'display'}, so no image can be displayed", code="ocio-config"
        )
    if view is not None and view not in views(chosen):
        raise SettingsError(f"no view {view!r} on {chosen!r}; there are: {', '.join(views(chosen))}", code="unknown-view")
    return chosen, view or config.getDefaultView(chosen)


def looks() -> list[str]:
    """Return the names of the configuration's looks."""
    return list(_config().getLookNames())


def check_look(look: str | None) -> None:
    """Raise SettingsError for an unknown look, with the list of known ones."""
    if look is not None and look not in looks():
        known = ", ".join(looks()) or "none"
        raise SettingsError(f"no look {look!r}; {config_name()} has: {known}", code="unknown-look")


def to_display(
    rgb: Floats,
    view: str | None = None,
    display: str | None = None,
    exposure: float = 0.0,
    *,
    look: str | None = None,
    space: ColorSpace = REC709,
) -> Floats:
    """Return display values, nominally [0,1], for (H, W, 3) in the rendering space `space`.

    `exposure` is in stops and applied first. A look replaces those of the view.
    """
    processor, by = _display_processor(view, display, look, space)
    with np.errstate(over="ignore"):
        exposed = rgb * np.float32(2.0**exposure)
    if exposure > 0:  # values that overflow show as the greatest float
        exposed = np.minimum(exposed, np.finfo(np.float32).max)
    return _applied(processor, color_space.transformed(exposed, by))


def from_display(shown: Floats, space: ColorSpace = REC709) -> Floats:
    """Return values of `space` that the default view shows as these (H, W, 3) display values in [0, 1], as nearly as it can."""
    import PyOpenColorIO as ocio

    display, view = check_view(None, None)
    known_as, by = _in_config(space, assumes=True)
    transform = ocio.DisplayViewTransform(
        src=known_as, display=display, view=view, direction=ocio.TransformDirection.TRANSFORM_DIR_INVERSE
    )
    processor = _processor(lambda config: config.getProcessor(transform), f"invert the view {view!r} of {display!r}")
    made = _applied(processor, shown)
    return made if by is None else color_space.transformed(made, np.asarray(np.linalg.inv(by), np.float64))


def check_display(view: str | None, display: str | None = None, look: str | None = None, space: ColorSpace = REC709) -> None:
    """Build what `to_display` applies; SettingsError where that fails: unknown names, missing or damaged LUTs."""
    _display_processor(view, display, look, space)


def failing_views(space: ColorSpace = REC709) -> list[tuple[str, str, str]]:
    """Return display, view and reason of all views that the configuration lists and cannot show."""
    found = []
    for display in displays():
        for view in views(display):
            try:
                check_display(view, display, None, space)
            except SettingsError as error:
                found.append((display, view, error.message))
    return found


def _display_processor(
    view: str | None, display: str | None, look: str | None, space: ColorSpace
) -> tuple[Any, Doubles | None]:
    """Return the CPU processor of a view, and the matrix to the space that it takes; a look replaces those of the view."""
    import PyOpenColorIO as ocio

    display, view = check_view(view, display)
    check_look(look)
    known_as, by = _in_config(space, assumes=True)
    transform = ocio.DisplayViewTransform(src=known_as, display=display, view=view)
    if look is None:
        return _processor(lambda config: config.getProcessor(transform), f"show the view {view!r} of {display!r}"), by
    pipeline = ocio.LegacyViewingPipeline()
    pipeline.setDisplayViewTransform(transform)
    pipeline.setLooksOverrideEnabled(True)
    pipeline.setLooksOverride(look)
    return _processor(pipeline.getProcessor, f"show the view {view!r} of {display!r} with the look {look!r}"), by


def assumed_space(space: ColorSpace = REC709) -> str | None:
    """Return the assumption on which views rest: that the scene_linear role is `space`; None where the configuration says."""
    if _known_in_config(space) is not None or (role := _find(SCENE_LINEAR)) is None:
        return None
    return (
        f"{config_name()} has no known linear space: its scene_linear role ({role}) is assumed to be {space.name}, "
        "the rendering space; if it is another one, name that with --rendering-color-space"
    )


def space_named(name: str) -> Source | None:
    """Return the space that USD or the configuration calls by a name; None where neither does."""
    found = color_space.named(name)
    if found is not None:
        return found
    space = _config().getColorSpace(name)
    if space is None:
        return None
    if space.isData():
        return color_space.named("raw")
    ids = (_interop_id(space), *space.getAliases())
    return next((ours for alias in ids if (ours := color_space.named(str(alias))) is not None), str(space.getName()))


def rendering_space(name: str) -> ColorSpace:
    """Return a linear RGB space to render in; SettingsError if the name is unknown, or its space is not linear RGB."""
    found = space_named(name)
    if found is None:
        raise SettingsError(f"neither USD nor {config_name()} has a colour space {name!r}", code="unknown-color-space")
    if isinstance(found, str):
        found = _measured(found)
    if found is None or not is_rendering_space(found):
        raise SettingsError(
            f"{name!r} is not a linear RGB space, so it cannot be the rendering space", code="unknown-color-space"
        )
    return found


def is_rendering_space(space: ColorSpace) -> bool:
    """Return whether a space is linear and has RGB primaries: (1, 1, 1) is a light's white, which it is not in XYZ."""
    return space.is_linear and not space.is_data and color_space.is_gamut(space) and space.name != "lin_ciexyzd65_scene"


def convert(rgb: Floats, source: Source, target: ColorSpace) -> Floats:
    """Return (..., 3) values converted to a linear space; SettingsError if the configuration cannot."""
    if isinstance(source, ColorSpace):
        return np.asarray(color_space.converted(rgb, source, target), np.float32)
    import PyOpenColorIO as ocio

    if _config().getColorSpace(source) is None:
        raise SettingsError(f"{config_name()} has no colour space {source!r}", code="unknown-color-space")
    known_as, by = _in_config(target)
    rows = np.asarray(rgb, np.float32).reshape(-1, 1, 3) if np.ndim(rgb) != 3 else np.asarray(rgb, np.float32)
    transform = ocio.ColorSpaceTransform(src=source, dst=known_as)
    made = _applied(_processor(lambda config: config.getProcessor(transform), f"convert {source!r} to {known_as!r}"), rows)
    back: Doubles | None = None if by is None else np.asarray(np.linalg.inv(by), np.float64)
    return color_space.transformed(made, back).reshape(np.shape(rgb))


def _interop_id(space: Any) -> str:
    return str(space.getInteropID()) if hasattr(space, "getInteropID") else ""


def _in_config(space: ColorSpace, *, assumes: bool = False) -> tuple[str, Doubles | None]:
    """Return the configuration's name of a space, or of another linear one and the matrix to that.

    `assumes`: where it has no linear space with a known name (configurations of OpenColorIO 1 name them freely), its
    scene_linear role is taken to be the space; `assumed_space` reports that.
    """
    known = _known_in_config(space)
    if known is not None:
        return known
    role = _find(SCENE_LINEAR) if assumes else None
    if role is not None:
        return role, None
    names = ", ".join(CONFIG_NAMES)
    raise SettingsError(f"{config_name()} has no known linear space (looked for {names})", code="ocio-config")


def _known_in_config(space: ColorSpace) -> tuple[str, Doubles | None] | None:
    for name in (space.name, *CONFIG_NAMES):
        found = _find(name)
        other = space if name == space.name else color_space.named(name)
        if found is not None and other is not None:
            return found, color_space.matrix(space, other)
    return None


def _find(name: str) -> str | None:
    config = _config()
    for candidate in (name, *CONFIG_NAMES.get(name, ())):
        space = config.getColorSpace(candidate)
        if space is not None:
            return str(space.getName())
    return next((str(space.getName()) for space in config.getColorSpaces() if _interop_id(space) == name), None)


def _measured(name: str) -> ColorSpace | None:
    """Return a space that only the configuration knows, measured by converting its primaries; None unless it is linear."""
    probes = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [4, 2, 1]]], np.float32)
    xyz_space = color_space.named("lin_ciexyzd65_scene")
    assert xyz_space is not None
    xyz = np.asarray(convert(probes, name, xyz_space), np.float64)[0]
    sums = xyz[:3].sum(axis=1, keepdims=True)
    if np.abs(xyz[3]).max() > 1e-6 or np.abs(xyz[4] - [4, 2, 1] @ xyz[:3]).max() > 1e-4 or (sums == 0).any():
        return None
    red, green, blue = (xyz[:3] / sums)[:, :2].round(7)
    white = xyz[:3].sum(axis=0)
    if abs(white[1] - 1.0) > 1e-3:
        return None
    around = white / white.sum()
    if np.abs(around[:2] - REC709.white).max() < 1e-5:
        around = np.array([*REC709.white, 0.0])
    corners = [(float(corner[0]), float(corner[1])) for corner in (red, green, blue, around)]
    return ColorSpace(name, corners[0], corners[1], corners[2], corners[3])


def _processor(made: Callable[[Any], Any], what: str) -> Any:
    """Return a CPU processor; `what` it does, for errors. LUTs are read here, so that faults are reported before rendering."""
    with _refused(f"the OCIO configuration cannot {what}", _source()):
        processor = made(_config())
        if is_watching():
            for lut in processor.getProcessorMetadata().getFiles():
                note_read(lut)
        return processor.getDefaultCPUProcessor()


def _applied(processor: Any, rgb: Floats) -> Floats:
    out = np.array(rgb, np.float32, order="C")
    # Pixels are independent, and an ACES view costs 0.6 microseconds for each: share the rows among the cores.
    with ThreadPoolExecutor(min(8, len(os.sched_getaffinity(0)))) as threads:
        list(threads.map(processor.applyRGB, np.array_split(out, min(out.shape[0], 64))))
    return out
