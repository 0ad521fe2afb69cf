"""A known surface as what can be rendered: UsdPreviewSurface's lobes. What they cannot say is named, not left out silently.

To be replaced by a surface that has OpenPBR's lobes; nothing else knows how a record becomes a Surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ....description import Input, NodeOutput, Operand, Surface, TextureInput
from ...materialx.expressions import Expressions
from ..pruning import pruned
from ..reducing import Reducer
from .record import ONE, WHITE, ZERO, KnownSurface

_ANY = (0.0, 1e30)
_UNIT = (0.0, 1.0)
# Fields of a Surface: how many numbers, and their range.
_FIELDS = {
    "diffuse_color": (3, _UNIT),
    "emissive_color": (3, _ANY),
    "metallic": (1, _UNIT),
    "roughness": (1, _UNIT),
    "clearcoat": (1, _UNIT),
    "clearcoat_roughness": (1, _UNIT),
    "opacity": (1, _UNIT),
    "ior": (1, _ANY),
}


@dataclass
class _Made:
    constants: dict[str, tuple[float, ...]] = field(default_factory=dict)
    varying: dict[str, Input] = field(default_factory=dict)


def as_preview(known: KnownSurface, expressions: Expressions, path: str) -> tuple[Surface, tuple[str, ...]]:
    """The Surface of a material, and the names of what has no effect on it."""
    unused = list(known.unused)
    values = _values(known, expressions, unused)
    made = _fields(values, expressions)
    normal = _normal(known.normal, expressions, unused)
    if normal is not None:
        made.varying["normal"] = normal
    pattern, inputs = pruned(expressions.nodes, made.varying)
    presence = known.opacity != ONE and known.transmission == ZERO
    surface = Surface(
        path,
        presence=presence and known.cutoff == 0.0,
        opacity_threshold=known.cutoff if "opacity" in inputs else 0.0,
        thin=known.thin_walled != ZERO,
        inputs=tuple(inputs.items()),
        pattern=pattern,
        **{name: value[0] if len(value) == 1 else value for name, value in made.constants.items()},  # type: ignore[arg-type]
    )
    return surface, tuple(dict.fromkeys(unused))


def is_hole(known: KnownSurface) -> bool:
    """Whether a cut-out leaves nothing of it."""
    return known.cutoff > 0 and isinstance(known.opacity, tuple) and known.opacity[0] < known.cutoff


def _values(known: KnownSurface, e: Expressions, unused: list[str]) -> dict[str, Operand]:
    base = known.base_color
    if known.subsurface != ZERO:
        unused.append("subsurface")
        base = e.apply("ND_mix_color3", fg=known.subsurface_color, bg=base, mix=known.subsurface)
    if known.specular_color != WHITE and known.specular_weight != ZERO:
        unused.append("specular_color")
    if known.coat != ZERO:
        unused += [name for name, at_rest in (("coat_color", WHITE), ("coat_ior", (1.5,))) if getattr(known, name) != at_rest]
    if known.transmission != ZERO and known.transmission_color != WHITE:
        unused.append("transmission_color")
    return {
        "diffuse_color": base,
        "emissive_color": known.emission,
        "metallic": known.metalness,
        "roughness": known.roughness,
        "clearcoat": known.coat,
        "clearcoat_roughness": known.coat_roughness,
        "opacity": _opacity(known, e, unused),
        "ior": _ior(known, unused),
    }


def _opacity(known: KnownSurface, e: Expressions, unused: list[str]) -> Operand:
    """What is there at all, or, of what light passes, the part that it does not pass."""
    if known.transmission == ZERO:
        return ONE if known.cutoff and isinstance(known.opacity, tuple) else known.opacity
    if known.opacity != ONE:
        unused.append("opacity")
    dielectric = e.apply("ND_invert_float", **{"in": known.metalness, "amount": ONE})
    passes = e.apply("ND_multiply_float", in1=known.transmission, in2=dielectric)
    return e.apply("ND_invert_float", **{"in": passes, "amount": ONE})


def _ior(known: KnownSurface, unused: list[str]) -> Operand:
    """With the specular weight in it, which scales what is reflected head-on (OpenPBR 1.1, "Dielectric base")."""
    ior, weight = known.ior, known.specular_weight
    if weight == ONE:
        return ior
    if not isinstance(ior, tuple) or not isinstance(weight, tuple):
        unused.append("specular_weight")
        return ior
    if ior[0] <= 0:
        return ior
    f0 = ((ior[0] - 1.0) / (ior[0] + 1.0)) ** 2
    e = math.copysign(math.sqrt(min(max(weight[0], 0.0) * f0, 0.98)), ior[0] - 1.0)
    return ((1.0 + e) / (1.0 - e),)


def _fields(values: dict[str, Operand], e: Expressions) -> _Made:
    made = _Made()
    reducer = Reducer(e.nodes)
    for name, value in values.items():
        width, (low, high) = _FIELDS[name]
        if isinstance(value, NodeOutput):
            found = reducer.input(value, width)
            made.varying[name] = found
            value = _constant_of(found)
        assert isinstance(value, tuple)
        inside = tuple(min(max(x, low), high) for x in value)
        made.constants[name] = inside * width if len(inside) == 1 else inside
    return made


def _constant_of(found: Input) -> tuple[float, ...]:
    if not isinstance(found, TextureInput):
        return found.fallback
    return found.fallback[:3] if found.channels == "rgb" else (found.fallback["rgba".index(found.channels)],)


def _normal(value: Operand, e: Expressions, unused: list[str]) -> Input | None:
    if isinstance(value, NodeOutput):
        node = e.nodes[value.node]
        is_own = node.category == "normal" and dict(node.inputs).get("space") == "world"
        return None if is_own else Reducer(e.nodes).normal(value)
    if value != "Nworld":
        unused.append("normal")
    return None
