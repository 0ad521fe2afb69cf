"""Metadata of a stage and of its layers: the only place that reads them (a gate holds that), and checks of their values.

USD's readers fail where a value is not of the schema's type, even if it is a usable number. Then the authored value is used if
it makes sense, else the default; both cases are reported (reads.noting).

Pcp maps time across an arc by the ratio of the two layers' timeCodesPerSecond. Where that is 0, infinite or not a number,
usd-core 26.11 never returns from listing an attribute's time samples (all other calls do return).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from typing import Any

from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils

from ...diagnostics import Diagnostics
from ...errors import InvalidSceneError, SettingsError
from ..materials.materialx.substitute_layers import with_original_names
from .reads import FAILURES, note
from .time_varying import has_samples

_LONGEST = 60  # characters of a value in a message
# Layer metadata that may change a picture or its times, and on which USD's readers fail if the type is wrong. All others have
# a reader of their own below.
_CHANGING = """startTimeCode endTimeCode framesPerSecond framePrecision defaultPrim customLayerData expressionVariables
    colorConfiguration colorManagementSystem"""
_OF_LAYERS = frozenset(_CHANGING.split())


def layer_value(layer: Sdf.Layer, name: str) -> Any:
    """Return a piece of a layer's own metadata, whatever its type; None where it is not authored."""
    try:
        return layer.pseudoRoot.GetInfo(name) if layer.pseudoRoot.HasInfo(name) else None
    except FAILURES:
        note("stage-metadata", "", f"{name} cannot be read.", name)
        return None


def prim_value(spec: Sdf.PrimSpec, name: str) -> Any:
    """Return a piece of metadata that a layer has for a prim; the schema's fallback where it has none."""
    return spec.GetInfo(name)


def stage_value(stage: Usd.Stage, name: str) -> Any:
    """Return the session layer's or the root layer's opinion; None where neither has one."""
    for layer in (stage.GetSessionLayer(), stage.GetRootLayer()):
        if layer and (found := layer_value(layer, name)) is not None:
            return found
    return None


def wrong_values(layer: Sdf.Layer) -> list[tuple[str, Any]]:
    """Return names and values of the layer's metadata whose types are not their schema's."""
    return [(name, layer_value(layer, name)) for name in layer.pseudoRoot.ListInfoKeys() if _is_wrong(layer, name)]


def _is_wrong(layer: Sdf.Layer, name: str) -> bool:
    if name not in _OF_LAYERS:
        return False
    try:
        getattr(layer, name)
        return False
    except FAILURES:
        return True


def is_number(found: Any) -> bool:
    return isinstance(found, int | float) and not isinstance(found, bool)


def _number(stage: Usd.Stage, name: str, reads: Callable[[], float], default: float) -> float:
    try:
        return float(reads())
    except FAILURES:
        found = stage_value(stage, name)
    value = float(found) if is_number(found) else default
    note("stage-metadata", "", f"{name} is {shown(found)}, not of its schema's type; {value:g} is used.", name)
    return value


def _text(stage: Usd.Stage, name: str, reads: Callable[[], Any], default: str) -> str:
    try:
        return str(reads() or default)
    except FAILURES:
        found = stage_value(stage, name)
    value = found if isinstance(found, str) else default
    note("stage-metadata", "", f"{name} is {shown(found)}, not of its schema's type; {value or 'none'!r} is used.", name)
    return value


def shown(found: Any) -> str:
    """Return a value as text for a message, shortened."""
    text = "blocked" if isinstance(found, Sdf.ValueBlock) else repr(found)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def authored_up_axis(stage: Usd.Stage) -> str:
    """Return the stage's upAxis, which may be any text."""
    return _text(stage, "upAxis", lambda: UsdGeom.GetStageUpAxis(stage), str(UsdGeom.GetFallbackUpAxis()))


def authored_meters_per_unit(stage: Usd.Stage) -> float:
    """Return the stage's metersPerUnit, which may be any number."""
    return _number(stage, "metersPerUnit", lambda: UsdGeom.GetStageMetersPerUnit(stage), 0.01)


def usable_length(meters: float) -> float:
    """Return a metersPerUnit, or USD's default for one that is not finite and positive."""
    return meters if math.isfinite(meters) and meters > 0 else 0.01


def start_time_code(stage: Usd.Stage) -> float:
    return _number(stage, "startTimeCode", stage.GetStartTimeCode, 0.0)


def end_time_code(stage: Usd.Stage) -> float:
    return _number(stage, "endTimeCode", stage.GetEndTimeCode, 0.0)


def has_time_code_range(stage: Usd.Stage) -> bool:
    return bool(stage.HasAuthoredTimeCodeRange())


def time_codes_per_second(stage: Usd.Stage) -> float:
    return _number(stage, "timeCodesPerSecond", stage.GetTimeCodesPerSecond, 24.0)


def frames_per_second(stage: Usd.Stage) -> float:
    return _number(stage, "framesPerSecond", stage.GetFramesPerSecond, 24.0)


def default_prim(stage: Usd.Stage) -> str | None:
    """Return the path of the default prim; None where the stage names none that exists."""
    try:
        return str(stage.GetDefaultPrim().GetPath()) if stage.HasDefaultPrim() else None
    except FAILURES:
        name = _text(stage, "defaultPrim", lambda: stage.GetRootLayer().defaultPrim, "")
        path = f"/{name.removeprefix('/')}"
        return path if name and Sdf.Path.IsValidPathString(path) and stage.GetPrimAtPath(path) else None


def render_settings_path(stage: Usd.Stage) -> str | None:
    """Return renderSettingsPrimPath from the metadata; None where it is not authored or no text."""
    found = stage_value(stage, "renderSettingsPrimPath")
    if found is None or isinstance(found, str):
        return found
    note("stage-metadata", "", f"renderSettingsPrimPath is {shown(found)}, not text: it is ignored.", "renderSettingsPrimPath")
    return None


def layer_data(stage: Usd.Stage, name: str) -> Any:
    """Return what a tool left under this name in customLayerData, session layer over root layer; None where nothing is."""
    try:
        return stage.GetMetadataByDictKey("customLayerData", name)
    except FAILURES:
        note("stage-metadata", "", f"customLayerData:{name} cannot be read.", "customLayerData")
        return None


def rate_of(layer: Sdf.Layer) -> float:
    """Return a layer's timeCodesPerSecond; NaN where it is not a number."""
    try:
        return float(layer.timeCodesPerSecond)
    except FAILURES:
        return math.nan


def wrong_rate(layer: Sdf.Layer) -> str | None:
    """Return a layer's timeCodesPerSecond as text where it is authored and not a number, else None."""
    return shown(layer_value(layer, "timeCodesPerSecond")) if math.isnan(rate_of(layer)) and has_rate(layer) else None


def has_rate(layer: Sdf.Layer) -> bool:
    return bool(layer.HasTimeCodesPerSecond())


def layer_default_prim(layer: Sdf.Layer) -> str | None:
    found = layer_value(layer, "defaultPrim")
    return found or None if isinstance(found, str) else None


def spec_field(spec: Sdf.Spec, field: str) -> Any:
    """Return a field of a spec; None where it has none."""
    if field == "subLayerOffsets":  # USD has no conversion of the list to Python
        return [(each.offset, each.scale) for each in spec.layer.subLayerOffsets]
    return spec.GetInfo(field) if spec.HasInfo(field) else None


def has_expression_variables(layer: Sdf.Layer) -> bool:
    try:
        return bool(layer.expressionVariables)
    except FAILURES:
        return True


def asset_of_expression(path: str, layer: Sdf.Layer, stage: Usd.Stage) -> str:
    """Return an asset path as authored in a layer of the stage; for an expression its value, or "" if it has none."""
    if not path.startswith("`"):
        return path
    try:
        value = Sdf.VariableExpression(path).Evaluate(_variables(layer, stage)).value
    except FAILURES:
        return ""
    return value if isinstance(value, str) else ""


def _variables(layer: Sdf.Layer, stage: Usd.Stage) -> dict[str, Any]:
    """Return the expression variables that USD has composed for the layer: those of the first layer stack that contains it."""
    stacks = stage._GetPcpCache().FindAllLayerStacksUsingLayer(layer)
    return dict(stacks[0].expressionVariables.GetVariables()) if stacks else {}


# Products and quotients of rates in this range stay within double's, however long the chain of arcs.
_RATES = (1e-9, 1e12)


def not_a_stage(value: object) -> SettingsError:
    return SettingsError(f"a stage must be a path or a Usd.Stage, not {type(value).__name__}", where="stage")


def stage_name(stage: Usd.Stage) -> str:
    """Return the root layer's file name without its folders, as pictures name it; "" for a layer in memory."""
    if not isinstance(stage, Usd.Stage):
        raise not_a_stage(stage)
    layer = stage.GetRootLayer()
    return "" if layer.anonymous else os.path.basename(with_original_names(layer.identifier))


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
        except (Tf.ErrorException, UnicodeError):  # the path itself may not be UTF-8
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
    return [with_original_names(str(layer.identifier)) for layer in (*local, *rest) if not _is_empty(layer)]


def _is_empty(layer: Sdf.Layer) -> bool:
    """Return whether a layer in memory has no prims of its own; one that only has sublayers counts as empty."""
    return bool(layer.anonymous and (layer.empty or (layer.subLayerPaths and not layer.rootPrims)))


def names_in(spec: Sdf.PrimSpec) -> list[str]:
    """Return the names of the properties that a spec has; asked for through the list of properties they take eight times as
    long."""
    names: list[str] = spec.GetInfo("properties")
    return names
