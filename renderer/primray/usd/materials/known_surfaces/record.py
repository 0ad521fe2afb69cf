"""KnownSurface: the inputs of any surface model under OpenPBR's names, each a constant or an output of the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ....description import Operand
from ...materialx.expressions import Expressions

Inputs = Mapping[str, Operand]  # all inputs of the node's definition
ONE, ZERO, WHITE, BLACK = (1.0,), (0.0,), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
NORMAL, TANGENT = "Nworld", "Tworld"  # the shape's own normal and tangent


@dataclass(frozen=True)
class KnownSurface:
    """Inputs of a surface under OpenPBR's names and with its defaults, colours in the rendering space.

    coat_roughening is primray's own (see OpenPbr). Properties of the whole surface follow.
    """

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
    transmission_depth: Operand = ZERO  # in scene units, like subsurface_radius
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

    emission: Operand = BLACK  # nits, leaving the surface
    opacity: Operand = ONE  # presence of the whole surface
    cutoff: float = 0.0  # if above 0: opacity below it is a hole, at or above it opaque
    thin_walled: Operand = ZERO
    normal: Operand = NORMAL  # normals and tangents in world space
    tangent: Operand = TANGENT
    coat_normal: Operand | None = None  # None: the base's
    coat_tangent: Operand | None = None
    unlit: bool = False  # emission only

    unused: tuple[str, ...] = ()  # ignored inputs that have an effect in their model
    near: tuple[str, ...] = ()  # inputs that are approximated
    called: Mapping[str, str] = field(default_factory=dict)  # the model's own names of fields, where they differ from OpenPBR's


@dataclass
class Reader:
    """Access to a node's inputs for a surface model, with lists of those that the model ignores or approximates."""

    inputs: Inputs
    expressions: Expressions
    unused: list[str] = field(default_factory=list)
    near: list[str] = field(default_factory=list)

    def __getitem__(self, name: str) -> Operand:
        return self.inputs[name]

    def scaled(self, color: Operand, weight: Operand) -> Operand:
        """Return a colour times a weight."""
        return self.expressions.apply("ND_multiply_color3FA", in1=color, in2=weight)

    def times(self, a: Operand, b: Operand) -> Operand:
        """Return the product of two numbers."""
        return self.expressions.apply("ND_multiply_float", in1=a, in2=b)

    def mixed(self, a: Operand, b: Operand, by: Operand) -> Operand:
        """Return a number interpolated from a to b."""
        return self.expressions.apply("ND_mix_float", bg=a, fg=b, mix=by)

    def mixed_colors(self, a: Operand, b: Operand, by: Operand) -> Operand:
        """Return a colour interpolated from a to b."""
        return self.expressions.apply("ND_mix_color3", bg=a, fg=b, mix=by)

    def shining_through(self, emission: Operand, coat: Operand, passes: Operand) -> Operand:
        """Return emission from below a coat that transmits the colour `passes`."""
        if coat == ZERO or passes == WHITE:
            return emission
        left = self.mixed_colors(WHITE, passes, coat)
        return self.expressions.apply("ND_multiply_color3", in1=emission, in2=left)

    def one_minus(self, value: Operand) -> Operand:
        """Return 1 - value."""
        return self.expressions.apply("ND_invert_float", **{"in": value, "amount": ONE})

    def mean(self, color: Operand) -> Operand:
        """Return the mean of a colour's channels."""
        third = (1.0 / 3.0,) * 3
        as_vector = self.expressions.apply("ND_convert_color3_vector3", **{"in": color})
        return self.expressions.apply("ND_dotproduct_vector3", in1=as_vector, in2=third)

    def turned(self, tangent: Operand, normal: Operand, degrees: Operand) -> Operand:
        """Return a tangent rotated about the normal as MaterialX's rotate3d rotates."""
        if degrees == ZERO:
            return tangent
        return self.expressions.apply("ND_rotate3d_vector3", **{"in": tangent, "amount": degrees, "axis": normal})

    def rest(self, **at_rest: Operand) -> None:
        """Record inputs that are ignored, each given with the value at which it has no effect."""
        self.unused += [name for name, value in at_rest.items() if self[name] != value]

    def nearly(self, **exact: Operand) -> None:
        """Record inputs that are approximated, each given with the value at which the approximation is exact."""
        self.near += [name for name, value in exact.items() if self[name] != value]
