"""The seam's patterns: a graph of MaterialX's primitive nodes, whose outputs drive a surface's inputs."""

from __future__ import annotations

from dataclasses import dataclass

from .texture_file import TextureFile

UV_TEXTURE, TRANSFORM_2D = "UsdUVTexture", "UsdTransform2d"  # categories of nodes that are USD's own

Value = tuple[float, ...]  # one number for float, integer and boolean; as many as vectors and colours have; matrices by rows


@dataclass(frozen=True)
class NodeOutput:
    node: int  # its place in Pattern.nodes, before the one that reads it
    output: str = "out"  # as the node's definition calls it


Operand = Value | NodeOutput | TextureFile | str  # a str: an enumerated choice, a space, the name of a primvar


@dataclass(frozen=True)
class PatternNode:
    """A primitive node of MaterialX's standard library, none that a node graph implements, or one of USD's own: UsdUVTexture's
    `channels` of its texels times scale plus bias (of a file that cannot be read: of its fallback), UsdTransform2d.

    `inputs` has all inputs that its definition has, defaults filled in. Constant colours are in the rendering space.
    """

    category: str  # "multiply", "noise2d", "image" ...
    type: str  # of its first output: "float", "color3", "vector2" ...
    signature: str  # its definition, which tells nodes of mixed types apart: "ND_multiply_vector3FA"
    inputs: tuple[tuple[str, Operand], ...]
    path: str = ""  # of the prim or element that it comes from, for diagnostics


@dataclass(frozen=True)
class Pattern:
    """Nodes in an order in which each reads only those before it. None is constant: what can be known has been computed."""

    nodes: tuple[PatternNode, ...]


@dataclass(frozen=True)
class PatternInput:
    """An input of a surface, given by an output of the surface's own pattern; `fallback` where a single number or colour must
    stand for it."""

    source: NodeOutput
    fallback: tuple[float, ...]
