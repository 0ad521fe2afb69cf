"""A stage's and its layers' own metadata, whatever types they have: the only place that reads them (a gate holds that).

USD's readers fail where a value is not of the schema's type, though it may be a number as well as any. Then the value as it
stands is taken if it is of use, else the default; either is noted (guarded.noting).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from .guarded import FAILURES, note

_LONGEST = 60  # of a value in a message
# What a layer may say of itself that changes a picture or its times; USD's readers fail on values of other types. Each of the
# others has its own reader here.
_CHANGING = """startTimeCode endTimeCode framesPerSecond framePrecision defaultPrim customLayerData expressionVariables
    colorConfiguration colorManagementSystem"""
_OF_LAYERS = frozenset(_CHANGING.split())


def layer_value(layer: Sdf.Layer, name: str) -> Any:
    """A piece of a layer's own metadata, of whatever type; None where it says nothing."""
    try:
        return layer.pseudoRoot.GetInfo(name) if layer.pseudoRoot.HasInfo(name) else None
    except FAILURES:
        note("stage-metadata", "", f"{name} cannot be read.", name)
        return None


def stage_value(stage: Usd.Stage, name: str) -> Any:
    """The session's or the root layer's opinion; None where neither has one."""
    for layer in (stage.GetSessionLayer(), stage.GetRootLayer()):
        if layer and (found := layer_value(layer, name)) is not None:
            return found
    return None


def wrong_values(layer: Sdf.Layer) -> list[tuple[str, Any]]:
    """Names and values of the layer's metadata that are of other types than their schema's."""
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
    """In a message: short."""
    text = "blocked" if isinstance(found, Sdf.ValueBlock) else repr(found)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def authored_up_axis(stage: Usd.Stage) -> str:
    """Any text."""
    return _text(stage, "upAxis", lambda: UsdGeom.GetStageUpAxis(stage), str(UsdGeom.GetFallbackUpAxis()))


def authored_meters_per_unit(stage: Usd.Stage) -> float:
    """Any number."""
    return _number(stage, "metersPerUnit", lambda: UsdGeom.GetStageMetersPerUnit(stage), 0.01)


def usable_length(meters: float) -> float:
    """Return a metersPerUnit, USD's default for what is no length."""
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
    """Its path; None where the stage names none that is there."""
    try:
        return str(stage.GetDefaultPrim().GetPath()) if stage.HasDefaultPrim() else None
    except FAILURES:
        name = _text(stage, "defaultPrim", lambda: stage.GetRootLayer().defaultPrim, "")
        path = f"/{name.removeprefix('/')}"
        return path if name and Sdf.Path.IsValidPathString(path) and stage.GetPrimAtPath(path) else None


def render_settings_path(stage: Usd.Stage) -> str | None:
    """As the metadata say, "" where they are no text; None where they say nothing."""
    found = stage_value(stage, "renderSettingsPrimPath")
    if found is None or isinstance(found, str):
        return found
    note("stage-metadata", "", f"renderSettingsPrimPath is {shown(found)}, no text: it is ignored.", "renderSettingsPrimPath")
    return None


def layer_data(stage: Usd.Stage, name: str) -> Any:
    """What a tool left under this name in customLayerData, the session layer's over the root layer's; None where nothing is."""
    try:
        return stage.GetMetadataByDictKey("customLayerData", name)
    except FAILURES:
        note("stage-metadata", "", f"customLayerData:{name} cannot be read.", "customLayerData")
        return None


def rate_of(layer: Sdf.Layer) -> float:
    """A layer's timeCodesPerSecond; not a number where it is of another type."""
    try:
        return float(layer.timeCodesPerSecond)
    except FAILURES:
        return math.nan


def wrong_rate(layer: Sdf.Layer) -> str | None:
    """A layer's timeCodesPerSecond as text, where it is of another type than a number."""
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
    """Return an asset path as authored in a layer of the stage; of an expression, its value, "" where it has none."""
    if not path.startswith("`"):
        return path
    try:
        value = Sdf.VariableExpression(path).Evaluate(_variables(layer, stage)).value
    except FAILURES:
        return ""
    return value if isinstance(value, str) else ""


def _variables(layer: Sdf.Layer, stage: Usd.Stage) -> dict[str, Any]:
    """Return the expression variables that USD has composed for the layer: those of the first layer stack that it is in."""
    stacks = stage._GetPcpCache().FindAllLayerStacksUsingLayer(layer)
    return dict(stacks[0].expressionVariables.GetVariables()) if stacks else {}
