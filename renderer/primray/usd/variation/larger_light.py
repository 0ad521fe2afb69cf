"""A light made larger for a trial, with the same power, in a stage's session layer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Sdf, Usd, UsdLux

from ..stage.layer_copy import restored
from ..stage.messages import scene_errors
from ..stage.reads import default_value
from ..stage.time_varying import has_time_values

SIZES = ("inputs:radius", "inputs:width", "inputs:height", "inputs:angle")
LENGTH = "inputs:length"  # of lights whose power does not grow with the square of their radius


def can_be_larger(stage: Usd.Stage, path: str) -> bool:
    """Return whether the prim is a light that has sizes of its own, which do not change over time."""
    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not prim or prim.IsInstanceProxy() or not prim.HasAPI(UsdLux.LightAPI) or prim.HasAttribute(LENGTH):
        return False
    own = [prim.GetAttribute(name) for name in (*SIZES, "inputs:intensity") if prim.HasAttribute(name)]
    sizes = [default_value(prim.GetAttribute(name)) for name in SIZES if prim.HasAttribute(name)]
    return bool(sizes) and all(size is not None and size > 0 for size in sizes) and not any(has_time_values(one) for one in own)


@contextmanager
def larger_light(stage: Usd.Stage, path: str, factor: float) -> Iterator[None]:
    """Give a light `factor` times its sizes while the block runs, and less radiance, so that its power stays.

    The intensity of a normalized light is its power, and stays as it is.
    """
    session = stage.GetSessionLayer()
    with restored(session):
        with scene_errors(), Usd.EditContext(stage, session):
            _enlarge(stage.GetPrimAtPath(path), factor)
        yield


def _enlarge(prim: Usd.Prim, factor: float) -> None:
    for name in SIZES:
        attribute = prim.GetAttribute(name)
        if attribute and (size := default_value(attribute)) is not None:
            attribute.Set(float(size) * factor)
    normalized = prim.GetAttribute("inputs:normalize")
    if normalized and default_value(normalized):
        return
    intensity = prim.GetAttribute("inputs:intensity")
    intensity.Set(float(default_value(intensity)) / factor**2)
