"""Emission of Volume prims with VolumeLightAPI: what the material emits, times the light's color and intensity.

The schema's default for light:materialSyncMode is materialGlowTintsLight, "to allow the emission/glow of the bound material to
affect the color of the light" (UsdLux). The other modes relate a light to a surface, which a volume has not.
"""

from __future__ import annotations

from dataclasses import replace

from ...description import Light, VolumeEmission
from ..lights.authored import AuthoredLight
from ..lights.geometry_light import GLOW_TINTS_LIGHT
from ..lights.light import geometry_light
from ..lights.light_settings import read_light_settings
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import token

MODE = "light:materialSyncMode"
_LINKS = ("collection:lightLink:", "collection:shadowLink:")


def as_light(emissions: list[VolumeEmission], leaf: ResolvedPrim, ctx: Context) -> list[VolumeEmission]:
    """Return the emissions of a Volume as its light, if it is one, says."""
    if leaf.path not in ctx.findings.light_shapes:
        return emissions
    light = read_light_settings(leaf, ctx, None).applied(geometry_light(AuthoredLight(leaf, ctx)))
    mode = token(leaf.prim, MODE, ctx.when, GLOW_TINTS_LIGHT)
    if mode != GLOW_TINTS_LIGHT and leaf.prim.GetAttribute(MODE).HasAuthoredValue():
        message = f"{MODE} = {mode!r} is ignored: a volume has no surface, and {GLOW_TINTS_LIGHT} is used."
        ctx.warn("light-input", leaf.path, message, MODE)
    if ignored := _ignored(light, leaf):
        ctx.warn("light-input", leaf.path, f"The emission of a volume ignores {', '.join(ignored)}.", ignored[0])
    if not emissions:
        message = "VolumeLightAPI multiplies the light by its material's emission, which is 0: it emits nothing."
        ctx.warn("light-dark", leaf.path, message)
    r, g, b = light.emission
    return [
        replace(emission, emission=(emission.emission[0] * r, emission.emission[1] * g, emission.emission[2] * b))
        for emission in emissions
    ]


def _ignored(light: Light, leaf: ResolvedPrim) -> list[str]:
    """Return properties of the light that have no effect on a volume's emission."""
    found = [name for name in sorted(leaf.names) if name.startswith(_LINKS)]
    found += ["inputs:normalize"] if light.normalize else []
    found += ["inputs:diffuse"] if light.diffuse != 1.0 else []
    found += ["inputs:specular"] if light.specular != 1.0 else []
    found += ["ShapingAPI"] if light.shaping is not None else []
    found += ["ShadowAPI"] if light.shadow is not None else []
    found += ["the light group"] if light.group else []
    found += [] if light.visible_to_camera else ["its visibility to the camera"]
    return found
