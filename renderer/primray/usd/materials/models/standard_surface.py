"""Autodesk's standard_surface, read after its MaterialX node graph."""

from __future__ import annotations

from ....description import Operand
from .conversions import dielectric_weight, ior_under_coat, metal_edge_tint, roughness_by_aspect
from .open_pbr import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_standard_surface_surfaceshader", "ND_standard_surface_surfaceshader_100")
_CALLED = {
    "transmission_weight": "transmission",
    "subsurface_weight": "subsurface",
    "coat_tangent": "coat_rotation",
}


def read(r: Reader) -> KnownSurface:
    """Return the surface that the node's inputs describe."""
    metal, coat, transmission = r["metalness"], r["coat"], r["transmission"]
    _tell(r)
    tint = r.scaled(r["specular_color"], r["specular"])
    base = r.scaled(r["base_color"], r["base"])
    weight, factor = dielectric_weight(r, r["specular"], metal, transmission)
    roughness, anisotropy = roughness_by_aspect(r, _roughened(r), r["specular_anisotropy"])
    coat_roughness, coat_anisotropy = roughness_by_aspect(r, r["coat_roughness"], r["coat_anisotropy"])
    scale, abbe = _dispersion(r)
    thin = r["thin_walled"] != ZERO
    return KnownSurface(
        base_weight=r["base"],
        base_color=_under_coat(r, r["base_color"], metal),
        base_diffuse_roughness=r["diffuse_roughness"],
        base_metalness=metal,
        specular_weight=weight,
        specular_color=r.mixed_colors(r.scaled(r["specular_color"], factor), metal_edge_tint(r, base, tint), metal),
        specular_roughness=roughness,
        specular_roughness_anisotropy=anisotropy,
        specular_ior=ior_under_coat(r, r["specular_IOR"], coat, r["coat_IOR"]) if transmission == ZERO else r["specular_IOR"],
        transmission_weight=transmission,
        transmission_color=r["transmission_color"],
        transmission_depth=r["transmission_depth"],
        transmission_scatter=r["transmission_scatter"],
        transmission_scatter_anisotropy=r["transmission_scatter_anisotropy"],
        transmission_dispersion_scale=scale,
        transmission_dispersion_abbe_number=abbe,
        subsurface_weight=r["subsurface"],
        subsurface_color=_under_coat(r, r["subsurface_color"], ZERO),
        subsurface_radius=r["subsurface_scale"],
        subsurface_radius_scale=r["subsurface_radius"],
        subsurface_scatter_anisotropy=ONE if thin else r["subsurface_anisotropy"],  # thin walls scatter only forward
        fuzz_weight=r["sheen"],
        fuzz_color=r["sheen_color"],
        fuzz_roughness=fuzz_roughness(r, r["sheen_roughness"]),
        coat_weight=coat,
        coat_color=r["coat_color"],
        coat_roughness=coat_roughness,
        coat_roughness_anisotropy=coat_anisotropy,
        coat_ior=r["coat_IOR"],
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        thin_film_weight=ZERO if r["thin_film_thickness"] == ZERO else ONE,
        thin_film_thickness=r.times(r["thin_film_thickness"], (0.001,)),
        thin_film_ior=r["thin_film_IOR"],
        emission=r.shining_through(r.scaled(r["emission_color"], r["emission"]), coat, r["coat_color"]),
        opacity=r.mean(r["opacity"]),
        thin_walled=r["thin_walled"],
        normal=r["normal"],
        tangent=_tangent(r, anisotropy, "specular"),
        coat_normal=r["coat_normal"],
        coat_tangent=_tangent(r, coat_anisotropy, "coat"),
        unused=tuple(r.unused),
        near=tuple(r.near),
        called=_CALLED,
    )


def fuzz_roughness(r: Reader, roughness: Operand) -> Operand:
    """Return OpenPBR's fuzz roughness for a sheen roughness: MaterialX's own translation has this power, found by eye."""
    return r.expressions.apply("ND_power_float", in1=roughness, in2=(0.4,))


def _tell(r: Reader) -> None:
    """Record which inputs are ignored or approximated."""
    metal, coat, transmission = r["metalness"], r["coat"], r["transmission"]
    r.nearly(sheen=ZERO, metalness=ZERO)
    opacity = r["opacity"]
    if isinstance(opacity, tuple) and len(set(opacity)) > 1:
        r.near.append("opacity")
    if metal != ONE:
        r.nearly(diffuse_roughness=ZERO)
        if r["specular"] != ZERO or transmission != ZERO:
            r.nearly(specular=ONE)
    if transmission != ZERO and metal != ONE:
        r.rest(transmission_extra_roughness=ZERO)
    if coat != ZERO:
        r.nearly(coat_color=WHITE)
        if metal not in (ZERO, ONE):
            r.nearly(coat_affect_color=ZERO)
        if transmission != ZERO:
            r.near.append("coat")  # the base refracts and reflects as if it bordered on the coat
        if r["emission_color"] != BLACK:
            r.nearly(emission=ZERO)


def _roughened(r: Reader) -> Operand:
    """Return the specular roughness, mixed with 1 by the coat's roughness."""
    return r.mixed(r["specular_roughness"], ONE, r.times(r.times(r["coat_affect_roughness"], r["coat"]), r["coat_roughness"]))


def _under_coat(r: Reader, color: Operand, metal: Operand) -> Operand:
    """Return a colour more saturated under the coat (coat_affect_color); a metal's colour is unchanged."""
    affected = r["coat_affect_color"]
    if affected == ZERO or r["coat"] == ZERO or metal == ONE:
        return color
    e = r.expressions
    coat = e.apply("ND_clamp_float", **{"in": r["coat"], "low": ZERO, "high": ONE})
    power = e.apply("ND_add_float", in1=r.times(coat, affected), in2=ONE)
    return e.apply("ND_power_color3FA", in1=e.apply("ND_max_color3FA", in1=color, in2=ZERO), in2=power)


def _dispersion(r: Reader) -> tuple[Operand, Operand]:
    """Return OpenPBR's dispersion scale and Abbe number; an Abbe number of 0 means no dispersion."""
    abbe = r["transmission_dispersion"]
    if abbe == ZERO:
        return ZERO, (20.0,)
    e = r.expressions
    return e.apply("ND_clamp_float", **{"in": abbe, "low": ZERO, "high": ONE}), e.apply("ND_max_float", in1=abbe, in2=ONE)


def _tangent(r: Reader, anisotropy: Operand, of: str) -> Operand:
    """Return the tangent rotated by an anisotropy rotation, where 1 is a full turn."""
    if anisotropy == ZERO:
        return r["tangent"]
    normal = r["normal" if of == "specular" else "coat_normal"]
    return r.turned(r["tangent"], normal, r.times(r[f"{of}_rotation"], (360.0,)))
