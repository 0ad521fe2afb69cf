"""Hexagonal tiles against an evaluator in double precision: colours, alpha, normals."""

from __future__ import annotations

import numpy as np
import pytest
from tests import described

from primray.core.patterns.program import WIDTHS
from primray.description import Floats, Operand

from ..library import primitives
from ..oracle import hextiles
from ..oracle.numbers import Rows
from ..pictured import Case, Graph, evaluate
from .test_images import FILE, bilinear, texels

COUNT = 64
RANGES = {
    "texcoord": (-2, 2), "tiling": (0.5, 3), "rotation": (0, 1), "rotationrange": (-90, 270), "scale": (0, 1),
    "scalerange": (0.5, 2), "offset": (0, 1), "offsetrange": (0, 1), "falloff": (0.2, 0.8), "falloffcontrast": (0, 1),
    "lumacoeffs": (0.1, 0.5), "strength": (0.3, 1), "default": (0, 1), "flip_g": (0, 1),
}  # fmt: skip


def given(name: str) -> tuple[Case, dict[str, Rows]]:
    """The node over inputs at random, with its normal and tangents at right angles."""
    (definition,) = (d for d in primitives() if d.name == name)
    random = np.random.default_rng(11)
    frame = np.linalg.qr(random.normal(size=(COUNT, 3, 3)))[0]
    graph, primvars, inputs = Graph(), dict[str, Floats](), dict[str, Operand]({"file": FILE})
    for k, (own, type, _) in enumerate(definition.inputs):
        if type == "filename":
            continue
        if own in ("normal", "tangent", "bitangent"):
            values = frame[:, k % 3]
        else:
            values = random.uniform(*RANGES[own], (COUNT, WIDTHS[type]))
            values = np.round(values) if type == "boolean" else values
        if own == "falloff":
            values[::2] = 0.5
        primvars[own] = values.astype(np.float32)
        inputs[own] = graph.primvar(own, type)
    type = definition.outputs[0][1]
    made = graph.add(definition.category, type, inputs, name)
    return Case(graph, primvars, {"out": (made, type)}), {own: v.astype(np.float64) for own, v in primvars.items()}


@pytest.mark.parametrize("name", ["ND_hextiledimage_color3", "ND_hextiledimage_color4", "ND_hextilednormalmap_vector3"])
def test_hexagonal_tiles(name: str) -> None:
    """The hash multiplies fractions by hundreds: single precision leaves a few digits of where a tile is read."""
    case, inputs = given(name)
    pixels = texels(4, 4, 4)

    def look(at: Rows) -> Rows:
        return bilinear(pixels, at, "periodic")

    want = hextiles.normal(inputs, look) if "normalmap" in name else hextiles.image(inputs, look)
    (found,) = evaluate([case], textures={FILE: described.image(pixels)})
    np.testing.assert_allclose(found["out"], want[:, : found["out"].shape[1]], atol=2e-3)
