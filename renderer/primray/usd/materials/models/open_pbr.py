"""KnownSurface: inputs of any surface model under OpenPBR's names, and their conversion to a Surface with OpenPBR's lobes.

Every input is a constant or an output of the pattern. The conversion lists inputs that have no effect or are approximated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace

from ....description import Input, NodeOutput, OpenPbr, Operand, PatternInput, Surface, TextureInput
from ....description.shading import OPEN_PBR_PREFIX
from ..materialx.expressions import Expressions
from ..surface_inputs import Reducer, pruned

Inputs = Mapping[str, Operand]  # all inputs of the node's definition
ONE, ZERO, WHITE, BLACK = (1.0,), (0.0,), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
NORMAL, TANGENT = "Nworld", "Tworld"  # the shape's own normal and tangent


@dataclass(frozen=True, kw_only=True)
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

    def rest(self, **neutral: Operand) -> None:
        """Record inputs that are ignored, each given with the value at which it has no effect."""
        self.unused += [name for name, value in neutral.items() if self[name] != value]

    def nearly(self, **exact: Operand) -> None:
        """Record inputs that are approximated, each given with the value at which the approximation is exact."""
        self.near += [name for name, value in exact.items() if self[name] != value]


_ANY = (0.0, 1e30)
_UNIT = (0.0, 1.0)
_RANGES = {
    "emissive_color": _ANY,
    "specular_weight": _ANY,
    "specular_ior": _ANY,
    "coat_ior": _ANY,
    "thin_film_ior": _ANY,
    "thin_film_thickness": _ANY,
    "transmission_dispersion_abbe_number": _ANY,
    "transmission_depth": _ANY,
    "transmission_scatter": _ANY,
    "subsurface_radius": _ANY,
    "subsurface_radius_scale": _ANY,
    "transmission_scatter_anisotropy": (-1.0, 1.0),
    "subsurface_scatter_anisotropy": (-1.0, 1.0),
}  # all other inputs: _UNIT
_LOBES = ("transmission", "subsurface", "fuzz", "coat", "thin_film")  # lobes with a weight; prefixes of their inputs' names


@dataclass(frozen=True)
class InputReport:
    """Inputs that have no effect (`unused`) or are approximated (`near`), by the names that their model gives them."""

    unused: tuple[str, ...]
    near: tuple[str, ...]

    def sentences(self) -> str:
        """Return the sentences for a diagnostic; "" where there is nothing to report."""
        parts = (("Approximated", self.near), ("Not supported, or only in part", self.unused))
        return " ".join(f"{what}: {', '.join(names)}." for what, names in parts if names)


def input_report(unused: Iterable[str], near: Iterable[str]) -> InputReport:
    """Return the inputs to report, sorted; one that is both unused and approximated counts as unused."""
    without = sorted(set(unused))
    return InputReport(tuple(without), tuple(sorted(set(near).difference(without))))


@dataclass
class _Fields:
    constants: dict[str, float | tuple[float, ...]] = field(default_factory=dict)
    varying: dict[str, Input] = field(default_factory=dict)


def as_open_pbr(known: KnownSurface, expressions: Expressions, path: str) -> tuple[Surface, InputReport]:
    """Return the Surface of a known surface, and which of its inputs are ignored or approximated."""
    known = _without_invisible_lobes(known)
    unused, near = _unsupported_fields(known)
    made = _Fields()
    reducer = Reducer(expressions.nodes)
    lobes = {} if known.unlit else _lobes(known)
    _store(made, "emissive_color", known.emission, 3, reducer)
    _store(made, "opacity", ONE if known.cutoff and isinstance(known.opacity, tuple) else known.opacity, 1, reducer)
    for name, value in lobes.items():
        _store(made, OPEN_PBR_PREFIX + name, value, _WIDTHS[name], reducer)
    if not known.unlit:
        _directions(made, known, expressions, unused)
    pattern, inputs = pruned(expressions.nodes, made.varying)
    surface = Surface(
        path,
        lambert=known.unlit,
        diffuse_color=BLACK if known.unlit else Surface.diffuse_color,
        presence=known.opacity != ONE and known.cutoff == 0.0,
        opacity_threshold=known.cutoff if "opacity" in inputs else 0.0,
        thin=known.opacity != ONE if known.unlit else known.thin_walled != ZERO,
        open_pbr=None if known.unlit else OpenPbr(),
        inputs=tuple(inputs.items()),
        pattern=pattern,
    )
    return surface.with_constants(made.constants), input_report((*known.unused, *unused), (*known.near, *near))  # type: ignore[arg-type]


def is_cut_out(known: KnownSurface) -> bool:
    """Return whether the opacity cutoff removes the whole surface."""
    return known.cutoff > 0 and isinstance(known.opacity, tuple) and known.opacity[0] < known.cutoff


def _without_invisible_lobes(known: KnownSurface) -> KnownSurface:
    """Return the surface without lobes that cannot be seen: under a metal, or where all light is transmitted."""
    if known.base_metalness == ONE:
        return replace(known, transmission_weight=ZERO, subsurface_weight=ZERO)
    return replace(known, subsurface_weight=ZERO) if known.transmission_weight == ONE else known


def _lobes(known: KnownSurface) -> dict[str, Operand]:
    """Return the inputs of the lobes whose weight is not zero."""
    off = tuple(f"{lobe}_" for lobe in _LOBES if getattr(known, f"{lobe}_weight") == ZERO)
    return {name: getattr(known, name) for name in _WIDTHS if not name.startswith(off)}


_WIDTHS = {f.name: len(f.default) if isinstance(f.default, tuple) else 1 for f in fields(OpenPbr)}


def _store(made: _Fields, name: str, value: Operand, width: int, reducer: Reducer) -> None:
    """Store an input: a constant clamped to its range, or a varying input with a constant in its place."""
    if isinstance(value, NodeOutput):
        found = reducer.input(value, width)
        made.varying[name] = found
        value = _constant_of(found)
    assert isinstance(value, tuple)
    low, high = _RANGES.get(name.removeprefix(OPEN_PBR_PREFIX), _UNIT)
    inside = tuple(min(max(x, low), high) for x in value)
    made.constants[name] = inside[0] if width == 1 else inside * width if len(inside) == 1 else inside


def _constant_of(found: Input) -> tuple[float, ...]:
    if not isinstance(found, TextureInput):
        return found.fallback
    return found.fallback[:3] if found.channels == "rgb" else (found.fallback["rgba".index(found.channels)],)


def _unsupported_fields(known: KnownSurface) -> tuple[list[str], list[str]]:
    """Return the fields without effect and those that are approximated, by the names that their model gives them."""
    unused, near = [], []
    if known.thin_walled != ZERO and known.transmission_weight != ZERO:
        unused += [
            n for n, rest in (("transmission_depth", ZERO), ("transmission_scatter", BLACK)) if getattr(known, n) != rest
        ]
    elif known.transmission_weight != ZERO and known.transmission_depth == ZERO and known.transmission_scatter != BLACK:
        unused.append("transmission_scatter")
    interior = ("transmission_color", "transmission_depth", "transmission_scatter", "transmission_scatter_anisotropy")
    if known.transmission_weight != ZERO and known.transmission_depth != ZERO and known.thin_walled == ZERO:
        near += [
            n for n in interior if isinstance(getattr(known, n), NodeOutput)
        ]  # an interior is homogeneous: the inputs' means
    if known.coat_weight != ZERO:
        if known.coat_normal not in (None, known.normal):
            unused.append("coat_normal")
        if known.coat_roughness_anisotropy != ZERO and known.coat_tangent not in (None, _tangent_of(known)):
            unused.append("coat_tangent")
    called = known.called
    return [called.get(name, name) for name in unused], [called.get(name, name) for name in near]


def _directions(made: _Fields, known: KnownSurface, e: Expressions, unused: list[str]) -> None:
    """Store the normal where it is not the shape's own, and the tangent where a lobe is anisotropic."""
    normal = _normal_input(known, e, unused)
    if normal is not None:
        made.varying["normal"] = normal
    coat = known.coat_weight != ZERO and known.coat_roughness_anisotropy != ZERO
    if known.specular_roughness_anisotropy == ZERO and not coat:
        return
    tangent = _tangent_of(known)
    if tangent == TANGENT:
        tangent = e.apply("ND_tangent_vector3", space="world")
    if isinstance(tangent, NodeOutput):
        made.varying["tangent"] = PatternInput(tangent, (1.0, 0.0, 0.0))
    else:
        unused.append(known.called.get("tangent", "tangent"))


def _tangent_of(known: KnownSurface) -> Operand:
    """Return the base's tangent, or the coat's where only the coat is anisotropic."""
    coats = known.coat_tangent
    return known.tangent if coats is None or known.specular_roughness_anisotropy != ZERO else coats


def _normal_input(known: KnownSurface, e: Expressions, unused: list[str]) -> Input | None:
    value = known.normal
    if isinstance(value, NodeOutput):
        node = e.nodes[value.node]
        is_own = node.category == "normal" and dict(node.inputs).get("space") == "world"
        return None if is_own else Reducer(e.nodes).normal(value)
    if value != NORMAL:
        unused.append(known.called.get("normal", "normal"))
    return None
