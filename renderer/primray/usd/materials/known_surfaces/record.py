"""What a surface node says, whatever its model, in OpenPBR's words: every field a constant or an output of the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ....description import Operand
from ...materialx.expressions import Expressions

Inputs = Mapping[str, Operand]  # all that the node's definition has
ONE, ZERO, WHITE, BLACK = (1.0,), (0.0,), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class KnownSurface:
    """Weights are multiplied in where there is no field for them. Colours in the rendering space, emission in nits."""

    base_color: Operand = (0.8, 0.8, 0.8)  # times its weight
    metalness: Operand = ZERO
    specular_weight: Operand = ONE
    specular_color: Operand = WHITE
    roughness: Operand = (0.3,)
    ior: Operand = (1.5,)
    transmission: Operand = ZERO
    transmission_color: Operand = WHITE
    subsurface: Operand = ZERO
    subsurface_color: Operand = (0.8, 0.8, 0.8)
    coat: Operand = ZERO
    coat_color: Operand = WHITE
    coat_roughness: Operand = ZERO
    coat_ior: Operand = (1.5,)
    emission: Operand = BLACK
    opacity: Operand = ONE  # of the whole surface: where it is there at all
    thin_walled: Operand = ZERO
    normal: Operand = "Nworld"  # in world space
    cutoff: float = 0.0  # above 0: opacity below it is a hole, else a whole surface
    unused: tuple[str, ...] = ()  # inputs with an effect in their model that have no field here, and are not at rest


@dataclass
class Reader:
    """Gives a model its inputs, and remembers those that it has no place for."""

    inputs: Inputs
    expressions: Expressions
    unused: list[str] = field(default_factory=list)

    def __getitem__(self, name: str) -> Operand:
        return self.inputs[name]

    def scaled(self, color: str, weight: str) -> Operand:
        """A colour times a weight."""
        return self.expressions.apply("ND_multiply_color3FA", in1=self[color], in2=self[weight])

    def mean(self, color: Operand) -> Operand:
        """Of a colour's channels."""
        third = (1.0 / 3.0,) * 3
        as_vector = self.expressions.apply("ND_convert_color3_vector3", **{"in": color})
        return self.expressions.apply("ND_dotproduct_vector3", in1=as_vector, in2=third)

    def rest(self, **at_rest: Operand) -> None:
        """Inputs without a place here, each with the value with which it has no effect."""
        self.unused += [name for name, value in at_rest.items() if self[name] != value]
