"""Conversion of a KnownSurface to a Surface with OpenPBR's lobes; inputs without effect, or approximated, are listed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace

from ....description import Input, NodeOutput, OpenPbr, Operand, PatternInput, Surface, TextureInput
from ....description.shading import OPEN_PBR_PREFIX
from ...materialx.expressions import Expressions
from ..pruning import pruned
from ..reducing import Reducer
from .record import BLACK, NORMAL, ONE, TANGENT, ZERO, KnownSurface

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
class Told:
    """Inputs that have no effect (`unused`) or are approximated (`near`), by the names that their model gives them."""

    unused: tuple[str, ...]
    near: tuple[str, ...]

    def sentences(self) -> str:
        """Return the sentences for a diagnostic; "" where there is nothing to report."""
        parts = (("Approximated", self.near), ("Not supported, or only in part", self.unused))
        return " ".join(f"{what}: {', '.join(names)}." for what, names in parts if names)


def told(unused: Iterable[str], near: Iterable[str]) -> Told:
    """Return the inputs to report, sorted; one that is both unused and approximated counts as unused."""
    without = sorted(set(unused))
    return Told(tuple(without), tuple(sorted(set(near).difference(without))))


@dataclass
class _Made:
    constants: dict[str, float | tuple[float, ...]] = field(default_factory=dict)
    varying: dict[str, Input] = field(default_factory=dict)


def as_open_pbr(known: KnownSurface, expressions: Expressions, path: str) -> tuple[Surface, Told]:
    """Return the Surface of a known surface, and which of its inputs are ignored or approximated."""
    known = _without_hidden(known)
    unused, near = _not_had(known)
    made = _Made()
    reducer = Reducer(expressions.nodes)
    lobes = {} if known.unlit else _lobes(known)
    _take(made, "emissive_color", known.emission, 3, reducer)
    _take(made, "opacity", ONE if known.cutoff and isinstance(known.opacity, tuple) else known.opacity, 1, reducer)
    for name, value in lobes.items():
        _take(made, OPEN_PBR_PREFIX + name, value, _WIDTHS[name], reducer)
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
    return surface.with_constants(made.constants), told((*known.unused, *unused), (*known.near, *near))  # type: ignore[arg-type]


def is_hole(known: KnownSurface) -> bool:
    """Return whether the opacity cutoff removes the whole surface."""
    return known.cutoff > 0 and isinstance(known.opacity, tuple) and known.opacity[0] < known.cutoff


def _without_hidden(known: KnownSurface) -> KnownSurface:
    """Return the surface without lobes that cannot be seen: under a metal, or where all light is transmitted."""
    if known.base_metalness == ONE:
        return replace(known, transmission_weight=ZERO, subsurface_weight=ZERO)
    return replace(known, subsurface_weight=ZERO) if known.transmission_weight == ONE else known


def _lobes(known: KnownSurface) -> dict[str, Operand]:
    """Return the inputs of the lobes whose weight is not zero."""
    off = tuple(f"{lobe}_" for lobe in _LOBES if getattr(known, f"{lobe}_weight") == ZERO)
    return {name: getattr(known, name) for name in _WIDTHS if not name.startswith(off)}


_WIDTHS = {f.name: len(f.default) if isinstance(f.default, tuple) else 1 for f in fields(OpenPbr)}


def _take(made: _Made, name: str, value: Operand, width: int, reducer: Reducer) -> None:
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


def _not_had(known: KnownSurface) -> tuple[list[str], list[str]]:
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
        if known.coat_roughness_anisotropy != ZERO and known.coat_tangent not in (None, _tangent(known)):
            unused.append("coat_tangent")
    called = known.called
    return [called.get(name, name) for name in unused], [called.get(name, name) for name in near]


def _directions(made: _Made, known: KnownSurface, e: Expressions, unused: list[str]) -> None:
    """Store the normal where it is not the shape's own, and the tangent where a lobe is anisotropic."""
    normal = _normal(known, e, unused)
    if normal is not None:
        made.varying["normal"] = normal
    coat = known.coat_weight != ZERO and known.coat_roughness_anisotropy != ZERO
    if known.specular_roughness_anisotropy == ZERO and not coat:
        return
    tangent = _tangent(known)
    if tangent == TANGENT:
        tangent = e.apply("ND_tangent_vector3", space="world")
    if isinstance(tangent, NodeOutput):
        made.varying["tangent"] = PatternInput(tangent, (1.0, 0.0, 0.0))
    else:
        unused.append(known.called.get("tangent", "tangent"))


def _tangent(known: KnownSurface) -> Operand:
    """Return the base's tangent, or the coat's where only the coat is anisotropic."""
    coats = known.coat_tangent
    return known.tangent if coats is None or known.specular_roughness_anisotropy != ZERO else coats


def _normal(known: KnownSurface, e: Expressions, unused: list[str]) -> Input | None:
    value = known.normal
    if isinstance(value, NodeOutput):
        node = e.nodes[value.node]
        is_own = node.category == "normal" and dict(node.inputs).get("space") == "world"
        return None if is_own else Reducer(e.nodes).normal(value)
    if value != NORMAL:
        unused.append(known.called.get("normal", "normal"))
    return None
