"""Shapes that wear OpenPBR materials, in a sky and beside a lamp."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

TYPES = {bool: Sdf.ValueTypeNames.Bool, float: Sdf.ValueTypeNames.Float, tuple: Sdf.ValueTypeNames.Color3f}


def wear(shape: UsdGeom.Gprim, path: str, inputs: Mapping[str, object], shader_id: str) -> None:
    """A material of its own, by MaterialX's output."""
    stage = shape.GetPrim().GetStage()
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/s")
    shader.CreateIdAttr(shader_id)
    for name, value in inputs.items():
        shader.CreateInput(name, TYPES[type(value)]).Set(value)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.CreateOutput("out", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(material)


def light(stage: Usd.Stage) -> None:
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(0.5)
    lamp = UsdLux.SphereLight.Define(stage, "/lamp")
    lamp.CreateRadiusAttr(0.3)
    lamp.CreateIntensityAttr(20)
    lamp.AddTranslateOp().Set((2, 3, 4))
