"""MaterialX's nodes for the inputs of a hair fibre: constants fold here; varying ones remain nodes that the core evaluates.

Formulas: d'Eon et al. 2011 (melanin), Chiang et al. 2016 (the rest), as the library's node documentation describes them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ...description import Operand
from .expressions import Expressions, Outputs

Given = Mapping[str, Operand]
_LEAST_COLOR, _LEAST_ROUGHNESS, _LEAST_LEFT = (1e-3,), (1e-3,), (1e-4,)


def _sum(e: Expressions, values: list[Operand]) -> Operand:
    total = values[0]
    for value in values[1:]:
        total = e.apply("ND_add_float", in1=total, in2=value)
    return total


def _times(e: Expressions, a: Operand, b: Operand) -> Operand:
    return e.apply("ND_multiply_float", in1=a, in2=b)


def _polynomial(e: Expressions, x: Operand, terms: Mapping[int, float]) -> Operand:
    """Return the sum of factors times powers of x."""
    powers: list[Operand] = []
    for power, factor in terms.items():
        value = (1.0,) if power == 0 else e.apply("ND_power_float", in1=x, in2=(float(power),))
        powers.append(_times(e, value, (factor,)))
    return _sum(e, powers)


def _absorption_from_color(e: Expressions, given: Given) -> dict[str, Operand]:
    divisor = _polynomial(e, given["azimuthal_roughness"], {0: 5.969, 1: -0.215, 2: 2.532, 3: -10.73, 4: 5.574, 5: 0.245})
    color = e.apply("ND_convert_color3_vector3", **{"in": given["color"]})
    inside = e.apply("ND_clamp_vector3FA", **{"in": color, "low": _LEAST_COLOR, "high": (1.0,)})
    root = e.apply("ND_divide_vector3FA", in1=e.apply("ND_ln_vector3", **{"in": inside}), in2=divisor)
    return {"absorption": e.apply("ND_multiply_vector3", in1=root, in2=root)}


def _absorption_from_melanin(e: Expressions, given: Given) -> dict[str, Operand]:
    left = e.apply("ND_subtract_float", in1=(1.0,), in2=given["melanin_concentration"])
    kept = e.apply("ND_max_float", in1=left, in2=_LEAST_LEFT)
    melanin = _times(e, e.apply("ND_ln_float", **{"in": kept}), (-1.0,))
    red = given["melanin_redness"]
    parts = (
        ("eumelanin_color", e.apply("ND_subtract_float", in1=(1.0,), in2=red)),
        ("pheomelanin_color", red),
    )
    found = []
    for name, share in parts:
        color = e.apply("ND_convert_color3_vector3", **{"in": given[name]})
        absorbed = e.apply("ND_ln_vector3", **{"in": e.apply("ND_max_vector3FA", in1=color, in2=(1e-6,))})
        by = _times(e, _times(e, melanin, share), (-1.0,))
        found.append(e.apply("ND_multiply_vector3FA", in1=absorbed, in2=by))
    total = e.apply("ND_add_vector3", in1=found[0], in2=found[1])
    return {"absorption": e.apply("ND_max_vector3FA", in1=total, in2=(0.0,))}


def _roughness(e: Expressions, given: Given) -> dict[str, Operand]:
    def inside(value: Operand) -> Operand:
        return e.apply("ND_clamp_float", **{"in": value, "low": _LEAST_ROUGHNESS, "high": (1.0,)})

    width = _polynomial(e, inside(given["longitudinal"]), {1: 0.726, 2: 0.812, 20: 3.7})
    scale = _polynomial(e, inside(given["azimuthal"]), {1: 0.265, 2: 1.194, 22: 5.372})
    made = {}
    for lobe, factor in (("R", (1.0,)), ("TT", given["scale_TT"]), ("TRT", given["scale_TRT"])):
        wide = _times(e, width, factor)
        made[f"roughness_{lobe}"] = e.apply("ND_combine2_vector2", in1=_times(e, wide, wide), in2=scale)
    return made


_FOLDED: dict[str, Callable[[Expressions, Given], dict[str, Operand]]] = {
    "ND_chiang_hair_absorption_from_color": _absorption_from_color,
    "ND_deon_hair_absorption_from_melanin": _absorption_from_melanin,
    "ND_chiang_hair_roughness": _roughness,
}


def is_hair_node(name: str) -> bool:
    return name in _FOLDED


def hair_node(e: Expressions, name: str, given: Given) -> Outputs:
    """Return the outputs of a hair node; `given`: all of its inputs."""
    if all(isinstance(value, tuple) for value in given.values()):
        return _FOLDED[name](e, given)
    return e.node(name, given)
