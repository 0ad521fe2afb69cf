"""Coefficients of a volume, as operands of a pattern: what a volume shader says, in any renderer's convention."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ...description import Operand
from ..materials.materialx.expressions import Expressions

BLACK: Operand = (0.0, 0.0, 0.0)
ISOTROPIC: Operand = (0.0,)


class UnusableShaderError(Exception):
    """A volume shader that cannot be rendered, with the reason; the fallback is used instead."""


@dataclass(frozen=True)
class Lobe:
    """Scattering with one phase function."""

    scattering: Operand  # colour
    anisotropy: Operand  # g of Henyey and Greenstein


@dataclass(frozen=True, kw_only=True)
class Coefficients:
    """Coefficients per unit of length, of which one is `unit` scene units; nodes of `expressions` read fields by name."""

    expressions: Expressions = field(compare=False)
    convention: str  # a sentence for the report
    absorption: Operand = BLACK  # colour
    lobes: tuple[Lobe, ...] = ()
    emission: Operand = BLACK  # colour: radiance per unit of length
    droplets: float = 0.0  # diameter in micrometres of water droplets, which scatter in place of the lobes; 0: none
    per_scene_unit: float = 1.0  # factor from coefficients to those per scene unit


@dataclass(frozen=True)
class Vdf:
    """A volume distribution function: absorption and scattering."""

    absorption: Operand = BLACK
    lobes: tuple[Lobe, ...] = ()


class Arithmetic:
    """Arithmetic of operands that are colours."""

    def __init__(self, expressions: Expressions) -> None:
        self.e = expressions

    def color(self, value: Operand) -> Operand:
        """Return a colour of a number, a vector or a colour."""
        width = self.e.width(value)
        if width == 3:
            return value
        if width != 1:
            raise UnusableShaderError(f"a coefficient has {width} numbers")
        return value * 3 if isinstance(value, tuple) else self.e.apply("ND_convert_float_color3", **{"in": value})

    def product(self, a: Operand, b: Operand) -> Operand:
        if any(isinstance(value, tuple) and not any(value) for value in (a, b)):
            return BLACK  # whatever fields the other reads
        return self.e.apply("ND_multiply_color3", in1=self.color(a), in2=self.color(b))

    def sum(self, a: Operand, b: Operand) -> Operand:
        return self.e.apply("ND_add_color3", in1=self.color(a), in2=self.color(b))

    def complement(self, a: Operand) -> Operand:
        """Return 1 - a."""
        return self.e.apply("ND_subtract_color3", in1=(1.0, 1.0, 1.0), in2=self.color(a))

    def field(self, name: str, kind: str = "float", default: tuple[float, ...] = (0.0,)) -> Operand:
        """Return the values of a field."""
        return self.e.primitive("geompropvalue", kind, f"ND_geompropvalue_{kind}", {"geomprop": name, "default": default})

    def scaled(self, vdf: Vdf, by: Operand) -> Vdf:
        lobes = tuple(Lobe(self.product(lobe.scattering, by), lobe.anisotropy) for lobe in vdf.lobes)
        return Vdf(self.product(vdf.absorption, by), lobes)

    def added(self, a: Vdf, b: Vdf) -> Vdf:
        """Return the sum of two functions; lobes with the same phase function are one."""
        lobes = {lobe.anisotropy: lobe for lobe in a.lobes}
        for lobe in b.lobes:
            known = lobes.get(lobe.anisotropy)
            lobes[lobe.anisotropy] = (
                lobe if known is None else Lobe(self.sum(known.scattering, lobe.scattering), lobe.anisotropy)
            )
        return Vdf(self.sum(a.absorption, b.absorption), tuple(lobes.values()))


def with_droplets(made: Coefficients, diameter: float) -> Coefficients:
    """Return coefficients whose scattering is that of water droplets: one phase function instead of those of the lobes.

    `diameter`: micrometres; 0: nothing changes.
    """
    if diameter == 0:
        return made
    arithmetic = Arithmetic(made.expressions)
    merged = Vdf()
    for lobe in made.lobes:
        merged = arithmetic.added(merged, Vdf(lobes=(Lobe(lobe.scattering, ISOTROPIC),)))
    said = (
        f"{made.convention} It scatters as water droplets of {diameter:g} micrometres do, whatever anisotropy its shader has."
    )
    return replace(made, lobes=merged.lobes, droplets=diameter, convention=said)
