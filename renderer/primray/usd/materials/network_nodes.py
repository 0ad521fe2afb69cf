"""The nodes of UsdPreviewSurface's vocabulary as inputs of the seam: textures, primvar readers and 2-D transforms.

A network reduces to one texture or primvar per input, since these nodes feed each other only through texture coordinates:
chains of transforms become one matrix. MaterialX's nodes of the same meaning are read alike (NODES).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from pxr import Sdf

from ...description import PrimvarInput, TextureInput, Wrap
from ..querying.guarded import property_names
from ..resolving.context import Context
from ..resolving.notes import note_unknown_schemas
from .network import Constant, Node, as_numbers, find_source, node_path, numbers, text
from .texture_asset import texture_file

Affine = tuple[float, float, float, float, float, float]  # 2 x 3, by rows
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
NO_PRIMVAR = ""  # no shape has a primvar of this name: a PrimvarInput of it is its fallback


class NodeKind(Enum):
    TEXTURE = "texture"
    IMAGE = "image"  # MaterialX's, whose names and defaults differ
    READER = "reader"
    TRANSFORM = "transform"


@dataclass(frozen=True)
class NodeType:
    kind: NodeKind
    width: int = 0  # of a reader's or image's result; 0: its values are no numbers
    name: str = "varname"  # a reader's parameter that names the primvar
    fallback: str = "fallback"


def _readers() -> dict[str, NodeType]:
    widths = {"float": 1, "float2": 2, "float3": 3, "float4": 4, "int": 1, "normal": 3, "point": 3, "vector": 3}
    readers = {f"UsdPrimvarReader_{name}": NodeType(NodeKind.READER, width) for name, width in widths.items()}
    readers |= {f"UsdPrimvarReader_{name}": NodeType(NodeKind.READER) for name in ("string", "matrix")}
    mtlx = {"float": 1, "integer": 1, "vector2": 2, "vector3": 3, "vector4": 4}
    readers |= {f"ND_UsdPrimvarReader_{name}": NodeType(NodeKind.READER, width) for name, width in mtlx.items()}
    mtlx |= {"color3": 3, "color4": 4}
    properties = {name: NodeType(NodeKind.READER, width, "geomprop", "default") for name, width in mtlx.items()}
    return readers | {f"ND_geompropvalue_{name}": node for name, node in properties.items()}


def _images() -> dict[str, NodeType]:
    widths = {"float": 1, "color3": 3, "color4": 4, "vector2": 2, "vector3": 3, "vector4": 4}
    return {f"ND_image_{name}": NodeType(NodeKind.IMAGE, width) for name, width in widths.items()}


NODES: dict[str, NodeType] = {
    "UsdUVTexture": NodeType(NodeKind.TEXTURE),
    "ND_UsdUVTexture": NodeType(NodeKind.TEXTURE),
    "ND_UsdUVTexture_22": NodeType(NodeKind.TEXTURE),
    "ND_UsdUVTexture_23": NodeType(NodeKind.TEXTURE),
    "UsdTransform2d": NodeType(NodeKind.TRANSFORM, 2),
    "ND_UsdTransform2d": NodeType(NodeKind.TRANSFORM, 2),
    **_readers(),
    **_images(),
}
_INPUTS = {
    NodeKind.TEXTURE: frozenset(["file", "st", "wrapS", "wrapT", "fallback", "scale", "bias", "sourceColorSpace"]),
    NodeKind.TRANSFORM: frozenset(["in", "rotation", "scale", "translation"]),
}
# MaterialX's address modes; where the file is read outside 0 to 1 with "constant", it gives its default: black here.
_ADDRESS_MODES = {"constant": Wrap.BLACK, "clamp": Wrap.CLAMP, "periodic": Wrap.REPEAT, "mirror": Wrap.MIRROR}


def _note_unread(node: Node, ctx: Context) -> None:
    """Inputs that the node's definition does not have, and schemas that nobody knows."""
    note_unknown_schemas(node.prim, node_path(node, ctx), ctx)
    kind = NODES[node.id]
    known = frozenset({kind.name, kind.fallback}) if kind.kind is NodeKind.READER else _INPUTS.get(kind.kind)
    if known is None:
        return
    for name in property_names(node.prim):
        if name.startswith("inputs:") and name.removeprefix("inputs:") not in known:
            ctx.warn("unknown-input", node_path(node, ctx), f"{node.id} has no {name.removeprefix('inputs:')}.", str(name))


def is_reader(identifier: str) -> bool:
    return identifier in NODES and NODES[identifier].kind is NodeKind.READER


def primvar_name(node: Node, ctx: Context) -> str:
    """The primvar that a reader reads, "" for none."""
    return text(node, NODES[node.id].name, "", ctx)


def reader_input(node: Node, width: int, ctx: Context, *, is_color: bool = False) -> PrimvarInput | None:
    """The first `width` numbers of a reader's primvar, its fallback in the rendering space if `is_color`; None, noted, where
    its values have fewer."""
    _note_unread(node, ctx)
    kind = NODES[node.id]
    if kind.width < width:
        ctx.warn("connection-type", node_path(node, ctx), f"{node.id} does not give the {width} numbers that are wanted of it.")
        return None
    fallback = numbers(node, kind.fallback, (0.0,) * kind.width, ctx, is_color=is_color)
    name = primvar_name(node, ctx)
    if not name:
        ctx.warn("primvar-missing", node_path(node, ctx), "It names no primvar: its fallback is used.", f"inputs:{kind.name}")
    return PrimvarInput(name, fallback[:width])


def texture_input(node: Node, width: int, ctx: Context, *, is_color: bool = False) -> TextureInput | None:
    """A texture's output for an input of 1 or 3 numbers, a colour if `is_color`; None, noted, where the node has none such."""
    if NODES[node.id].kind is NodeKind.IMAGE:
        return _image_input(node, width, is_color, ctx)
    if node.output not in ("rgb", "r", "g", "b", "a"):
        ctx.warn("shader-connection", node_path(node, ctx), f"{node.id} has no output {node.output}.")
        return None
    _note_unread(node, ctx)
    st, transform = _coordinates(node, "st", PrimvarInput(NO_PRIMVAR, (0.0, 0.0)), ctx)
    return TextureInput(
        texture_file(node, ctx, is_color=is_color and node.output == "rgb"),
        _channels(node, node.output, width, ctx),
        st,
        transform,
        _wrap(node, "wrapS", ctx),
        _wrap(node, "wrapT", ctx),
        _four(numbers(node, "fallback", (0.0, 0.0, 0.0, 1.0), ctx, is_color=is_color)),
        _four(numbers(node, "scale", (1.0, 1.0, 1.0, 1.0), ctx)),
        _four(numbers(node, "bias", (0.0, 0.0, 0.0, 0.0), ctx)),
    )


def _image_input(node: Node, width: int, is_color: bool, ctx: Context) -> TextureInput | None:
    kind = NODES[node.id]
    if node.output != "out":
        ctx.warn("shader-connection", node_path(node, ctx), f"{node.id} has no output {node.output}.")
        return None
    output = "r" if kind.width == 1 else "rgb"
    if kind.width == 2:
        ctx.warn("connection-type", node_path(node, ctx), f"{node.id} does not give the {width} numbers that are wanted of it.")
        return None
    default = numbers(node, "default", (0.0,) * kind.width, ctx, is_color=is_color)
    fallback = default * 3 + (1.0,) if kind.width == 1 else (*default, 1.0)[:4]
    st, transform = _coordinates(node, "texcoord", PrimvarInput("st", (0.0, 0.0)), ctx)
    return TextureInput(
        texture_file(node, ctx, is_color=is_color and output == "rgb"),
        _channels(node, output, width, ctx),
        st,
        transform,
        _ADDRESS_MODES.get(text(node, "uaddressmode", "periodic", ctx), Wrap.REPEAT),
        _ADDRESS_MODES.get(text(node, "vaddressmode", "periodic", ctx), Wrap.REPEAT),
        _four(fallback),
    )


def _channels(node: Node, output: str, width: int, ctx: Context) -> str:
    """The output, where it has as many numbers as are wanted; of a colour the red, for a colour one channel thrice."""
    if (output == "rgb") == (width == 3):
        return output
    used = "r" if width == 1 else output
    meaning = "its red channel is used" if width == 1 else "that channel is used for red, green and blue"
    message = f"{output} feeds an input of {width} numbers: {meaning}."
    ctx.warn("connection-type", node_path(node, ctx), message, f"outputs:{output}")
    return used


def _wrap(node: Node, name: str, ctx: Context) -> Wrap:
    mode = text(node, name, "useMetadata", ctx)
    try:
        return Wrap(mode)
    except ValueError:
        ctx.warn(
            "shader-parameter", node_path(node, ctx), f"{name} = {mode!r} is not known: useMetadata is used.", f"inputs:{name}"
        )
        return Wrap.USE_METADATA


def _coordinates(node: Node, name: str, default: PrimvarInput, ctx: Context) -> tuple[PrimvarInput, Affine]:
    """A primvar and the matrix applied to it, from a chain of transforms; a constant is a primvar that no shape has."""
    transform = IDENTITY
    passed: list[Sdf.Path] = []
    while True:
        attribute = node.prim.GetAttribute(f"inputs:{name}")
        source = find_source(attribute, ctx) if attribute else None
        if source is None:
            return (default if not passed else PrimvarInput(NO_PRIMVAR, (0.0, 0.0))), transform
        if isinstance(source, Constant):
            return PrimvarInput(NO_PRIMVAR, _two(source, node, name, ctx)), transform
        kind = NODES[source.id].kind if source.id in NODES else None
        if kind is NodeKind.READER:
            found = reader_input(source, 2, ctx)
            return found or PrimvarInput(NO_PRIMVAR, (0.0, 0.0)), transform
        if source.id == "ND_texcoord_vector2":
            return PrimvarInput("st", (0.0, 0.0)), transform
        if kind is not NodeKind.TRANSFORM or source.prim.GetPath() in passed:
            why = "leads back to itself" if kind is NodeKind.TRANSFORM else f"comes from {source.id or 'a shader without id'}"
            ctx.warn("shader-ignored", node_path(node, ctx), f"{name} {why}: (0, 0) is used.", f"inputs:{name}")
            return PrimvarInput(NO_PRIMVAR, (0.0, 0.0)), transform
        transform = affine_product(transform, _transform_2d(source, ctx))
        passed.append(source.prim.GetPath())
        node, name = source, "in"


def _two(source: Constant, node: Node, name: str, ctx: Context) -> tuple[float, float]:
    values = as_numbers(source.value)
    if values is None or len(values) < 2:
        message = f"{name} = {source.value!r} is not two finite numbers: (0, 0) is used."
        ctx.warn("wrong-type", node_path(node, ctx), message, f"inputs:{name}")
        return (0.0, 0.0)
    return values[0], values[1]


def _transform_2d(node: Node, ctx: Context) -> Affine:
    """UsdTransform2d: in * scale, then rotated counter-clockwise by degrees, then translated."""
    _note_unread(node, ctx)
    (sx, sy), (tx, ty) = (numbers(node, n, d, ctx) for n, d in (("scale", (1.0, 1.0)), ("translation", (0.0, 0.0))))
    (degrees,) = numbers(node, "rotation", (0.0,), ctx)
    turns, rest = divmod(degrees, 90.0)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns) % 4):  # right angles exactly
        c, s = -s, c
    return (c * sx, 0.0 - s * sy, tx, s * sx, c * sy, ty)


def affine_product(outer: Affine, inner: Affine) -> Affine:
    """outer * inner."""
    a, b, c, d, e, f = outer
    g, h, i, j, k, m = inner
    return (a * g + b * j, a * h + b * k, a * i + b * m + c, d * g + e * j, d * h + e * k, d * i + e * m + f)


def _four(values: tuple[float, ...]) -> tuple[float, float, float, float]:
    r, g, b, a = values
    return (r, g, b, a)
