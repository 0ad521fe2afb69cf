"""Metadata of a stage and of its layers, whatever types their values have: the only place that reads them (a gate holds that).

USD's readers fail where a value is not of the schema's type, even if it is a usable number. Then the authored value is used if
it makes sense, else the default; both cases are reported (guarded.noting).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from .guarded import FAILURES, note

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
