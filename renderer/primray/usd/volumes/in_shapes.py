"""Volume shaders in closed shapes, which they fill with a medium of constant coefficients.

A material with a volume shader alone has no surface. One with both shows the volume behind an OpenPBR surface that transmits.
Shapes have no fields: channels that Arnold's shader reads count as 1.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...description import HomogeneousVolume, Operand, volume_boundary
from ..materials.authored import AuthoredPrim
from ..materials.network import Network, Node
from ..materials.translated_material import Material
from ..scene.context import Context
from ..scene.droplets import DIAMETER, droplets_of
from .coefficients import Coefficients
from .shaders import first_coefficients, volume_shaders

Color = tuple[float, float, float]
MOST_ANISOTROPY = float(np.float32(0.98))  # beyond, the phase function is a peak that nothing resolves


class _NotConstantError(Exception):
    pass


def is_volume_alone(network: Network, material: AuthoredPrim) -> bool:
    """Return whether a material has a volume shader, and no surface output that leads to a shader."""
    names = [name for name in material.names if name.startswith("outputs:") and name.endswith("surface")]
    has_surface = any(isinstance(network.source(material.attribute(name)), Node) for name in names)
    return not has_surface and bool(volume_shaders(network, material))


def volume_alone(network: Network, material: AuthoredPrim, path: str, ctx: Context) -> Material:
    """Return a material without a surface, whose shapes are filled by its volume."""
    made = _constant_volume(network, material, path, ctx)
    return Material(None) if made is None else Material(volume_boundary(made, path))


def with_volume(made: Material, network: Network, material: AuthoredPrim, path: str, ctx: Context) -> Material:
    """Return a material with a surface whose interior is its volume's; reported where the surface shows no interior."""
    surface = made.surface
    if surface is None or not volume_shaders(network, material):
        return made
    if surface.open_pbr is None or surface.thin or not surface.transmits:
        what = "is opaque" if not surface.transmits else "is thin-walled" if surface.thin else "is no OpenPBR surface"
        message = (
            f"The material's surface {what}, so its volume is not seen: remove the surface output to see the volume alone."
        )
        ctx.warn("shader-ignored", path, message, _first_output(network, material))
        return made
    volume = _constant_volume(network, material, path, ctx)
    return made if volume is None else replace(made, surface=replace(surface, volume=volume))


def _constant_volume(network: Network, material: AuthoredPrim, path: str, ctx: Context) -> HomogeneousVolume | None:
    """Return the volume of the material's first supported shader; None, reported, where it has none or is not constant."""
    made = first_coefficients(network, material, None, ctx)
    if made is None:
        return None
    droplets = droplets_of((material.prim,), ctx)
    try:
        found = _homogeneous(made, droplets > 0, path, ctx)
    except _NotConstantError:
        message = "The volume varies over space, which only the fields of a Volume prim can: the shape is not filled."
        ctx.warn("shader-ignored", path, message, _first_output(network, material))
        return None
    ctx.warn("volume-convention", path, made.convention)
    if droplets > 0 and found.anisotropy != 0:
        message = f"The anisotropy of its volume shader has no effect: {DIAMETER} gives the phase function."
        ctx.warn("material-input", path, message, DIAMETER)
    return replace(found, droplets=droplets)


def _homogeneous(made: Coefficients, has_droplets: bool, path: str, ctx: Context) -> HomogeneousVolume:
    scale = made.per_scene_unit
    absorbed, emitted = _color(made.absorption), _color(made.emission)
    scattered = [_color(lobe.scattering) for lobe in made.lobes]
    for name, color in (("absorption", absorbed), ("emission", emitted), *(("scattering", color) for color in scattered)):
        if min(color) < 0:
            ctx.warn("out-of-range", path, f"The volume's {name} is below 0: 0 is used.")
    scattered = [_scaled(color, scale) for color in scattered]
    scattering = _sum(scattered)
    anisotropy = _mean_anisotropy(made, [sum(color) for color in scattered])
    if not has_droplets:  # which have a phase function of their own
        anisotropy = _usable_anisotropy(anisotropy, made, path, ctx)
    return HomogeneousVolume(
        extinction=_sum([_scaled(absorbed, scale), scattering]),
        scattering=scattering,
        emission=_scaled(emitted, scale),
        anisotropy=anisotropy,
    )


def _mean_anisotropy(made: Coefficients, weights: list[float]) -> float:
    """Return the mean cosine of the phase functions, weighted by what they scatter: one stands for all."""
    values = [_number(lobe.anisotropy) for lobe in made.lobes]
    return sum(w * g for w, g in zip(weights, values, strict=True)) / (sum(weights) or 1.0)


def _usable_anisotropy(mean: float, made: Coefficients, path: str, ctx: Context) -> float:
    """Return the anisotropy within its range; what is approximated is reported."""
    values = {_number(lobe.anisotropy) for lobe in made.lobes if any(_color(lobe.scattering))}
    if len(values) > 1:
        message = f"The volume scatters by {len(values)} phase functions: one with their mean anisotropy, {mean:.3g}, is used."
        ctx.warn("material-input", path, message)
    inside = min(max(mean, -MOST_ANISOTROPY), MOST_ANISOTROPY)
    if inside != mean:
        most = f"{MOST_ANISOTROPY:g}"
        ctx.warn("out-of-range", path, f"An anisotropy of {mean:g} is outside of [-{most}, {most}] and is clamped.")
    return inside


def _number(value: Operand) -> float:
    if not isinstance(value, tuple):
        raise _NotConstantError
    return value[0]


def _color(value: Operand) -> Color:
    if not isinstance(value, tuple):
        raise _NotConstantError
    r, g, b = value if len(value) == 3 else value[:1] * 3
    return r, g, b


def _scaled(color: Color, scale: float) -> Color:
    r, g, b = (max(c, 0.0) * scale for c in color)
    return r, g, b


def _sum(colors: list[Color]) -> Color:
    return sum(c[0] for c in colors), sum(c[1] for c in colors), sum(c[2] for c in colors)


def _first_output(network: Network, material: AuthoredPrim) -> str:
    """Return the name of the first volume output that leads to a shader."""
    names = [name for name in material.names if name.endswith("volume")]
    return next((name for name in names if isinstance(network.source(material.attribute(name)), Node)), "")
