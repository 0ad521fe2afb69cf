"""Every node of numbers, of every type, over inputs at random: pixels against an evaluator in double precision."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from primray.core.patterns.program import WIDTHS
from primray.core.patterns.tape_upload import NO_MEANING, NODES
from primray.description import NodeOutput, Operand
from primray.description.shading import TRANSFORM_2D, UV_TEXTURE

from ..library import Definition, primitives
from ..oracle.matrices import of_matrices
from ..oracle.noises import of_noises
from ..oracle.numbers import NUMBERS, Inputs
from ..oracle.physical import PHYSICAL
from ..pictured import Case, Graph, Rows, evaluate

Numbers = npt.NDArray[np.float32]
COUNT = 48
TOLERANCE, TOLERANCE_OF_NOISE = 1e-5, 1e-4
NOISES = ("noise", "fractal", "cellnoise", "worleynoise", "flake")
OF_VALUES: dict[str, Callable[[Inputs], Rows | dict[str, Rows]]] = {**NUMBERS, **PHYSICAL}
# Nodes of places, spaces, images and differences have tests of their own.
ELSEWHERE = {
    "position", "normal", "tangent", "bitangent", "texcoord", "geomcolor", "geompropvalue", "viewdirection", "transformpoint",
    "transformvector", "transformnormal", "frame", "time", "image", "hextiledimage", "hextilednormalmap", "heighttonormal",
}  # fmt: skip
# Ranges of inputs, by category and input, or by input alone.
RANGES = {
    ("asin", "in"): (-0.99, 0.99), ("acos", "in"): (-0.99, 0.99), ("sqrt", "in"): (0, 4), ("ln", "in"): (0.05, 5),
    ("power", "in1"): (0.1, 3), ("hsvtorgb", "in"): (0.05, 1), ("rgbtohsv", "in"): (0.05, 1), ("tan", "in"): (-1.4, 1.4),
    ("premult", "in"): (0.1, 1), ("unpremult", "in"): (0.1, 1), ("rotate2d", "amount"): (-400, 400),
    ("rotate3d", "amount"): (-400, 400), ("exp", "in"): (-5, 5), ("divide", "in2"): (0.5, 3), ("remap", "inlow"): (-2, 0),
    ("remap", "inhigh"): (0.5, 2), ("smoothstep", "low"): (-1, 0), ("smoothstep", "high"): (0.5, 2),
    ("modulo", "in2"): (0.3, 2), ("blackbody", "temperature"): (500, 15000),
    ("flake2d", "size"): (0.4, 0.9), ("flake3d", "size"): (0.4, 0.9),
}  # fmt: skip
BY_INPUT = {
    "texcoord": (-7, 7), "position": (-7, 7), "jitter": (0.2, 1), "octaves": (1, 5), "lacunarity": (1.5, 2.5),
    "diminish": (0.3, 0.7), "mix": (0, 1), "roughness": (0.05, 0.9), "coverage": (0.2, 1), "anisotropy": (0, 1),
    "reflectivity": (0.05, 0.95), "edge_color": (0.1, 0.9), "longitudinal": (0.05, 0.9), "azimuthal": (0.05, 0.9),
    "azimuthal_roughness": (0.1, 0.9), "color": (0.05, 0.95), "eumelanin_color": (0.1, 0.9), "pheomelanin_color": (0.1, 0.9),
    "melanin_concentration": (0.1, 0.9), "melanin_redness": (0.1, 0.9), "style": (0, 2), "index": (0, 4), "fg": (0.05, 0.95),
    "bg": (0.05, 0.95),
}  # fmt: skip


def meant(definitions: tuple[Definition, ...]) -> list[Definition]:
    return [d for d in definitions if d.outputs[0][1] not in NO_MEANING and d.category not in ELSEWHERE]


def values_of(d: Definition, name: str, type: str, random: np.random.Generator) -> Numbers:
    low, high = RANGES.get((d.category, name), BY_INPUT.get(name, (-3, 3)))
    if type == "boolean":
        return random.integers(0, 2, (COUNT, 1)).astype(np.float32)
    if type == "integer" and name not in BY_INPUT:
        return random.integers(-3, 4, (COUNT, 1)).astype(np.float32)
    if type == "integer":
        return random.integers(int(low), int(high), (COUNT, 1)).astype(np.float32)
    values = random.uniform(low, high, (COUNT, WIDTHS[type])).astype(np.float32)
    if type.startswith("matrix"):
        values += 4 * np.eye(int(type[-1]), dtype=np.float32).ravel()
    if d.category.startswith("if") and name == "value2":
        values[::2] = np.float32(0.5)
    if d.category.startswith("if") and name == "value1":
        values[::3] = np.float32(0.5)
    return values


def graph_of(d: Definition) -> tuple[Case, dict[str, Rows]]:
    random = np.random.default_rng(zlib.crc32(d.name.encode()))
    graph, primvars, inputs, values = Graph(), dict[str, Numbers](), dict[str, Operand](), dict[str, Rows]()
    for name, type, _ in d.inputs:
        if type == "string":
            continue
        given = values_of(d, name, type, random)
        values[name] = given.astype(np.float64)
        if not type.startswith("matrix"):
            primvars[name] = given
            inputs[name] = graph.primvar(name, type)
            continue
        n = int(type[-1])
        rows: dict[str, Operand] = {}
        for k in range(n):
            primvars[f"{name}_{k}"] = given[:, k * n : (k + 1) * n]
            rows[f"in{k + 1}"] = graph.primvar(f"{name}_{k}", f"vector{n}")
        inputs[name] = graph.add("creatematrix", type, rows)
    made = graph.add(d.category, d.outputs[0][1], inputs, d.name)
    return Case(graph, primvars, {name: (NodeOutput(made.node, name), type) for name, type in d.outputs}), values


def wanted_of(d: Definition, values: dict[str, Rows]) -> dict[str, Rows]:
    type = d.outputs[0][1]
    found: Rows | dict[str, Rows] | None = of_matrices(d.category, values, type)
    if found is None:
        found = of_noises(d.category, values, WIDTHS[type])
    if found is None:
        found = OF_VALUES[d.category](values)
    return found if isinstance(found, dict) else {d.outputs[0][0]: found}


@pytest.fixture(scope="module")
def pictures() -> dict[str, dict[str, Rows]]:
    """By definition and output, from one picture."""
    all_of = meant(primitives())
    found = evaluate([graph_of(d)[0] for d in all_of])
    return {d.name: made for d, made in zip(all_of, found, strict=True)}


def test_every_definition_is_written_or_told_why_not() -> None:
    unknown = [
        f"{d.name}: {d.outputs[0][1]}" for d in primitives() if d.outputs[0][1] not in NO_MEANING and d.category not in NODES
    ]
    assert unknown == []
    assert len({d.category for d in primitives()}) > 130


def test_nothing_is_written_that_no_definition_has() -> None:
    """Or that is USD's own."""
    assert set(NODES) - {d.category for d in primitives()} == {UV_TEXTURE, TRANSFORM_2D}


@pytest.mark.parametrize("definition", meant(primitives()), ids=lambda d: d.name.removeprefix("ND_"))
def test_node(definition: Definition, pictures: dict[str, dict[str, Rows]]) -> None:
    wanted = wanted_of(definition, graph_of(definition)[1])
    for name, want in wanted.items():
        got = pictures[definition.name][name]
        tolerance = TOLERANCE_OF_NOISE if definition.category.startswith(NOISES) else TOLERANCE
        scale = np.maximum(np.abs(want), 1.0 if name != "id" else 1e2)
        np.testing.assert_allclose(got / scale, want / scale, rtol=0, atol=tolerance, err_msg=f"{definition.name} {name}")
