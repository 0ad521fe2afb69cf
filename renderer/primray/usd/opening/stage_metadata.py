"""Checks of the metadata of a stage and its layers: rates that would hang USD, differing units, meaningless values.

Pcp maps time across an arc by the ratio of the two layers' timeCodesPerSecond. Where that is 0, infinite or not a number,
usd-core 26.11 never returns from listing an attribute's time samples (all other calls do return).
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Any

from pxr import Sdf, Tf, Usd, UsdUtils

from ...diagnostics import Diagnostics
from ...errors import InvalidSceneError
from ..materialx.stand_ins import without_marks
from ..querying.stage_values import (
    authored_meters_per_unit,
    authored_up_axis,
    has_rate,
    is_number,
    layer_value,
    rate_of,
    shown,
    usable_length,
    wrong_values,
)
from ..querying.time_varying import has_samples

# Products and quotients of rates in this range stay within double's, however long the chain of arcs.
_RATES = (1e-9, 1e12)


def stage_name(stage: Usd.Stage) -> str:
    """Return the root layer's file name without its folders, as pictures name it; "" for a layer in memory."""
    layer = stage.GetRootLayer()
    return "" if layer.anonymous else os.path.basename(without_marks(layer.identifier))


def check_rates(stage: Usd.Stage, diagnostics: Diagnostics) -> None:
    """Raise InvalidSceneError where reading time samples would hang; report bad rates that no sample depends on."""
    session = stage.GetSessionLayer()
    layers = [layer for layer in stage.GetUsedLayers() if layer != session or has_rate(layer)]
    bad = [layer for layer in layers if not (rate_of(layer) > 0 and _can_be_mapped(layer))]
    if not bad:
        return
    rates = ", ".join(f"{rate_of(layer):g} in {layer.identifier}" for layer in bad[:3])
    differ = len({rate_of(layer) for layer in layers}) > 1
    if differ and not all(map(_can_be_mapped, bad)) and has_samples(layers):
        raise InvalidSceneError(
            f"timeCodesPerSecond is {rates}: USD cannot map time samples from one layer to another, and would hang",
            where=bad[0].identifier,
            code="time-metadata",
        )
    diagnostics.add("time-metadata", "", f"timeCodesPerSecond is {rates}.", "timeCodesPerSecond")


def _can_be_mapped(layer: Sdf.Layer) -> bool:
    rate = rate_of(layer)
    return math.isfinite(rate) and _RATES[0] <= abs(rate) <= _RATES[1]


def note_wrong_types(stage: Usd.Stage, diagnostics: Diagnostics) -> None:
    """Report metadata of layers whose values are not of their schema's types; they are ignored."""
    for layer in stage.GetUsedLayers():
        for name, value in wrong_values(layer):
            message = f"{name} is {shown(value)} in {layer.identifier}, not of its schema's type: it is ignored."
            diagnostics.add("stage-metadata", "", message, name)


def note_units(stage: Usd.Stage, diagnostics: Diagnostics) -> None:
    """Report layers authored in other units than the stage's: USD composes their numbers without conversion."""
    root = stage.GetRootLayer()
    for name, of_stage in (("metersPerUnit", meters_per_unit(stage)), ("upAxis", up_axis(stage))):
        others: dict[Any, list[str]] = {}
        for layer in stage.GetUsedLayers():
            value = layer_value(layer, name) if layer != root else None
            if value is not None and not _same(value, of_stage):
                told = value if is_number(value) or isinstance(value, str) else shown(value)
                others.setdefault(told, []).append(layer.identifier)
        for value, layers in others.items():
            more = f" and {len(layers) - 1} more" if len(layers) > 1 else ""
            diagnostics.add("layer-units", "", f"{name} is {value} in {layers[0]}{more}, {of_stage} in the stage.", name)


def _same(a: Any, b: Any) -> bool:
    return math.isclose(a, b, rel_tol=1e-6) if isinstance(a, float) and isinstance(b, float) else bool(a == b)


def up_axis(stage: Usd.Stage, diagnostics: Diagnostics | None = None) -> str:
    """Return "Y" or "Z"; report any other axis, and use Y."""
    axis = authored_up_axis(stage)
    if axis not in ("Y", "Z") and diagnostics is not None:
        diagnostics.add("stage-metadata", "", f"upAxis is {axis!r}, neither Y nor Z; Y is used.", "upAxis")
    return axis if axis in ("Y", "Z") else "Y"


def meters_per_unit(stage: Usd.Stage, diagnostics: Diagnostics | None = None) -> float:
    """Return the stage's metersPerUnit, above 0; report a value that is no length, and use 0.01."""
    value = authored_meters_per_unit(stage)
    used = usable_length(value)
    if used != value and diagnostics is not None:
        diagnostics.add("stage-metadata", "", f"metersPerUnit is {value:g}, not a length; 0.01 is used.", "metersPerUnit")
    return used


def used_files(paths: Iterable[str]) -> set[str]:
    """Return the files that these layers name as sublayers, references or payloads; unreadable layers name none."""
    used: set[str] = set()
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    for path in paths:
        try:
            layer = Sdf.Layer.FindOrOpen(path)
        except Tf.ErrorException:
            continue
        if layer is None:
            continue
        for asset in layer.GetCompositionAssetDependencies():
            file = os.path.realpath(layer.ComputeAbsolutePath(asset))
            if file != os.path.realpath(path):
                used.add(file)
    delegate.TakeUncoalescedDiagnostics()
    return used


def layer_names(stage: Usd.Stage) -> list[str]:
    """Return the layers that the stage is composed of, strongest layer stack first, without empty layers in memory."""
    local = stage.GetLayerStack()
    rest = sorted((layer for layer in stage.GetUsedLayers() if layer not in local), key=lambda layer: str(layer.identifier))
    return [without_marks(str(layer.identifier)) for layer in (*local, *rest) if not _is_empty(layer)]


def _is_empty(layer: Sdf.Layer) -> bool:
    """Return whether a layer in memory has no prims of its own; one that only has sublayers counts as empty."""
    return bool(layer.anonymous and (layer.empty or (layer.subLayerPaths and not layer.rootPrims)))
