"""Volume shaders in closed shapes, which they fill with a medium of constant coefficients.

A material with a volume shader alone has no surface. One with both shows the volume behind an OpenPBR surface that transmits.
Shapes have no fields: channels that Arnold's shader reads count as 1.
"""

from __future__ import annotations

from dataclasses import replace

from ...description import HomogeneousVolume, Operand, volume_boundary
from ..materials.authored import AuthoredPrim
from ..materials.network import Network, Node
from ..materials.translated_material import Material
from ..scene.context import Context
from ..scene.droplets import DIAMETER, droplets_of
from .coefficients import Coefficients
from .shaders import first_coefficients, volume_shaders

Color = tuple[float, float, float]
MOST_ANISOTROPY = 0.98  # beyond, the phase function is a peak that nothing resolves


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
    try:
        found = _homogeneous(made)
    except _NotConstantError:
        message = "The volume varies over space, which only the fields of a Volume prim can: the shape is not filled."
        ctx.warn("shader-ignored", path, message, _first_output(network, material))
        return None
    droplets = droplets_of((material.prim,), ctx)
    if droplets > 0 and found.anisotropy != 0:
        message = f"The anisotropy of its volume shader has no effect: {DIAMETER} gives the phase function."
        ctx.warn("material-input", path, message, DIAMETER)
    return replace(found, droplets=droplets)


def _homogeneous(made: Coefficients) -> HomogeneousVolume:
    scale = made.per_scene_unit
    scattered = [_color(lobe.scattering, scale) for lobe in made.lobes]
    weights = [sum(color) for color in scattered]
    # One phase function has the mean cosine of all.
    mean = sum(w * _number(lobe.anisotropy) for w, lobe in zip(weights, made.lobes, strict=True)) / (sum(weights) or 1.0)
    scattering = _sum(scattered)
    return HomogeneousVolume(
        extinction=_sum([_color(made.absorption, scale), scattering]),
        scattering=scattering,
        emission=_color(made.emission, scale),
        anisotropy=min(max(mean, -MOST_ANISOTROPY), MOST_ANISOTROPY),
    )


def _number(value: Operand) -> float:
    if not isinstance(value, tuple):
        raise _NotConstantError
    return value[0]


def _color(value: Operand, scale: float) -> Color:
    if not isinstance(value, tuple):
        raise _NotConstantError
    r, g, b = value if len(value) == 3 else value[:1] * 3
    return max(r, 0.0) * scale, max(g, 0.0) * scale, max(b, 0.0) * scale


def _sum(colors: list[Color]) -> Color:
    return sum(c[0] for c in colors), sum(c[1] for c in colors), sum(c[2] for c in colors)


def _first_output(network: Network, material: AuthoredPrim) -> str:
    """Return the name of the first volume output that leads to a shader."""
    names = [name for name in material.names if name.endswith("volume")]
    return next((name for name in names if isinstance(network.source(material.attribute(name)), Node)), "")
