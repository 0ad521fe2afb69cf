"""Light paths as a layer of curves, to be looked at over the stage that they were traced in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from ..stage.metadata import meters_per_unit, up_axis

Points = Sequence[tuple[float, float, float]]
Curve = tuple[Points, tuple[float, float, float], float]  # points in the world, colour, opacity
LIGHT_PATHS = "primray_light_paths"  # name of the layer's default prim


def light_path_layer(stage: Usd.Stage, curves: Mapping[str, Sequence[Curve]], width: float, about: Mapping[str, Any]) -> str:
    """Return the text of a layer with one BasisCurves prim for each name in `curves`, below a Scope.

    `about` is the customData of the Scope.
    Curves are linear, have the purpose "guide", and are `width` scene units wide. The layer has the stage's up axis and unit,
    so that it can be a sublayer of it.
    """
    layer = Sdf.Layer.CreateAnonymous(".usda")
    made = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(made, up_axis(stage))
    UsdGeom.SetStageMetersPerUnit(made, meters_per_unit(stage))
    scope = UsdGeom.Scope.Define(made, f"/{LIGHT_PATHS}")
    scope.CreatePurposeAttr(UsdGeom.Tokens.guide)
    made.SetDefaultPrim(scope.GetPrim())
    scope.GetPrim().SetCustomData(_plain(about))
    for name, own in curves.items():
        if own:
            _define(made, scope.GetPath().AppendChild(name), own, width)
    return str(layer.ExportToString())


def _define(made: Usd.Stage, path: Sdf.Path, own: Sequence[Curve], width: float) -> None:
    shape = UsdGeom.BasisCurves.Define(made, path)
    shape.CreateTypeAttr(UsdGeom.Tokens.linear)
    shape.CreatePurposeAttr(UsdGeom.Tokens.guide)
    points = [Gf.Vec3f(*point) for line, *_ in own for point in line]
    shape.CreateCurveVertexCountsAttr([len(line) for line, *_ in own])
    shape.CreatePointsAttr(points)
    shape.CreateWidthsAttr([width])
    shape.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    around = [(min(point[k] for point in points), max(point[k] for point in points)) for k in range(3)]
    shape.CreateExtentAttr(
        [Gf.Vec3f(*(low - width / 2 for low, _ in around)), Gf.Vec3f(*(high + width / 2 for _, high in around))]
    )
    shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform).Set([Gf.Vec3f(*color) for _, color, _ in own])
    shape.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.uniform).Set([opacity for *_, opacity in own])


def _plain(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return values as customData holds them: numbers, texts, arrays of either, and dictionaries."""
    found: dict[str, Any] = {}
    for name, value in about.items():
        if isinstance(value, Mapping):
            found[name] = _plain(value)
        elif isinstance(value, list | tuple):
            texts = any(isinstance(one, str) for one in value)
            found[name] = Vt.StringArray(list(value)) if texts else Vt.DoubleArray([float(one) for one in value])
        else:
            found[name] = value
    return found
