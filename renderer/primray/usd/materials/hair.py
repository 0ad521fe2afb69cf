"""Hair materials: a MaterialX ND_surface of an ND_chiang_hair_bsdf, or a UsdPreviewSurface with `primray:hair`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields

from ...description import Hair, Input, NodeOutput, Operand, Surface
from ...description.shading import HAIR_PREFIX
from ..scene.context import Context
from .authored import INPUT
from .materialx.definitions import Definition, definition
from .materialx.expressions import MOST_NODES, Expressions, TooManyNodesError, hair_node
from .network import Node
from .node_values import NodeValues, definition_of
from .surface_inputs import Reducer, pruned

BSDF = "ND_chiang_hair_bsdf"
_PREVIEW = "ND_UsdPreviewSurface_surfaceshader"
_LOBES = ("R", "TT", "TRT")
_LOGISTIC = math.sqrt(
    math.pi / 8
)  # scale of the logistic distribution for the azimuthal roughness (Chiang et al. 2016, equation 12)
_WIDTHS = {f.name: len(f.default) if isinstance(f.default, tuple) else 1 for f in fields(Hair)}
_Read = Callable[[dict[str, Operand], Expressions], dict[str, Operand]]
_NEUTRAL = (0.3,)  # azimuthal roughness for UsdPreviewSurface, which has only one roughness


def hair_bsdf(shader: Node) -> Node | None:
    """Return the hair BSDF that is connected to a surface constructor (ND_surface), None for any other BSDF."""
    source = shader.source("bsdf")
    if not isinstance(source, Node) or source.id != BSDF:
        return None
    others = sorted(INPUT + name for name in shader.shader.inputs if name != "bsdf")
    if others:
        shader.warn("material-input", f"Inputs without effect on hair: {', '.join(others)}.", others[0])
    return source


def hair_surface(bsdf: Node, path: str, ctx: Context) -> Surface | None:
    """Return the surface of a hair BSDF node; its normal and direction inputs have no effect, as fibres have their own."""
    found = definition_of(bsdf)
    assert found is not None

    def read(given: dict[str, Operand], e: Expressions) -> dict[str, Operand]:
        for name in ("normal", "curve_direction"):
            if name in given:
                message = f"{name} has no effect: hair fibres have their own."
                bsdf.warn("material-input", message, INPUT + name)
        return {**found.default_operands, **given}

    return _surface(bsdf, found, read, path, ctx)


def preview_hair(shader: Node, path: str, ctx: Context) -> Surface | None:
    """Return a hair surface made from UsdPreviewSurface's inputs.

    diffuseColor is the colour of many such fibres, roughness the longitudinal roughness, and ior the fibre's index of
    refraction; other inputs have no effect.
    """
    found = definition(_PREVIEW)
    assert found is not None

    def read(given: dict[str, Operand], e: Expressions) -> dict[str, Operand]:
        used = ("diffuseColor", "roughness", "ior")
        if unused := sorted(name for name in given if name not in used):
            shader.warn("material-input", f"Inputs without effect on hair: {', '.join(unused)}.")
        color, along = given.get("diffuseColor", (0.18,) * 3), given.get("roughness", (0.5,))
        widths = {"longitudinal": along, "azimuthal": _NEUTRAL, "scale_TT": (0.5,), "scale_TRT": (2.0,)}
        colored = {"color": color, "azimuthal_roughness": _NEUTRAL}
        absorbed = hair_node(e, "ND_chiang_hair_absorption_from_color", colored)
        made = {"absorption_coefficient": absorbed["absorption"], "ior": given.get("ior", (1.55,))}
        return made | dict(hair_node(e, "ND_chiang_hair_roughness", widths))

    return _surface(shader, found, read, path, ctx)


def _surface(node: Node, found: Definition, read: _Read, path: str, ctx: Context) -> Surface | None:
    """Return the surface of a node with a definition; `read` maps its inputs to those of the hair BSDF node."""
    values = NodeValues(ctx)
    try:
        inputs = read(values.inputs_of(node, found), values.expressions)
        return _surface_of(_of_node(inputs, values.expressions), values.expressions, path)
    except TooManyNodesError:
        ctx.warn("shader-ignored", path, f"Its network has more than {MOST_NODES:,} nodes: displayColor is used.")
        return None


def _of_node(inputs: dict[str, Operand], e: Expressions) -> dict[str, Operand]:
    """Return the inputs of Hair for the inputs of a hair BSDF node."""
    made: dict[str, Operand] = {"absorption": inputs["absorption_coefficient"], "ior": inputs["ior"]}
    for lobe in _LOBES:
        if (tint := inputs.get(f"tint_{lobe}")) is not None:
            made[f"tint_{lobe.lower()}"] = tint
        width = inputs[f"roughness_{lobe}"]
        along, about = (e.apply("ND_extract_vector2", **{"in": width, "index": (float(k),)}) for k in (0, 1))
        made[f"variance_{lobe.lower()}"] = along
        made[f"scale_{lobe.lower()}"] = e.apply("ND_multiply_float", in1=about, in2=(_LOGISTIC,))
    angle = inputs.get("cuticle_angle", (0.5,))
    turned = e.apply("ND_multiply_float", in1=angle, in2=(math.pi,))
    made["cuticle_tilt"] = e.apply("ND_subtract_float", in1=turned, in2=(math.pi / 2,))
    return made


def _surface_of(inputs: dict[str, Operand], e: Expressions, path: str) -> Surface:
    """Return a hair Surface from operands, constants and varying inputs set apart."""
    constants: dict[str, float | tuple[float, ...]] = {}
    varying: dict[str, Input] = {}
    reducer = Reducer(e.nodes)
    for name, value in inputs.items():
        width = _WIDTHS[name]
        if isinstance(value, NodeOutput):
            varying[HAIR_PREFIX + name] = reducer.input(value, width)
        elif isinstance(value, tuple):
            constants[HAIR_PREFIX + name] = value[0] if width == 1 else (value * 3)[:3]
    pattern, read = pruned(e.nodes, varying)
    surface = Surface(path, hair=Hair(), inputs=tuple(read.items()), pattern=pattern)
    return surface.with_constants(constants)  # type: ignore[arg-type]
