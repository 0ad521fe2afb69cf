"""UsdShadeMaterial to a Surface: UsdPreviewSurface's constant inputs, also through interface connections.

What comes from a texture or any other shader node is replaced by the texture's fallback or the input's default and
reported. A material whose surface shader is not UsdPreviewSurface has no surface of ours: the shape shows its displayColor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pxr import Usd, UsdShade

from ...description import Surface
from ..context import Context
from ..read import value

Color = tuple[float, float, float]

# UsdPreviewSurface specification, input defaults that matter only when authored otherwise.
_IGNORED_INPUTS = {"normal": (0.0, 0.0, 1.0), "displacement": 0.0}


@dataclass(frozen=True)
class Material:
    """`surface` is None where the displayColor stands in; `hidden`: cut out altogether by opacityThreshold."""

    surface: Surface | None
    hidden: bool = False


def material(prim: Usd.Prim, ctx: Context) -> Material:
    """The material's surface, translated once."""
    path = ctx.shown(str(prim.GetPath()))
    if path not in ctx.materials:
        ctx.materials[path] = _translate(UsdShade.Material(prim), path, ctx)
    made: Material = ctx.materials[path]
    return made


def _translate(usd_material: UsdShade.Material, path: str, ctx: Context) -> Material:
    shader, _, _ = usd_material.ComputeSurfaceSource()
    if not shader:
        others = [o.GetBaseName() for o in usd_material.GetSurfaceOutputs() if o.HasConnectedSource()]
        reason = f"only {', '.join(others)}" if others else "no surface output that leads to a shader"
        ctx.warn("shader-ignored", path, f"The material has {reason}: displayColor is used.")
        return Material(None)
    identifier = shader.GetShaderId() or "a shader without id"
    if identifier != "UsdPreviewSurface":
        ctx.warn("shader-ignored", path, f"The surface shader is {identifier}: displayColor is used.")
        return Material(None)
    return _preview_surface(shader, path, ctx)


def _preview_surface(shader: UsdShade.Shader, path: str, ctx: Context) -> Material:
    inputs = {str(i.GetBaseName()): i for i in shader.GetInputs()}

    def number(name: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
        raw = _input_value(inputs.get(name), default, path, ctx)
        if not isinstance(raw, int | float) or not math.isfinite(raw):
            ctx.warn("wrong-type", path, f"{name} = {raw!r} is not a finite number; {default:g} is used.")
            return default
        if not low <= raw <= high:
            ctx.warn("material-input", path, f"{name} = {raw:g} is outside [{low:g}, {high:g}] and is clamped.")
        return float(min(max(raw, low), high))

    def color(name: str, default: Color) -> Color:
        raw = _input_value(inputs.get(name), default, path, ctx)
        try:
            r, g, b = (float(x) for x in raw)
        except (TypeError, ValueError):
            r = g = b = math.nan
        if not all(map(math.isfinite, (r, g, b))):
            ctx.warn("wrong-type", path, f"{name} = {raw!r} is not a finite colour; {default} is used.")
            return default
        return (r, g, b)

    threshold = number("opacityThreshold", 0.0)
    opacity = number("opacity", 1.0, 0.0, 1.0)
    if threshold > 0:  # a cut-out, whatever opacityMode: at the threshold and above fully opaque, below nothing
        hidden, opacity = opacity < threshold, 1.0
        if hidden:
            return Material(Surface(path), hidden=True)
    for name, default in _IGNORED_INPUTS.items():
        _note_ignored(inputs.get(name), name, default, path, ctx)
    mode = _input_value(inputs.get("opacityMode"), "transparent", path, ctx)
    workflow = _input_value(inputs.get("useSpecularWorkflow"), 0, path, ctx)
    surface = Surface(
        path,
        diffuse_color=color("diffuseColor", (0.18, 0.18, 0.18)),
        emissive_color=color("emissiveColor", (0.0, 0.0, 0.0)),
        use_specular_workflow=bool(workflow),
        specular_color=color("specularColor", (0.0, 0.0, 0.0)),
        metallic=number("metallic", 0.0, 0.0, 1.0),
        roughness=number("roughness", 0.5, 0.0, 1.0),
        clearcoat=number("clearcoat", 0.0, 0.0, 1.0),
        clearcoat_roughness=number("clearcoatRoughness", 0.01, 0.0, 1.0),
        opacity=opacity,
        presence=mode == "presence",
        ior=number("ior", 1.5, 0.0),
    )
    return Material(surface)


def _input_value(shader_input: UsdShade.Input | None, default: Any, path: str, ctx: Context) -> Any:
    """The input's constant value; a texture's fallback or `default` where a node computes it."""
    if shader_input is None:
        return default
    sources = UsdShade.Utils.GetValueProducingAttributes(shader_input)
    if not sources:
        if shader_input.HasConnectedSource():
            ctx.warn("shader-ignored", path, f"{shader_input.GetBaseName()} is connected to something without a value.")
        return default
    attribute = sources[0]
    if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
        return _node_value(attribute, str(shader_input.GetBaseName()), default, path, ctx)
    raw = value(attribute, ctx.when)
    return default if raw is None else raw


def _node_value(output: Usd.Attribute, name: str, default: Any, path: str, ctx: Context) -> Any:
    node = UsdShade.Shader(output.GetPrim())
    identifier = node.GetShaderId() or "a shader without id"
    if identifier != "UsdUVTexture":
        ctx.warn("shader-ignored", path, f"{name} comes from {identifier}: {_shown(default)} is used.")
        return default
    fallback = _fallback(node, output, default, ctx)
    ctx.warn("texture-ignored", path, f"{name} comes from a texture: {_shown(fallback)} is used.")
    return fallback


def _fallback(texture: UsdShade.Shader, output: Usd.Attribute, default: Any, ctx: Context) -> Any:
    """The channel of the texture's authored fallback that the output gives."""
    fallback = texture.GetInput("fallback")
    raw = value(fallback.GetAttr(), ctx.when) if fallback else None
    if raw is None or len(raw) != 4:
        return default
    channel = str(output.GetName()).removeprefix("outputs:")
    rgba = tuple(float(x) for x in raw)
    if channel == "rgb":
        return rgba[:3] if isinstance(default, tuple) else rgba[0]
    scalar = rgba["rgba".index(channel)] if channel in ("r", "g", "b", "a") else rgba[0]
    return (scalar,) * 3 if isinstance(default, tuple) else scalar


def _note_ignored(shader_input: UsdShade.Input | None, name: str, default: Any, path: str, ctx: Context) -> None:
    if shader_input is None:
        return
    for attribute in UsdShade.Utils.GetValueProducingAttributes(shader_input):
        if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
            ctx.warn("texture-ignored", path, f"{name} comes from a texture or node and is ignored.")
            return
        raw = value(attribute, ctx.when)
        same = raw is None or (tuple(raw) == default if isinstance(default, tuple) else raw == default)
        if not same:
            ctx.warn("material-input", path, f"{name} = {_shown(raw)} is ignored.")


def _shown(raw: Any) -> str:
    try:
        return "(" + ", ".join(f"{float(x):g}" for x in raw) + ")"
    except TypeError:
        return f"{raw:g}" if isinstance(raw, int | float) else str(raw)
