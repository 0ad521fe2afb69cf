"""Primitive nodes of constants, by the specification's formulas; library graphs of them; and what does not fold."""

from __future__ import annotations

import math

import pytest

from primray.description import NodeOutput, Operand
from primray.usd.materials.materialx.definitions import definition
from primray.usd.materials.materialx.documents import library
from primray.usd.materials.materialx.expressions import Expressions

CASES: dict[str, tuple[dict[str, Operand], tuple[float, ...]]] = {
    "ND_modulo_float": ({"in1": (-0.25,), "in2": (1.0,)}, (0.75,)),
    "ND_power_float": ({"in1": (2.0,), "in2": (3.0,)}, (8.0,)),
    "ND_round_float": ({"in": (-0.5,)}, (0.0,)),
    "ND_fract_float": ({"in": (-0.25,)}, (0.75,)),
    "ND_sign_float": ({"in": (-3.0,)}, (-1.0,)),
    "ND_atan2_float": ({"iny": (1.0,), "inx": (-1.0,)}, (0.75 * math.pi,)),
    "ND_clamp_vector3FA": ({"in": (-1.0, 0.5, 2.0), "low": (0.0,), "high": (1.0,)}, (0.0, 0.5, 1.0)),
    "ND_invert_color3FA": ({"in": (0.0, 0.25, 1.0)}, (1.0, 0.75, 0.0)),
    "ND_normalize_vector3": ({"in": (0.0, 3.0, 4.0)}, (0.0, 0.6, 0.8)),
    "ND_dotproduct_vector3": ({"in1": (1.0, 2.0, 3.0), "in2": (4.0, 5.0, 6.0)}, (32.0,)),
    "ND_crossproduct_vector3": ({"in1": (1.0, 0.0, 0.0), "in2": (0.0, 1.0, 0.0)}, (0.0, 0.0, 1.0)),
    "ND_remap_float": ({"in": (0.5,), "inlow": (0.0,), "inhigh": (1.0,), "outlow": (2.0,), "outhigh": (4.0,)}, (3.0,)),
    "ND_smoothstep_float": ({"in": (0.25,)}, (0.15625,)),
    "ND_luminance_color3": ({"in": (1.0, 0.0, 0.0), "lumacoeffs": (0.25, 0.5, 0.25)}, (0.25, 0.25, 0.25)),
    "ND_hsvtorgb_color3": ({"in": (1.0 / 3.0, 1.0, 0.5)}, (0.0, 0.5, 0.0)),
    "ND_combine4_vector4": ({"in1": (1.0,), "in2": (2.0,), "in3": (3.0,), "in4": (4.0,)}, (1.0, 2.0, 3.0, 4.0)),
    "ND_extract_vector3": ({"in": (1.0, 2.0, 3.0), "index": (2.0,)}, (3.0,)),
    "ND_convert_color3_color4": ({"in": (0.1, 0.2, 0.3)}, (0.1, 0.2, 0.3, 1.0)),
    "ND_convert_float_color3": ({"in": (0.5,)}, (0.5, 0.5, 0.5)),
    "ND_plus_float": ({"fg": (0.5,), "bg": (0.25,), "mix": (0.5,)}, (0.5,)),
    "ND_screen_float": ({"fg": (0.5,), "bg": (0.5,)}, (0.75,)),
    "ND_burn_float": ({"fg": (0.5,), "bg": (0.75,)}, (0.5,)),
    "ND_dodge_float": ({"fg": (0.5,), "bg": (0.25,)}, (0.5,)),
    "ND_unpremult_color4": ({"in": (0.25, 0.5, 0.125, 0.5)}, (0.5, 1.0, 0.25, 0.5)),
    "ND_inside_float": ({"in": (0.5,), "mask": (0.25,)}, (0.125,)),
    "ND_ifequal_float": ({"value1": (1.0,), "value2": (1.0,), "in1": (2.0,), "in2": (3.0,)}, (2.0,)),
    "ND_saturate_color3": ({"in": (1.0, 0.0, 0.0), "amount": (0.0,), "lumacoeffs": (0.25, 0.5, 0.25)}, (0.25, 0.25, 0.25)),
    "ND_overlay_float": ({"fg": (0.75,), "bg": (0.25,)}, (0.375,)),
    "ND_range_float": ({"in": (0.5,), "outhigh": (4.0,)}, (2.0,)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_constants_give_the_specifications_values(name: str) -> None:
    inputs, expected = CASES[name]
    assert Expressions().apply(name, **inputs) == pytest.approx(expected, abs=1e-12)


def test_what_has_no_value_stays_a_node() -> None:
    e = Expressions()
    assert e.apply("ND_divide_float", in1=(1.0,), in2=(0.0,)) == NodeOutput(0, "out")
    assert e.apply("ND_ln_float", **{"in": (-1.0,)}) == NodeOutput(1, "out")


def test_neutral_constants_leave_what_varies() -> None:
    e = Expressions()
    noise = e.apply("ND_noise2d_float")
    assert e.apply("ND_multiply_float", in1=noise, in2=(1.0,)) == noise
    assert e.apply("ND_multiply_float", in1=noise, in2=(0.0,)) == (0.0,)
    assert e.apply("ND_mix_float", fg=noise, bg=(0.25,), mix=(1.0,)) == noise
    assert e.apply("ND_colorcorrect_color3", **{"in": (0.5, 0.5, 0.5)}) == pytest.approx((0.5, 0.5, 0.5))
    assert len(e.nodes) == 1


def test_every_definition_of_the_library_expands_to_primitives() -> None:
    names = [found.getName() for found in library().getNodeDefs()]
    for name in names:
        e = Expressions()
        e.node(name, {})
        for index, node in enumerate(e.nodes):
            own = definition(node.signature)
            assert own is not None
            assert {key for key, _ in node.inputs} <= set(own.defaults)
            assert all(operand.node < index for _, operand in node.inputs if isinstance(operand, NodeOutput))
    assert len(names) > 700
