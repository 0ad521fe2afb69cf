# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps as UsdLux lights: units, spread, the spot's edge.

An intensity of W / pi of a normalized light is a lamp of W watts (measured against Cycles, tests/contrib/blender).
Spread and the edge of spots have no words in UsdLux: they are photometric profiles, in files beside the stage.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from .placement import light_rows

Note = Callable[[str, str, str], None]
PROFILE_ANGLES = 512


def write_light(
    stage: Usd.Stage, path: str, obj: Any, matrix: Any, folder: Path, note: Note
) -> tuple[bool, tuple[float, float]]:
    """Write the lamp of an evaluated object. Returns whether its scale counts, and a scale to be applied first."""
    lamp = obj.data
    write = {"POINT": _point, "SPOT": _spot, "SUN": _sun, "AREA": _area}[lamp.type]
    light, keeps_scale, extra = write(stage, path, lamp, folder)
    UsdGeom.Xformable(light).AddTransformOp().Set(placed(matrix, keeps_scale, extra))
    factor, color = _emission(obj, note)
    light.CreateColorAttr(Gf.Vec3f(*color))
    intensity = lamp.energy * factor
    light.CreateIntensityAttr(intensity if lamp.type == "SUN" else intensity / math.pi)
    light.CreateExposureAttr(getattr(lamp, "exposure", 0.0))
    light.CreateNormalizeAttr(getattr(lamp, "normalize", True))
    light.GetPrim().CreateAttribute("inputs:visibility:camera", Sdf.ValueTypeNames.Bool).Set(obj.visible_camera)
    if not lamp.use_shadow:
        UsdLux.ShadowAPI.Apply(light.GetPrim()).CreateShadowEnableAttr(False)
    if obj.lightgroup:
        light_group(light.GetPrim(), obj.lightgroup)
    _note_differences(obj, note)
    return keeps_scale, extra


def light_group(prim: Usd.Prim, name: str) -> None:
    """Put a light into a group. Quotes are not for names in light path expressions (see passes.py, which does the same)."""
    prim.CreateAttribute("karma:light:lpetag", Sdf.ValueTypeNames.String).Set(name.replace("'", "_"))


def placed(matrix: Any, keeps_scale: bool, extra: tuple[float, float] = (1.0, 1.0)) -> Gf.Matrix4d:
    """Return a world matrix for row vectors; without its scale where Blender's object has none, and scaled by `extra` first."""
    return Gf.Matrix4d(light_rows(matrix, keeps_scale, extra))


def _point(stage: Usd.Stage, path: str, lamp: Any, folder: Path) -> tuple[Any, bool, tuple[float, float]]:
    light = UsdLux.SphereLight.Define(stage, path)
    light.CreateRadiusAttr(lamp.shadow_soft_size)
    if lamp.shadow_soft_size == 0:
        light.CreateTreatAsPointAttr(True)
    return light, False, (1.0, 1.0)


def _sun(stage: Usd.Stage, path: str, lamp: Any, folder: Path) -> tuple[Any, bool, tuple[float, float]]:
    light = UsdLux.DistantLight.Define(stage, path)
    light.CreateAngleAttr(math.degrees(lamp.angle))
    return light, False, (1.0, 1.0)


def _spot(stage: Usd.Stage, path: str, lamp: Any, folder: Path) -> tuple[Any, bool, tuple[float, float]]:
    light, _, extra = _point(stage, path, lamp, folder)
    half = lamp.spot_size / 2
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    shaping.CreateShapingConeAngleAttr(math.degrees(half))
    shaping.CreateShapingConeSoftnessAttr(0.0)
    if lamp.spot_blend > 0:
        _shape(light, half, lambda angle: spot_edge(angle, half, lamp.spot_blend), path, folder)
    return light, False, extra


def spot_edge(angle: float, half: float, blend: float) -> float:
    """Factor of a spot's light at an angle to its axis (Cycles, spot_light_attenuation: smoothstep of the cosine)."""
    t = min(max((math.cos(angle) - math.cos(half)) / max((1 - math.cos(half)) * blend, 1e-3), 0.0), 1.0)
    return t * t * (3 - 2 * t)


def _area(stage: Usd.Stage, path: str, lamp: Any, folder: Path) -> tuple[Any, bool, tuple[float, float]]:
    extra = (1.0, 1.0)
    if lamp.shape in ("SQUARE", "RECTANGLE"):
        light = UsdLux.RectLight.Define(stage, path)
        light.CreateWidthAttr(lamp.size)
        light.CreateHeightAttr(lamp.size if lamp.shape == "SQUARE" else lamp.size_y)
    else:
        light = UsdLux.DiskLight.Define(stage, path)
        light.CreateRadiusAttr(lamp.size / 2)
        if lamp.shape == "ELLIPSE":
            extra = (1.0, lamp.size_y / lamp.size)
    if lamp.spread < math.pi * 0.999:
        half = max(lamp.spread / 2, math.radians(0.5))
        shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
        shaping.CreateShapingConeAngleAttr(math.degrees(half))
        shaping.CreateShapingConeSoftnessAttr(0.0)
        _shape(light, half, lambda angle: spread_factor(angle, half), path, folder)
    return light, True, extra


def spread_factor(angle: float, half: float) -> float:
    """Factor of an area lamp's light at an angle to its normal (Cycles, area_light_spread_attenuation)."""
    return max(math.tan(half) - math.tan(angle), 0.0) / (math.tan(half) - half)


def _shape(light: Any, half: float, factor: Callable[[float], float], path: str, folder: Path) -> None:
    """Write a photometric profile whose candelas are the factors, and shape the light by it."""
    angles = [half * k / PROFILE_ANGLES for k in range(PROFILE_ANGLES)] + [half, math.pi]
    values = [factor(angle) for angle in angles[:-2]] + [0.0, 0.0]
    lines = ["IESNA:LM-63-2002", "TILT=NONE", f"1 -1 1 {len(angles)} 1 1 2 0 0 0", "1 1 0"]
    lines += [" ".join(f"{math.degrees(angle):.9g}" for angle in angles), "0", " ".join(f"{value:.9g}" for value in values)]
    file = folder / f"{path.rpartition('/')[2]}.ies"
    file.write_text("\n".join(lines) + "\n")
    UsdLux.ShapingAPI(light.GetPrim()).CreateShapingIesFileAttr(f"./{file.name}")


def _emission(obj: Any, note: Note) -> tuple[float, tuple[float, float, float]]:
    """Return the factor and colour of a lamp, with constants of its Emission node folded in."""
    lamp, factor = obj.data, 1.0
    color = list(lamp.color)
    if getattr(lamp, "use_temperature", False):
        color = [a * b for a, b in zip(color, lamp.temperature_color, strict=True)]
    if lamp.node_tree is not None and lamp.use_nodes:
        emission = _emission_node(lamp.node_tree)
        if emission is None:
            note("light-nodes", obj.name, "the nodes of the lamp do not end in an Emission node: they are ignored")
        else:
            if emission.inputs["Color"].is_linked or emission.inputs["Strength"].is_linked:
                note("light-nodes", obj.name, "what is linked to the lamp's Emission node is ignored; its own values are used")
            factor = emission.inputs["Strength"].default_value
            color = [a * b for a, b in zip(color, emission.inputs["Color"].default_value[:3], strict=True)]
    return factor, (color[0], color[1], color[2])


def _emission_node(tree: Any) -> Any:
    for output in tree.nodes:
        if output.type == "OUTPUT_LIGHT" and output.is_active_output and output.inputs["Surface"].is_linked:
            found = output.inputs["Surface"].links[0].from_node
            return found if found.type == "EMISSION" else None
    return None


def _note_differences(obj: Any, note: Note) -> None:
    lamp = obj.data
    if lamp.type in ("POINT", "SPOT") and getattr(lamp, "use_soft_falloff", False) and lamp.shadow_soft_size > 0:
        note("light-falloff", obj.name, "Soft Falloff, which dims what is near the lamp, is not rendered")
    hidden = [name for name in ("diffuse", "glossy", "transmission", "volume_scatter") if not getattr(obj, f"visible_{name}")]
    if hidden:
        note("light-rays", obj.name, f"the lamp is hidden from {', '.join(hidden)} rays in Blender: it lights them here")
    linking = obj.light_linking
    if linking.receiver_collection or linking.blocker_collection:
        note("light-linking", obj.name, "light linking is not exported: the lamp lights everything")
