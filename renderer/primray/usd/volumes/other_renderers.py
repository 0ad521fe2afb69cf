"""Volume shaders of Arnold and RenderMan as coefficients, by their documentation.

Arnold's standard_volume (Arnold User Guide): extinction is density times the density channel times -ln(transparent) over
transparent_depth, per scene unit; the albedo is scatter times scatter_color. A black body has the colour of its temperature,
temperature times the temperature channel, or times blackbody_kelvin where the channel's values are at most 1 in all; its
radiance is that of Stefan and Boltzmann's law by the share that blackbody_intensity says.
RenderMan's PxrVolume: extinction is densityFloat times densityColor per scene unit, the albedo is diffuseColor.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ...description import Operand
from ..materials.network import Node
from ..materials.other_renderers import arnold, renderman
from ..materials.other_renderers.values import ANY, RendererInputs, RendererNodeValues, Vocabulary
from ..scene.context import Context
from .coefficients import BLACK, Arithmetic, Coefficients, Lobe, UnusableShaderError
from .fields import Field, field_named

_EMISSION_MODES = ("none", "channel", "density", "blackbody")
STEFAN_BOLTZMANN = 5.670374419e-8  # W m^-2 K^-4: CODATA 2018
_LEAST_TRANSPARENT = 1e-6
# Inputs of standard_volume that are not read, and the values at which they have no effect.
_NEUTRAL: dict[str, object] = {
    **dict.fromkeys(("displacement", "interpolation", "name"), ANY),
    **{f"scatter_diffusion_{name}": ANY for name in ("bias", "gain", "roughness", "roughness_bias", "roughness_gain")},
    "scatter_diffusion": (0.0,),
    "blackbody_contrast": (1.0,),
    "emission_scaling": "none",
}
ONE: Operand = (1.0,)


def other_coefficients(source: Node, fields: dict[str, Field] | None, ctx: Context) -> Coefficients | None:
    """Return what a volume shader of Arnold or RenderMan says; None for other shaders, and where translation is off.

    `fields`: None in shapes, which have none.
    """
    if not ctx.settings.translated_shaders:
        return None
    if arnold.kind_of(source) == "standard_volume":
        n = _inputs(source, _with_samples(arnold.VOCABULARY), ctx)
        made = _standard_volume(n, Arithmetic(n.e), fields)
    elif renderman.VOCABULARY.kind_of(source) == "PxrVolume" or source.id == "PxrVolume":
        n = _inputs(source, renderman.VOCABULARY, ctx)
        made = _pxr_volume(n, Arithmetic(n.e))
    else:
        return None
    left = sorted(n.left_out())
    if left or n.near:  # else its convention, which is reported, is all that there is to say
        message = f"{n.values.vocabulary.renderer}'s {n.kind or source.id} is translated by its documentation."
        for what, names in (("Approximated", sorted(n.near)), ("Not read", left)):
            message += f" {what}: {', '.join(names)}." if names else ""
        source.warn("translated", message)
    return made


def _inputs(source: Node, vocabulary: Vocabulary, ctx: Context) -> RendererInputs:
    return RendererNodeValues(ctx, vocabulary=vocabulary).inputs_read(source)


def _with_samples(vocabulary: Vocabulary) -> Vocabulary:
    """Return Arnold's nodes with those that read a channel of a volume."""
    own = {"volume_sample_float": _volume_sample_float, "volume_sample_rgb": _volume_sample_rgb}
    return replace(vocabulary, nodes={**vocabulary.nodes, **own}, neutral={**vocabulary.neutral, **_NEUTRAL})


def _volume_sample_float(n: RendererInputs) -> Operand:
    return Arithmetic(n.e).field(n.text("channel"))


def _volume_sample_rgb(n: RendererInputs) -> Operand:
    return Arithmetic(n.e).field(n.text("channel"), "color3", (0.0, 0.0, 0.0))


def _channel(a: Arithmetic, name: str, fields: dict[str, Field] | None, absent: Operand) -> Operand:
    """Return the values of a channel, `absent` where it is not named, and in shapes; 0 where no field has its name."""
    if not name or fields is None:
        return absent
    found = field_named(fields, name)
    return a.field(name, "color3", (0.0, 0.0, 0.0)) if found is not None and found.grid.width == 3 else a.field(name)


def _standard_volume(n: RendererInputs, a: Arithmetic, fields: dict[str, Field] | None) -> Coefficients:
    density = a.product(n.number("density", 1.0), _channel(a, n.text("density_channel", "density"), fields, ONE))
    depth = n.constants("transparent_depth", 1.0)[0]
    if depth <= 0:
        raise UnusableShaderError("its transparent_depth is not above 0")
    clear = n.constants("transparent", math.exp(-1), math.exp(-1), math.exp(-1))
    if n.text("transparent_channel"):
        n.lost.add("transparent_channel")
    rates = tuple(-math.log(min(max(x, _LEAST_TRANSPARENT), 1.0)) / depth for x in clear)
    extinction = a.product(density, rates)
    weight = a.product(n.number("scatter", 1.0), n.color("scatter_color", 0.5))
    albedo = a.product(weight, _channel(a, n.text("scatter_color_channel"), fields, ONE))
    lobes = _two_lobes(
        a,
        Lobe(a.product(extinction, albedo), n.number("scatter_anisotropy")),
        n.number("scatter_secondary_anisotropy"),
        n.number("scatter_secondary_anisotropy_mix"),
    )
    emission, note = _emission(n, a, density, fields)
    return Coefficients(
        expressions=n.e,
        convention=f"Arnold's standard_volume is used: extinction is per scene unit.{note}",
        absorption=a.product(extinction, a.complement(albedo)),
        lobes=lobes,
        emission=emission,
    )


def _emission(n: RendererInputs, a: Arithmetic, density: Operand, fields: dict[str, Field] | None) -> tuple[Operand, str]:
    """Return the emission, and a sentence where an authored one is none, for lack of temperatures."""
    mode = n.choice("emission_mode", _EMISSION_MODES, "blackbody")
    channel, heat = n.text("emission_channel", "heat"), n.text("temperature_channel", "temperature")
    scale, kelvin, intensity = (
        n.number("temperature", 1.0),
        n.number("blackbody_kelvin", 5000.0),
        n.number("blackbody_intensity", 1.0),
    )
    weight = a.product(n.number("emission", 1.0), n.color("emission_color", 1.0))
    if mode == "channel":
        return a.product(weight, _channel(a, channel, fields, ONE)), ""
    if mode == "density":
        return a.product(weight, density), ""
    if mode != "blackbody":
        return BLACK, ""
    found = None if fields is None else field_named(fields, heat)
    if found is None or found.grid.width != 1:
        is_asked = not {"emission_mode", "temperature_channel"}.isdisjoint(n.node.shader.inputs)
        return BLACK, f" It emits nothing, as no field is its temperature_channel, {heat}." if is_asked else ""
    n.near |= {"blackbody_intensity", "blackbody_kelvin"}
    e = n.e
    temperature = e.apply("ND_multiply_float", in1=a.field(heat), in2=scale)
    if found.largest <= 1.0:
        temperature = e.apply("ND_multiply_float", in1=temperature, in2=kelvin)
    power = e.apply("ND_multiply_float", in1=e.apply("ND_power_float", in1=temperature, in2=(4.0,)), in2=(STEFAN_BOLTZMANN,))
    radiance = e.apply("ND_mix_float", fg=power, bg=ONE, mix=intensity)
    shown = e.apply("ND_ifgreater_float", value1=temperature, value2=(0.0,), in1=radiance, in2=(0.0,))
    color = e.apply("ND_blackbody", temperature=temperature)
    return a.product(weight, a.product(shown, color)), ""


def _pxr_volume(n: RendererInputs, a: Arithmetic) -> Coefficients:
    name = n.text("densityFloatPrimVar")
    density = n.number("densityFloat", 1.0)
    if name:
        density = a.product(density, a.field(name))
    tint = n.text("densityColorPrimVar")
    extinction = a.product(density, n.color("densityColor", 1.0))
    if tint:
        extinction = a.product(extinction, a.field(tint, "color3", (0.0, 0.0, 0.0)))
    albedo = n.color("diffuseColor", 1.0)
    emission = n.color("emitColor", 0.0)
    first = Lobe(a.product(extinction, albedo), n.number("anisotropy"))
    lobes = _two_lobes(a, first, n.number("anisotropy2"), n.number("blendFactor", 0.0))
    return Coefficients(
        expressions=n.e,
        convention="RenderMan's PxrVolume is used: extinction is per scene unit.",
        absorption=a.product(extinction, a.complement(albedo)),
        lobes=lobes,
        emission=emission,
    )


def _two_lobes(a: Arithmetic, first: Lobe, anisotropy: Operand, mix: Operand) -> tuple[Lobe, ...]:
    """Return a lobe, or two where a share `mix` of its scattering has another anisotropy."""
    if mix == (0.0,):
        return (first,)
    return (
        Lobe(a.product(first.scattering, a.complement(mix)), first.anisotropy),
        Lobe(a.product(first.scattering, mix), anisotropy),
    )
