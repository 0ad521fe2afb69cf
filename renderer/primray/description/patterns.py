"""Patterns of a scene description: graphs of MaterialX's primitive nodes, whose outputs drive a surface's inputs."""

from __future__ import annotations

from dataclasses import dataclass

from .texture_file import TextureFile

UV_TEXTURE, TRANSFORM_2D = "UsdUVTexture", "UsdTransform2d"  # USD's own node categories

Value = tuple[
    float, ...
]  # one number for float, integer and boolean; one per component of vectors and colours; matrices by rows


@dataclass(frozen=True)
class NodeOutput:
    node: int  # index in Pattern.nodes, less than that of its reader
    output: str = "out"  # name in the node's definition


Operand = Value | NodeOutput | TextureFile | str  # a str is an enumerated choice, a space or the name of a primvar


@dataclass(frozen=True)
class PatternNode:
    """Primitive node of MaterialX's standard library (not implemented by a node graph), or one of USD's own: UsdTransform2d, or
    UsdUVTexture (`channels` of texels times scale plus bias; of its fallback if the file cannot be read).

    `inputs` has all inputs of its definition, with defaults filled in. Constant colours are in the rendering space.
    """

    category: str  # "multiply", "noise2d", "image" ...
    type: str  # of its first output: "float", "color3", "vector2" ...
    signature: str  # name of its definition, for nodes with mixed types: "ND_multiply_vector3FA"
    inputs: tuple[tuple[str, Operand], ...]
    path: str = ""  # of the prim or element that it comes from, for diagnostics


@dataclass(frozen=True)
class Pattern:
    """Nodes in topological order: each reads only earlier ones. Constant nodes have been folded."""

    nodes: tuple[PatternNode, ...]


@dataclass(frozen=True)
class PatternInput:
    """Surface input driven by an output of the surface's own pattern; `fallback` is used where a single number or colour is
    needed."""

    source: NodeOutput
    fallback: tuple[float, ...]
