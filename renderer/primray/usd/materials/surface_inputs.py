"""Reduction of operands to surface inputs: a single texture or primvar where that is equivalent, else a pattern's output.

An image whose coordinates are an affine map of a primvar, and whose texels are scaled and biased by constants, becomes a
TextureInput: it needs no pattern and is filtered as textures are. Nodes that no surface input reads are then removed from the
pattern.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...description import (
    Input,
    NodeOutput,
    Operand,
    Pattern,
    PatternInput,
    PatternNode,
    PrimvarInput,
    TextureFile,
    TextureInput,
    Wrap,
)
from ...description.shading import TRANSFORM_2D, UV_TEXTURE, primvar_of_set
from .usd_nodes import channels_of

Numbers = tuple[float, ...]
Affine = tuple[float, float, float, float, float, float]  # 2 x 3, row-major
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
NO_PRIMVAR = ""  # no shape has a primvar of this name, so a PrimvarInput with it gives its fallback
_WRAPS = {"periodic": Wrap.REPEAT, "clamp": Wrap.CLAMP, "mirror": Wrap.MIRROR}
_PLAIN = {"scale": (1.0,) * 4, "bias": (0.0,) * 4, "fallback": (0.0, 0.0, 0.0, 1.0)}
_WIDTHS = {"float": 1, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4}


@dataclass(frozen=True)
class _Scaled:
    """Channels of an image node's texels ("r", "rgb", "rgba" ...) times a scale plus a bias, one number per channel.

    `default`: the value where there is no image.
    """

    image: int
    channels: str
    scale: Numbers
    bias: Numbers
    default: Numbers


class Reducer:
    """Reduction of outputs of the nodes of one pattern to surface inputs."""

    def __init__(self, nodes: list[PatternNode]) -> None:
        self._nodes = nodes

    def input(self, value: NodeOutput, width: int) -> Input:
        """Return a varying value as a surface input of 1 or 3 numbers."""
        node = self._nodes[value.node]
        if node.category == "geompropvalue":
            inputs = dict(node.inputs)
            name, default = inputs.get("geomprop"), inputs.get("default")
            if isinstance(name, str) and name and isinstance(default, tuple) and len(default) == width:
                return PrimvarInput(name, default)
        made = self._plain(node, width) if node.category == UV_TEXTURE else None
        if made is None:
            found = self._scaled(value)
            made = self._texture(found, width) if found is not None else None
        return made or PatternInput(value, self.stand_in(value, width))

    def normal(self, value: NodeOutput) -> Input | None:
        """Return a normal input: in tangent space where it is a normal map, else a pattern's normal in world space.

        None for a constant map that would turn the surface around.
        """
        node = self._nodes[value.node]
        inputs = dict(node.inputs)
        frame = (inputs.get("normal"), inputs.get("tangent"), inputs.get("bitangent"))
        scale = inputs.get("scale")
        if node.category == "normalmap" and frame == ("Nworld", "Tworld", "Bworld") and isinstance(scale, tuple):
            given = inputs.get("in")
            if isinstance(given, tuple):
                x, y = (scale * 2)[:2]
                tangent = ((2.0 * given[0] - 1.0) * x, (2.0 * given[1] - 1.0) * y, 2.0 * given[2] - 1.0)
                return PrimvarInput(NO_PRIMVAR, tangent) if tangent[2] > 0 else None
            found = self._scaled(given) if isinstance(given, NodeOutput) else None
            if found is not None and len(found.scale) == 3:
                x, y = (scale * 2)[:2]
                by = (2.0 * x, 2.0 * y, 2.0)
                scales = tuple(a * b for a, b in zip(found.scale, by, strict=True))
                biases = tuple(a * b - c for a, b, c in zip(found.bias, by, (x, y, 1.0), strict=True))
                coded = tuple(d * a - c for d, a, c in zip(found.default, by, (x, y, 1.0), strict=True))
                made = self._texture(_Scaled(found.image, found.channels, scales, biases, coded), 3)
                if made is not None:
                    return made
        return PatternInput(value, (0.0, 0.0, 1.0))

    def stand_in(self, value: NodeOutput, width: int) -> Numbers:
        """Return a constant in place of a varying value: an image's default, else mid-grey (0.5)."""
        found = self._scaled(value)
        if found is None:
            return (0.5,) * width
        return found.default if len(found.default) == width else (found.default * width)[:width]

    def _plain(self, node: PatternNode, width: int) -> TextureInput | None:
        """Return a UsdUVTexture as a texture input: a shortcut for the most common node."""
        inputs: dict[str, Any] = dict(node.inputs)
        channels, st = inputs["channels"], self._coordinates(inputs["st"])
        if st is None or len(channels) != width:
            return None
        return TextureInput(
            file=inputs["file"],
            channels=channels,
            st=st[0],
            st_transform=st[1],
            wrap_s=Wrap(inputs["wrapS"]),
            wrap_t=Wrap(inputs["wrapT"]),
            fallback=inputs["fallback"],
            scale=inputs["scale"],
            bias=inputs["bias"],
        )

    def _texture(self, found: _Scaled, width: int) -> TextureInput | None:
        """Return scaled texels as a texture input, None where that is not possible."""
        node = self._nodes[found.image]
        inputs = dict(node.inputs)
        file = inputs["file"]
        same = len(set(found.channels)) == 1
        channels = "rgb" if found.channels == "rgb" else found.channels[0] if same else ""
        if not isinstance(file, TextureFile) or not channels or len(found.channels) != width:
            return None
        if channels != "rgb" and (len(set(found.scale)) > 1 or len(set(found.bias)) > 1):
            return None
        wraps = self._wraps(node, inputs)
        st = self._coordinates(inputs["st" if node.category == UV_TEXTURE else "texcoord"])
        if wraps is None or st is None or inputs.get("filtertype") == "closest":
            return None
        scale, bias, fallback = ([*self._four(inputs, name)] for name in ("scale", "bias", "fallback"))
        for place, s, b, d in zip(found.channels, found.scale, found.bias, found.default, strict=True):
            index = "rgba".index(place)
            scale[index], bias[index], fallback[index] = s, b, d
        return TextureInput(
            file=file, channels=channels, st=st[0], st_transform=st[1], wrap_s=wraps[0], wrap_t=wraps[1],
            fallback=tuple(fallback), scale=tuple(scale), bias=tuple(bias),  # type: ignore[arg-type]
        )  # fmt: skip

    def _four(self, inputs: dict[str, Operand], name: str) -> Numbers:
        """Return four numbers of a UsdUVTexture input; its defaults where they are not constant, as of unread channels."""
        value = inputs.get(name)
        return value if isinstance(value, tuple) and len(value) == 4 else _PLAIN[name]

    def _wraps(self, node: PatternNode, inputs: dict[str, Operand]) -> tuple[Wrap, Wrap] | None:
        if node.category == UV_TEXTURE:
            return Wrap(inputs["wrapS"]), Wrap(inputs["wrapT"])
        default = inputs["default"]
        if not isinstance(default, tuple):
            return None
        u, v = (self._wrap(inputs.get(name), default) for name in ("uaddressmode", "vaddressmode"))
        return (u, v) if u is not None and v is not None else None

    def _wrap(self, mode: Operand | None, default: Numbers) -> Wrap | None:
        """Return the wrap mode of an address mode, None where the colour outside of the image would not be black."""
        if mode == "constant":
            return None if any(default) else Wrap.BLACK
        return _WRAPS.get(mode) if isinstance(mode, str) else None

    def _scaled(self, value: NodeOutput) -> _Scaled | None:
        """Return a value as scaled texels of an image, None where it is anything else."""
        node = self._nodes[value.node]
        inputs = dict(node.inputs)
        if node.category == "image":
            return self._image(value.node, node, inputs)
        if node.category == UV_TEXTURE:
            channels = str(inputs["channels"])
            scale, bias, fallback = (channels_of(self._four(inputs, n), channels) for n in ("scale", "bias", "fallback"))
            return _Scaled(value.node, channels, scale, bias, fallback)
        if node.category in ("extract", "convert"):
            return self._channels(node, inputs)
        if node.category == "combine3":
            return self._combined(inputs)
        rule = _SCALES.get(node.category)
        varying = [name for name, operand in inputs.items() if isinstance(operand, NodeOutput)]
        if rule is None or len(varying) != 1 or not all(isinstance(v, tuple) for k, v in inputs.items() if k != varying[0]):
            return None
        source = inputs[varying[0]]
        found = self._scaled(source) if isinstance(source, NodeOutput) else None
        return rule(found, varying[0], inputs) if found else None

    def _image(self, number: int, node: PatternNode, inputs: dict[str, Operand]) -> _Scaled | None:
        width, default = _WIDTHS.get(node.type), inputs.get("default", (0.0,))
        if not width or not isinstance(default, tuple):
            return None
        return _Scaled(number, "rgba"[:width], (1.0,) * width, (0.0,) * width, default)

    def _channels(self, node: PatternNode, inputs: dict[str, Operand]) -> _Scaled | None:
        source = inputs["in"]
        found = self._scaled(source) if isinstance(source, NodeOutput) else None
        if found is None:
            return None
        if node.category == "extract":
            index = inputs["index"]
            at = int(index[0]) if isinstance(index, tuple) else -1
            places = [at] if 0 <= at < len(found.channels) else []
        else:
            width, has = _WIDTHS.get(node.type, 0), len(found.channels)
            places = [0] * width if has == 1 else [0, 1, 2] if width == 3 and has >= 3 else []
        if not places:
            return None
        return _Scaled(
            found.image,
            "".join(found.channels[p] for p in places),
            tuple(found.scale[p] for p in places),
            tuple(found.bias[p] for p in places),
            tuple(found.default[p] for p in places),
        )

    def _combined(self, inputs: dict[str, Operand]) -> _Scaled | None:
        """Return channels of one image that are combined again."""
        parts = [self._scaled(v) if isinstance(v, NodeOutput) else None for v in (inputs[f"in{i}"] for i in (1, 2, 3))]
        first = parts[0]
        if first is None or any(p is None or p.image != first.image or len(p.channels) != 1 for p in parts):
            return None
        found = [p for p in parts if p is not None]
        return _Scaled(
            first.image,
            "".join(p.channels for p in found),
            tuple(p.scale[0] for p in found),
            tuple(p.bias[0] for p in found),
            tuple(p.default[0] for p in found),
        )

    def _coordinates(self, value: Operand) -> tuple[PrimvarInput, Affine] | None:
        """Return the primvar and the affine map that give texture coordinates; constants are a primvar that no shape has."""
        if isinstance(value, tuple):
            return PrimvarInput(NO_PRIMVAR, value), IDENTITY
        if value == "UV0":
            return PrimvarInput(primvar_of_set(0), (0.0, 0.0)), IDENTITY
        if not isinstance(value, NodeOutput):
            return None
        node = self._nodes[value.node]
        inputs = dict(node.inputs)
        if node.category == "texcoord":
            index = inputs.get("index", (0.0,))
            if not isinstance(index, tuple) or node.type != "vector2":
                return None
            return PrimvarInput(primvar_of_set(int(index[0])), (0.0, 0.0)), IDENTITY
        if node.category == "geompropvalue":
            name, default = inputs.get("geomprop"), inputs.get("default")
            if node.type != "vector2" or not isinstance(name, str) or not isinstance(default, tuple):
                return None
            return PrimvarInput(name, default), IDENTITY
        return self._moved(node, inputs)

    def _moved(self, node: PatternNode, inputs: dict[str, Operand]) -> tuple[PrimvarInput, Affine] | None:
        if node.category == TRANSFORM_2D:
            inner = self._coordinates(inputs["in"])
            return (inner[0], affine_product(transform_2d(inputs), inner[1])) if inner else None
        rule = _MOVES.get(node.category)
        name = next((n for n in ("in", "in1") if n in inputs), "")
        if node.category in ("add", "multiply") and isinstance(inputs.get("in1"), tuple):
            name = "in2"
        others = [v for k, v in inputs.items() if k != name]
        if rule is None or node.type != "vector2" or not name or not all(isinstance(v, tuple) for v in others):
            return None
        inner = self._coordinates(inputs[name])
        other = next((v for v in others if isinstance(v, tuple)), (0.0, 0.0))
        moved = rule((other * 2)[:2]) if inner else None
        return (inner[0], affine_product(moved, inner[1])) if inner and moved else None


def transform_2d(inputs: dict[str, Operand]) -> Affine:
    """Return UsdTransform2d's map: scale, then rotation counter-clockwise in degrees, then translation."""
    (sx, sy), (tx, ty), (degrees,) = (_numbers(inputs[name]) for name in ("scale", "translation", "rotation"))
    turns, rest = divmod(degrees, 90.0)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns) % 4):  # right angles are exact
        c, s = -s, c
    return (c * sx, 0.0 - s * sy, tx, s * sx, c * sy, ty)


def _numbers(value: Operand) -> Numbers:
    assert isinstance(value, tuple)
    return value


def affine_product(outer: Affine, inner: Affine) -> Affine:
    """Return outer * inner."""
    a, b, c, d, e, f = outer
    g, h, i, j, k, m = inner
    return (a * g + b * j, a * h + b * k, a * i + b * m + c, d * g + e * j, d * h + e * k, d * i + e * m + f)


def _turned(amount: Numbers) -> Affine:
    """Return MaterialX's rotate2d, which rotates coordinates clockwise."""
    c, s = math.cos(math.radians(amount[0])), math.sin(math.radians(amount[0]))
    return (c, s, 0.0, -s, c, 0.0)


_MOVES: dict[str, Callable[[Numbers], Affine | None]] = {
    "add": lambda by: (1.0, 0.0, by[0], 0.0, 1.0, by[1]),
    "subtract": lambda by: (1.0, 0.0, -by[0], 0.0, 1.0, -by[1]),
    "multiply": lambda by: (by[0], 0.0, 0.0, 0.0, by[1], 0.0),
    "divide": lambda by: (1.0 / by[0], 0.0, 0.0, 0.0, 1.0 / by[1], 0.0) if by[0] and by[1] else None,
    "rotate2d": _turned,
}


def _constant(inputs: dict[str, Operand], name: str, width: int) -> Numbers:
    value = inputs[name]
    assert isinstance(value, tuple)
    return value * width if len(value) == 1 else value


def _linear(found: _Scaled, scale: Numbers, bias: Numbers) -> _Scaled | None:
    if len(scale) != len(found.scale) or len(bias) != len(found.bias):
        return None
    return _Scaled(
        found.image,
        found.channels,
        tuple(a * b for a, b in zip(found.scale, scale, strict=True)),
        tuple(a * b + c for a, b, c in zip(found.bias, scale, bias, strict=True)),
        tuple(a * b + c for a, b, c in zip(found.default, scale, bias, strict=True)),
    )


_Rule = Callable[[_Scaled, str, dict[str, Operand]], "_Scaled | None"]


def _times(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    return _linear(found, _constant(inputs, "in2" if varying == "in1" else "in1", n), (0.0,) * n)


def _over(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    by = _constant(inputs, "in2", n) if varying == "in1" else ()
    return _linear(found, tuple(1.0 / x for x in by), (0.0,) * n) if by and all(by) else None


def _plus(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    return _linear(found, (1.0,) * n, _constant(inputs, "in2" if varying == "in1" else "in1", n))


def _less(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    if varying == "in1":
        return _linear(found, (1.0,) * n, tuple(-x for x in _constant(inputs, "in2", n)))
    return _linear(found, (-1.0,) * n, _constant(inputs, "in1", n))


def _inverted(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    return _linear(found, (-1.0,) * n, _constant(inputs, "amount", n)) if varying == "in" else None


def _mixed(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    n = len(found.scale)
    fg, bg, mix = (_constant(inputs, name, n) if name != varying else () for name in ("fg", "bg", "mix"))
    if varying == "mix":
        n = len(fg)
        return _linear(found, tuple(f - b for f, b in zip(fg, bg, strict=True)), bg) if n == len(found.scale) else None
    kept = mix if varying == "fg" else tuple(1.0 - m for m in mix)
    return _linear(found, kept, tuple((1.0 - k) * o for k, o in zip(kept, bg if varying == "fg" else fg, strict=True)))


def _remapped(found: _Scaled, varying: str, inputs: dict[str, Operand]) -> _Scaled | None:
    if varying != "in":
        return None
    n = len(found.scale)
    low, high, to, end = (_constant(inputs, name, n) for name in ("inlow", "inhigh", "outlow", "outhigh"))
    if any(h == x for h, x in zip(high, low, strict=True)):
        return None
    by = tuple((e - t) / (h - x) for e, t, h, x in zip(end, to, high, low, strict=True))
    return _linear(found, by, tuple(t - x * b for t, x, b in zip(to, low, by, strict=True)))


_SCALES: dict[str, _Rule] = {
    "multiply": _times,
    "divide": _over,
    "add": _plus,
    "subtract": _less,
    "invert": _inverted,
    "mix": _mixed,
    "remap": _remapped,
}


def pruned(nodes: Sequence[PatternNode], inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
    """Return the pattern without unused nodes, None where no input reads one, and the inputs with the new node numbers."""
    waiting = [found.source.node for found in inputs.values() if isinstance(found, PatternInput)]
    if not waiting:
        return None, dict(inputs)
    read: set[int] = set()
    while waiting:
        index = waiting.pop()
        if index not in read:
            read.add(index)
            waiting += [operand.node for _, operand in nodes[index].inputs if isinstance(operand, NodeOutput)]
    order = sorted(read)
    number = {index: place for place, index in enumerate(order)}
    same = next((place for place, index in enumerate(order) if place != index), len(order))  # first node with a new number

    kept = [_moved(nodes[index], number) for index in order[same:]]
    made = {
        name: replace(found, source=NodeOutput(number[found.source.node], found.source.output))
        if isinstance(found, PatternInput)
        else found
        for name, found in inputs.items()
    }
    return Pattern((*nodes[:same], *kept)), made


def appended(pattern: Pattern | None, more: Pattern, reads: PatternInput) -> tuple[Pattern, PatternInput]:
    """Return two patterns as one, and the input that reads the second with its new node number."""
    if pattern is None:
        return more, reads
    first = len(pattern.nodes)
    number = {place: first + place for place in range(len(more.nodes))}
    nodes = (*pattern.nodes, *(_moved(node, number) for node in more.nodes))
    return Pattern(nodes), replace(reads, source=replace(reads.source, node=number[reads.source.node]))


def _moved(node: PatternNode, number: Mapping[int, int]) -> PatternNode:
    """Return a node with the numbers of the nodes that it reads replaced; the same object where it reads none."""
    for _, operand in node.inputs:
        if type(operand) is NodeOutput:
            break
    else:
        return node
    inputs = [
        (pair[0], NodeOutput(number[pair[1].node], pair[1].output)) if type(pair[1]) is NodeOutput else pair
        for pair in node.inputs
    ]
    return PatternNode(node.category, node.type, node.signature, tuple(inputs), node.path)
