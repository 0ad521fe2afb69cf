"""Autodesk's standard_surface, by the graph that MaterialX gives it."""

from __future__ import annotations

from ....description import Operand
from .record import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from .reflectivity import metal_edge, under_coat, weighed
from .roughness import by_aspect

SHADERS = ("ND_standard_surface_surfaceshader", "ND_standard_surface_surfaceshader_100")
_CALLED = {
    "transmission_weight": "transmission",
    "subsurface_weight": "subsurface",
    "coat_tangent": "coat_rotation",
}


def read(r: Reader) -> KnownSurface:
    metal, coat, transmission = r["metalness"], r["coat"], r["transmission"]
    _tell(r)
    tint = r.scaled(r["specular_color"], r["specular"])
    base = r.scaled(r["base_color"], r["base"])
    weight, factor = weighed(r, r["specular"], metal, transmission)
    roughness, anisotropy = by_aspect(r, _roughened(r), r["specular_anisotropy"])
    coat_roughness, coat_anisotropy = by_aspect(r, r["coat_roughness"], r["coat_anisotropy"])
    scale, abbe = _dispersion(r)
    thin = r["thin_walled"] != ZERO
    return KnownSurface(
        base_weight=r["base"],
        base_color=_under_coat(r, r["base_color"], metal),
        base_diffuse_roughness=r["diffuse_roughness"],
        base_metalness=metal,
        specular_weight=weight,
        specular_color=r.mixed_colors(r.scaled(r["specular_color"], factor), metal_edge(r, base, tint), metal),
        specular_roughness=roughness,
        specular_roughness_anisotropy=anisotropy,
        specular_ior=under_coat(r, r["specular_IOR"], coat, r["coat_IOR"]) if transmission == ZERO else r["specular_IOR"],
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
        subsurface_scatter_anisotropy=ONE if thin else r["subsurface_anisotropy"],  # a leaf's light all goes through
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
    """Of a sheen's: MaterialX's own translation has this power, found by eye."""
    return r.expressions.apply("ND_power_float", in1=roughness, in2=(0.4,))


def _tell(r: Reader) -> None:
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
            r.near.append("coat")  # what is below it refracts and reflects as if it met the coat
        if r["emission_color"] != BLACK:
            r.nearly(emission=ZERO)


def _roughened(r: Reader) -> Operand:
    """Nearer to 1 as the coat is rough."""
    return r.mixed(r["specular_roughness"], ONE, r.times(r.times(r["coat_affect_roughness"], r["coat"]), r["coat_roughness"]))


def _under_coat(r: Reader, color: Operand, metal: Operand) -> Operand:
    """More saturated as the coat says; a metal's colour is not."""
    affected = r["coat_affect_color"]
    if affected == ZERO or r["coat"] == ZERO or metal == ONE:
        return color
    e = r.expressions
    coat = e.apply("ND_clamp_float", **{"in": r["coat"], "low": ZERO, "high": ONE})
    power = e.apply("ND_add_float", in1=r.times(coat, affected), in2=ONE)
    return e.apply("ND_power_color3FA", in1=e.apply("ND_max_color3FA", in1=color, in2=ZERO), in2=power)


def _dispersion(r: Reader) -> tuple[Operand, Operand]:
    """An Abbe number as it is where it is above 1; 0 is none."""
    abbe = r["transmission_dispersion"]
    if abbe == ZERO:
        return ZERO, (20.0,)
    e = r.expressions
    return e.apply("ND_clamp_float", **{"in": abbe, "low": ZERO, "high": ONE}), e.apply("ND_max_float", in1=abbe, in2=ONE)


def _tangent(r: Reader, anisotropy: Operand, of: str) -> Operand:
    """Turned as an anisotropy's rotation says, from 0 to 1 once round."""
    if anisotropy == ZERO:
        return r["tangent"]
    normal = r["normal" if of == "specular" else "coat_normal"]
    return r.turned(r["tangent"], normal, r.times(r[f"{of}_rotation"], (360.0,)))
