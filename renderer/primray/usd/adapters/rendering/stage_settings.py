"""Render settings authored on RenderSettings and RenderProducts: primray's own attributes, else those of other renderers.

PrimrayRenderSettingsAPI and PrimrayRenderProductAPI (schemas/usd) declare primray's. Authored attributes are read whether or
not the schemas are applied or registered; fallback values of the schemas do not count. A product's attribute overrides its
settings', attribute by attribute, as for UsdRenderProduct.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pxr import Usd

from ....description.picture_file import PictureView
from ....diagnostics import Diagnostics
from ....errors import LimitError, SettingsError, did_you_mean
from ....settings import MAX_STOPS, RenderSettings
from ....settings.stage_settings import CHECKPOINT_EVERY, STOPS, Asked, StageSettings
from ...stage.reads import authored_attributes
from ...stage.values import When, value
from .foreign_settings import Authored, foreign_settings, has_integrator

PREFIX = "primray:"
SHOWN = 80  # characters of a value that cannot be used
SETTINGS = {
    f"{PREFIX}samples": "spp",
    f"{PREFIX}targetError": "target_error",
    f"{PREFIX}errorMetric": "error_metric",
    f"{PREFIX}timeLimit": "time_limit_s",
    f"{PREFIX}maxDepth": "max_depth",
    f"{PREFIX}filter": "filter",
    f"{PREFIX}filterWidth": "filter_width",
    f"{PREFIX}denoise": "denoise",
    f"{PREFIX}motionError": "motion_error",
    f"{PREFIX}checkpointInterval": CHECKPOINT_EVERY,
}
VIEWS = {f"{PREFIX}view": "view", f"{PREFIX}display": "display", f"{PREFIX}look": "look", f"{PREFIX}exposure": "exposure"}
NAMES = frozenset({*SETTINGS, *VIEWS})  # of settings and products
VARIABLES = frozenset({f"{PREFIX}errors"})  # of render variables


def stage_settings(
    settings: Usd.Prim, product: Usd.Prim | None, when: When, diagnostics: Diagnostics
) -> tuple[StageSettings, PictureView]:
    """Return the render settings of a product (those that it does not author are its RenderSettings'), and its view."""
    found = _authored(settings, when)
    if product is not None:
        found |= _authored(product, when)
    if not found and not has_integrator(settings):
        return StageSettings(), PictureView()
    for prim in (settings, *([] if product is None else [product])):
        note_unknown(prim, [one.name for one in found.values() if one.prim == str(prim.GetPath())], NAMES, diagnostics)
    own = [one for name in SETTINGS if name in found and (one := _setting(found[name], diagnostics)) is not None]
    names = {one.name for one in own}
    has_stop = bool(names.intersection(STOPS))
    others = [one for one in foreign_settings(settings, product, found, when, diagnostics) if one.name not in names]
    own += [one for one in others if not (has_stop and one.name in STOPS)]
    return StageSettings(tuple(own)), _view(found, diagnostics)


def _authored(prim: Usd.Prim, when: When) -> dict[str, Authored]:
    """Return the attributes in the namespaces of known renderers."""
    found = {}
    for attribute in authored_attributes(prim):
        name = attribute.GetName()
        if name.startswith((PREFIX, "karma:", "arnold:", "ri:", "cycles:")):
            given = value(attribute, when)
            if given is not None:
                found[name] = Authored(str(prim.GetPath()), name, _as_written(given, str(attribute.GetTypeName())))
    return found


def _as_written(given: Any, type_name: str) -> Any:
    """Return a float as its layer writes it: 0.001, not the double 0.0010000000474974513."""
    return float(str(np.float32(given))) if type_name in ("float", "half") and isinstance(given, float) else given


def note_unknown(prim: Usd.Prim, found: Iterable[str], names: frozenset[str], diagnostics: Diagnostics) -> None:
    """Report unknown attributes in primray's namespace, as a misspelt one would silently do nothing."""
    for name in found:
        if name.startswith(PREFIX) and name not in names:
            hint = did_you_mean(name, sorted(names), otherwise=f"there are {', '.join(sorted(names))}.")
            diagnostics.add("render-settings-input", str(prim.GetPath()), f"{name} is unknown: {hint}", name)


def _setting(found: Authored, diagnostics: Diagnostics) -> Asked | None:
    """Return the setting of an attribute; None, with a diagnostic, if its value is invalid."""
    name = SETTINGS[found.name]
    try:
        if name == CHECKPOINT_EVERY:
            RenderSettings(time_limit_s=found.value)  # has the same range
            accepted = float(found.value)
        else:
            accepted = getattr(RenderSettings(**{name: found.value}), name)
    except (SettingsError, LimitError) as error:
        message = f"{found.name} = {repr(found.value)[:SHOWN]} cannot be used, so the default is: {error.message}."
        diagnostics.add("render-settings-input", found.prim, message, found.name)
        return None
    return Asked(name, accepted, found.prim, found.name)


def _view(found: dict[str, Authored], diagnostics: Diagnostics) -> PictureView:
    chosen: dict[str, Any] = {}
    for name, member in VIEWS.items():
        if name not in found:
            continue
        given = found[name].value
        is_number = isinstance(given, int | float) and not isinstance(given, bool) and abs(given) <= MAX_STOPS
        if is_number if member == "exposure" else isinstance(given, str) and bool(given):
            chosen[member] = float(given) if member == "exposure" else given
        else:
            wanted = f"number of stops from -{MAX_STOPS:g} to {MAX_STOPS:g}" if member == "exposure" else "name"
            message = f"{name} = {repr(given)[:SHOWN]} is not a {wanted}: the default is used."
            diagnostics.add("render-settings-input", found[name].prim, message, name)
    return PictureView(**chosen)
