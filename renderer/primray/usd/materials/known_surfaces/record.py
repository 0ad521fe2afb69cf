"""What a surface node says, whatever its model, in OpenPBR's words: every field a constant or an output of the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ....description import Operand
from ...materialx.expressions import Expressions

Inputs = Mapping[str, Operand]  # all that the node's definition has
ONE, ZERO, WHITE, BLACK = (1.0,), (0.0,), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
NORMAL, TANGENT = "Nworld", "Tworld"  # the shape's own


@dataclass(frozen=True)
class KnownSurface:
    """OpenPBR's inputs by their names and with their defaults (coat_roughening is ours, see OpenPbr), colours in the rendering
    space; what is of the whole surface after them."""

    base_weight: Operand = ONE
    base_color: Operand = (0.8, 0.8, 0.8)
    base_diffuse_roughness: Operand = ZERO
    base_metalness: Operand = ZERO
    specular_weight: Operand = ONE
    specular_color: Operand = WHITE
    specular_roughness: Operand = (0.3,)
    specular_roughness_anisotropy: Operand = ZERO
    specular_ior: Operand = (1.5,)
    transmission_weight: Operand = ZERO
    transmission_color: Operand = WHITE
    transmission_depth: Operand = ZERO  # scene units, as subsurface_radius is
    transmission_scatter: Operand = BLACK
    transmission_scatter_anisotropy: Operand = ZERO
    transmission_dispersion_scale: Operand = ZERO
    transmission_dispersion_abbe_number: Operand = (20.0,)
    subsurface_weight: Operand = ZERO
    subsurface_color: Operand = (0.8, 0.8, 0.8)
    subsurface_radius: Operand = ONE
    subsurface_radius_scale: Operand = (1.0, 0.5, 0.25)
    subsurface_scatter_anisotropy: Operand = ZERO
    fuzz_weight: Operand = ZERO
    fuzz_color: Operand = WHITE
    fuzz_roughness: Operand = (0.5,)
    coat_weight: Operand = ZERO
    coat_color: Operand = WHITE
    coat_roughness: Operand = ZERO
    coat_roughness_anisotropy: Operand = ZERO
    coat_ior: Operand = (1.6,)
    coat_darkening: Operand = ONE
    coat_roughening: Operand = ONE
    thin_film_weight: Operand = ZERO
    thin_film_thickness: Operand = (0.5,)  # micrometres
    thin_film_ior: Operand = (1.4,)

    emission: Operand = BLACK  # nits, as seen
    opacity: Operand = ONE  # of the whole surface: where it is there at all
    cutoff: float = 0.0  # above 0: opacity below it is a hole, else a whole surface
    thin_walled: Operand = ZERO
    normal: Operand = NORMAL  # normals and tangents in world space
    tangent: Operand = TANGENT
    coat_normal: Operand | None = None  # None: as the base's
    coat_tangent: Operand | None = None
    unlit: bool = False  # nothing but emission

    unused: tuple[str, ...] = ()  # inputs with an effect in their model that have no field here, and are not at rest
    near: tuple[str, ...] = ()  # inputs that mean something else here than in their model, though nearly the same
    called: Mapping[str, str] = field(default_factory=dict)  # the model's own names of fields, where they differ


@dataclass
class Reader:
    """Gives a model its inputs, and remembers those that it has no place for, or a place that is nearly theirs."""

    inputs: Inputs
    expressions: Expressions
    unused: list[str] = field(default_factory=list)
    near: list[str] = field(default_factory=list)

    def __getitem__(self, name: str) -> Operand:
        return self.inputs[name]

    def scaled(self, color: Operand, weight: Operand) -> Operand:
        """A colour times a weight."""
        return self.expressions.apply("ND_multiply_color3FA", in1=color, in2=weight)

    def times(self, a: Operand, b: Operand) -> Operand:
        """Of two numbers."""
        return self.expressions.apply("ND_multiply_float", in1=a, in2=b)

    def mixed(self, a: Operand, b: Operand, by: Operand) -> Operand:
        """From a to b: numbers."""
        return self.expressions.apply("ND_mix_float", bg=a, fg=b, mix=by)

    def mixed_colors(self, a: Operand, b: Operand, by: Operand) -> Operand:
        """From a to b."""
        return self.expressions.apply("ND_mix_color3", bg=a, fg=b, mix=by)

    def shining_through(self, emission: Operand, coat: Operand, passes: Operand) -> Operand:
        """Emission below a coat that lets so much of it through."""
        if coat == ZERO or passes == WHITE:
            return emission
        left = self.mixed_colors(WHITE, passes, coat)
        return self.expressions.apply("ND_multiply_color3", in1=emission, in2=left)

    def one_minus(self, value: Operand) -> Operand:
        return self.expressions.apply("ND_invert_float", **{"in": value, "amount": ONE})

    def mean(self, color: Operand) -> Operand:
        """Of a colour's channels."""
        third = (1.0 / 3.0,) * 3
        as_vector = self.expressions.apply("ND_convert_color3_vector3", **{"in": color})
        return self.expressions.apply("ND_dotproduct_vector3", in1=as_vector, in2=third)

    def turned(self, tangent: Operand, normal: Operand, degrees: Operand) -> Operand:
        """A tangent about the normal, as MaterialX's rotate3d turns."""
        if degrees == ZERO:
            return tangent
        return self.expressions.apply("ND_rotate3d_vector3", **{"in": tangent, "amount": degrees, "axis": normal})

    def rest(self, **at_rest: Operand) -> None:
        """Inputs without a place here, each with the value with which it has no effect."""
        self.unused += [name for name, value in at_rest.items() if self[name] != value]

    def nearly(self, **exact: Operand) -> None:
        """Inputs that mean nearly the same here, each with the value with which there is no difference."""
        self.near += [name for name, value in exact.items() if self[name] != value]
