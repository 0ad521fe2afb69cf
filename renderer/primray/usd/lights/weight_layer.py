"""Weights of lights written as a layer of overs: intensity times the weight, and color where channels differ."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pxr import Gf, Sdf, Usd

from ..stage.messages import scene_errors
from ..stage.metadata import time_codes_per_second
from ..stage.reads import default_value, value_at
from ..stage.time_varying import has_spline, sample_times

INTENSITY, COLOR = "inputs:intensity", "inputs:color"


@scene_errors()
def weight_layer(stage: Usd.Stage, weights: Mapping[str, tuple[float, float, float]]) -> tuple[str, dict[str, str]]:
    """Return the text of a layer that multiplies lights' emission by weights for R, G and B, and why lights are left out.

    `weights` are by the light's path, in the linear Rec.709 of UsdLux's colours. The layer holds the product with the composed
    values, time samples included, and is meant to be the strongest sublayer. A light in an instance cannot be edited by itself.
    """
    layer = Sdf.Layer.CreateAnonymous(".usda")
    target = Usd.Stage.Open(layer)
    target.SetTimeCodesPerSecond(time_codes_per_second(stage))  # else USD moves the samples of a sublayer
    left_out: dict[str, str] = {}
    for path, weight in weights.items():
        prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
        if not prim:
            left_out[path] = "the stage has no such prim"
        elif prim.IsInstanceProxy():
            left_out[path] = "it is in an instance: all instances share one light"
        elif not prim.HasAttribute(INTENSITY):
            left_out[path] = f"it has no {INTENSITY}"
        elif any(has_spline(prim.GetAttribute(name)) for name in (INTENSITY, COLOR)):
            left_out[path] = "its intensity or colour is a spline"
        elif any(_is_in_session(stage, prim.GetAttribute(name)) for name in (INTENSITY, COLOR)):
            left_out[path] = "the session layer has its intensity or colour, and is stronger than any sublayer"
        else:
            _weigh(prim, target.OverridePrim(path), weight)
    return layer.ExportToString(), left_out


def _is_in_session(stage: Usd.Stage, attribute: Usd.Attribute) -> bool:
    own = set(stage.GetLayerStack()) - set(stage.GetLayerStack(includeSessionLayers=False))
    return any(layer.GetAttributeAtPath(attribute.GetPath()) for layer in own)


def _weigh(light: Usd.Prim, over: Usd.Prim, weight: tuple[float, float, float]) -> None:
    most = max(weight)
    if most != 1:
        _multiplied(light.GetAttribute(INTENSITY), over, Sdf.ValueTypeNames.Float, lambda value: value * most)
    if most > 0 and min(weight) != most:
        factor = [w / most for w in weight]

        def tinted(value: Any) -> Any:
            return Gf.Vec3f(*(v * f for v, f in zip(value, factor, strict=True)))

        _multiplied(light.GetAttribute(COLOR), over, Sdf.ValueTypeNames.Color3f, tinted)


def _multiplied(source: Usd.Attribute, over: Usd.Prim, kind: Any, made: Any) -> None:
    written = over.CreateAttribute(source.GetName(), kind, custom=False)
    times = sample_times(source)
    for time in times:
        written.Set(made(value_at(source, time)), time)
    if not times:
        written.Set(made(default_value(source)))
