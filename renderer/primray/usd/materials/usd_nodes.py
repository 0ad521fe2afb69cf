"""USD's nodes UsdUVTexture, UsdTransform2d and UsdPrimvarReader, and MaterialX's versions of them, as pattern nodes.

Their definitions are written out here after UsdPreviewSurface's specification, so that stages with no other nodes need no
MaterialX library. MaterialX's versions differ only in their defaults (coordinates UV0, repeated images).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ...description import Operand, Wrap
from ...description.shading import TRANSFORM_2D, UV_TEXTURE
from .materialx.definitions import WIDTHS, Definition, InputDefinition
from .materialx.expressions import Expressions, Outputs
from .network import Node
from .texture_files import texture_file

Given = Callable[[InputDefinition], Operand]  # the value of an input of the node, or its default
_READER = "UsdPrimvarReader"
_CHANNELS = {"r": "float", "g": "float", "b": "float", "a": "float", "rgb": "color3", "rgba": "color4"}
_NUMBERS = {"fallback": (0.0, 0.0, 0.0, 1.0), "scale": (1.0,) * 4, "bias": (0.0,) * 4}
_USD_WRAPS = {wrap.value: wrap for wrap in Wrap}
_MATERIALX_WRAPS = {"black": Wrap.BLACK, "clamp": Wrap.CLAMP, "periodic": Wrap.REPEAT, "mirror": Wrap.MIRROR}


def _texture(name: str, st: tuple[float, ...] | str, wrap: str, outputs: tuple[str, ...]) -> Definition:
    inputs = [InputDefinition("file", "filename", None), InputDefinition("st", "vector2", st)]
    inputs += [InputDefinition(n, "string", wrap) for n in ("wrapS", "wrapT")]
    inputs += [InputDefinition(n, "vector4", value) for n, value in _NUMBERS.items()]
    inputs += [InputDefinition("sourceColorSpace", "string", "auto")]
    return Definition(name, UV_TEXTURE, tuple(inputs), tuple((output, _CHANNELS[output]) for output in outputs))


def _transform(name: str, output: str) -> Definition:
    two = {"in": (0.0, 0.0), "scale": (1.0, 1.0), "translation": (0.0, 0.0)}
    inputs = [*(InputDefinition(n, "vector2", value) for n, value in two.items()), InputDefinition("rotation", "float", (0.0,))]
    return Definition(name, TRANSFORM_2D, tuple(inputs), ((output, "vector2"),))


def _reader(name: str, kind: str, output: str) -> Definition:
    inputs = InputDefinition("varname", "string", ""), InputDefinition("fallback", kind, (0.0,) * WIDTHS.get(kind, 0))
    return Definition(name, _READER, inputs, ((output, kind),))


_FIVE = ("r", "g", "b", "a", "rgb")
_USD_TYPES = {"float": "float", "float2": "vector2", "float3": "vector3", "float4": "vector4", "int": "integer"}
_USD_TYPES |= {"normal": "vector3", "point": "vector3", "vector": "vector3", "string": "string", "matrix": "matrix44"}
_DEFINITIONS = (
    _texture("UsdUVTexture", (0.0, 0.0), Wrap.USE_METADATA.value, _FIVE),
    _texture("ND_UsdUVTexture", "UV0", "periodic", (*_FIVE, "rgba")),
    _texture("ND_UsdUVTexture_22", "UV0", "periodic", (*_FIVE, "rgba")),
    _texture("ND_UsdUVTexture_23", "UV0", "periodic", _FIVE),
    _transform("UsdTransform2d", "result"),
    _transform("ND_UsdTransform2d", "out"),
    *(_reader(f"UsdPrimvarReader_{name}", kind, "result") for name, kind in _USD_TYPES.items()),
    *(
        _reader(f"ND_UsdPrimvarReader_{kind}", kind, "out")
        for kind in ("float", "integer", "vector2", "vector3", "vector4", "string", "filename")
    ),
)
USD_NODES = {found.name: found for found in _DEFINITIONS}


def usd_outputs(node: Node, given: Given, e: Expressions, width: int, is_color: bool) -> Outputs | None:
    """Return a node's outputs for an input of `width` numbers, a colour if `is_color`; `given` evaluates its own inputs.

    Empty where it has no such output; None, reported, where it cannot give that many numbers.
    """
    found = USD_NODES[node.id]
    for name in sorted(name for name in node.shader.inputs if name not in found.by_name):
        node.warn("unknown-input", f"{node.id} has no input {name}: it is ignored.", f"inputs:{name}")
    if found.category == UV_TEXTURE:
        if node.output not in found.output_widths:
            return {}
        return {node.output: _uv_texture(node, found, given, e, width, is_color)}
    is_transform = found.category == TRANSFORM_2D
    made = _transformed(node, found, given, e) if is_transform else _read(node, found, given, e, width, is_color)
    return None if made is None else {found.outputs[0][0]: made}


def is_uv_texture(name: str) -> bool:
    return name in USD_NODES and USD_NODES[name].category == UV_TEXTURE


def _uv_texture(node: Node, found: Definition, given: Given, e: Expressions, width: int, is_color: bool) -> Operand:
    channel = _channel(node, width)
    four = {
        n: node.numbers(n, default, is_color=is_color and n == "fallback") if n in node.shader.inputs else default
        for n, default in _NUMBERS.items()
    }
    file = texture_file(node, is_color=is_color and len(channel) > 1)
    st = given(found.by_name["st"])
    wraps = [_wrap(node, found, n).value for n in ("wrapS", "wrapT")]
    if not file.path:  # problems with the other inputs have been reported
        return channels_of(four["fallback"], channel)
    inputs = {"file": file, "st": st, "wrapS": wraps[0], "wrapT": wraps[1], **four}
    made = e.primitive(UV_TEXTURE, _CHANNELS[channel], node.id, {**inputs, "channels": channel}, node.shown)
    if width != 3 or len(channel) != 1:
        return made
    return e.primitive("convert", "color3", "ND_convert_float_color3", {"in": made})


def channels_of(rgba: tuple[float, ...], channels: str) -> tuple[float, ...]:
    return tuple(rgba["rgba".index(channel)] for channel in channels)


def _channel(node: Node, width: int) -> str:
    """Return the channels to read: red where a colour feeds a number, one channel repeated for a colour; both are reported."""
    output = node.output
    if (len(output) > 1) == (width > 1) or width not in (1, 3):
        return output
    used, meaning = ("r", "its red channel is used") if width == 1 else (output, "that channel is used for red, green and blue")
    message = f"{output} feeds an input of {width} numbers: {meaning}."
    node.warn("connection-type", message, f"outputs:{output}")
    return used


def _wrap(node: Node, found: Definition, name: str) -> Wrap:
    default = str(found.defaults[name])
    known = _USD_WRAPS if default in _USD_WRAPS else _MATERIALX_WRAPS
    mode = node.text(name, default) if name in node.shader.inputs else default
    if mode not in known:
        message = f"{name} = {mode!r} is unknown: {default} is used."
        node.warn("shader-parameter", message, f"inputs:{name}")
    return known.get(mode, known[default])


def _transformed(node: Node, found: Definition, given: Given, e: Expressions) -> Operand:
    """Return UsdTransform2d's output: scale, then rotation counter-clockwise in degrees, then translation."""
    inputs = {wanted.name: given(wanted) for wanted in found.inputs}
    if all(isinstance(inputs[n], tuple) for n in ("scale", "rotation", "translation")):
        return e.primitive(TRANSFORM_2D, "vector2", node.id, inputs, node.shown)
    return e.apply("ND_UsdTransform2d", **inputs)


def _read(node: Node, found: Definition, given: Given, e: Expressions, width: int, is_color: bool) -> Operand | None:
    """Return the first `width` numbers of a primvar."""
    kind = found.outputs[0][1]
    has = WIDTHS.get(kind, 0)
    if has > 4 or has < width or not has:
        node.warn("connection-type", f"{node.id} is connected to an input of {width} numbers, which it cannot provide.")
        return None
    wanted = found.by_name["fallback"]
    wanted = replace(wanted, type=wanted.type.replace("vector", "color")) if is_color and has >= 3 else wanted
    fallback = given(wanted)
    if isinstance(fallback, tuple) and 0 < width < has:
        fallback, kind = fallback[:width], {1: "float", 2: "vector2", 3: "vector3"}[width]
    name = node.text("varname", "")
    if not name:
        node.warn("primvar-missing", "No primvar is named: the fallback is used.", "inputs:varname")
        return fallback
    inputs = {"geomprop": name, "default": fallback}
    return e.primitive("geompropvalue", kind, node.id, inputs, node.shown)
