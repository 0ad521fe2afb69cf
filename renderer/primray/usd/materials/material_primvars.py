"""Primvars that the stage's materials read, and those that they read as colours; found before the stage is traversed.

The traversal passes only these on to descendants, colours in the rendering space. Others must not be passed on: instances that
differ in a primvar would not share their prototype.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pxr import Usd

from ...description.shading import primvar_of_set
from ...diagnostics import Diagnostics
from ..scene.context import Context
from ..stage.reads import shader_id
from .authored import INPUT
from .network import Network, Node
from .usd_nodes import USD_NODES

SURFACE_SHADERS = frozenset({"UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"})
COLOR_INPUTS = ("diffuseColor", "emissiveColor", "specularColor")
_WIDTHS = {"float": 1, "integer": 1, "vector2": 2, "vector3": 3, "vector4": 4, "color3": 3, "color4": 4}
# Nodes that read a primvar, the input that names it, and the number of components of their output (0: not numeric).
_READERS = {name: ("varname", found.width) for name, found in USD_NODES.items() if found.category == "UsdPrimvarReader"}
_READERS |= {f"ND_geompropvalue_{name}": ("geomprop", width) for name, width in _WIDTHS.items()}
# Other renderers' primvar readers (materials/foreign); PxrPrimvar's `type` says whether it reads a colour.
_ARNOLD, _USER_DATA = "arnold:", {"float": 1, "int": 1, "rgb": 3, "rgba": 4}
_READERS |= {f"{_ARNOLD}user_data_{kind}": ("attribute", width) for kind, width in _USER_DATA.items()} | {
    "PxrPrimvar": ("varname", 1)
}
_BY_SET = ("ND_texcoord_", "ND_tangent_", "ND_bitangent_")  # nodes that read a numbered set of texture coordinates
_COLORS = ("_color3", "_color4", "user_data_rgb", "user_data_rgba")  # suffixes of nodes that read colours
SHOWN_COLOR = "primvars:displayColor"  # the colour of shapes without a material


def primvars_read(shaders: Iterable[Usd.Prim], ctx: Context) -> tuple[frozenset[str], frozenset[str]]:
    """Return property names of primvars that these shaders read, and of those read as colours (always with displayColor)."""
    network = Network(replace(ctx, diagnostics=Diagnostics()))  # problems are reported when the materials are translated
    prims = list(shaders)
    ids = [shader_id(prim) for prim in prims]
    ctx.caches.shader_ids.update(zip([prim.GetPath() for prim in prims], ids, strict=True))
    kinds = list(zip(prims, ids, strict=True))
    readers = [network.node(prim) for prim, kind in kinds if kind in _READERS]
    names = frozenset(f"primvars:{name}" for node in readers if (name := _primvar(node)))
    names |= {
        f"primvars:{primvar_of_set(int(network.node(prim).numbers('index', (0.0,))[0]))}"
        for prim, kind in kinds
        if kind.startswith(_BY_SET)
    }
    if any(kind.startswith("ND_geomcolor") or (not kind and network.prim(prim).is_principled) for prim, kind in kinds):
        names |= {SHOWN_COLOR}
    colors = {SHOWN_COLOR} | {
        f"primvars:{name}"
        for node in readers
        if (node.id.endswith(_COLORS) or (node.id == "PxrPrimvar" and node.text("type", "") == "color"))
        and (name := _primvar(node))
    }
    if any(_READERS[node.id][1] >= 3 for node in readers):  # without these no colour input of a surface can be a primvar
        surfaces = [network.node(prim) for prim, kind in kinds if kind in SURFACE_SHADERS]
        colors |= _fed(surfaces, COLOR_INPUTS)
        for name in sorted((colors - {SHOWN_COLOR}) & _fed(surfaces, ("normal",))):
            ctx.warn("color-space", "", f"{name} is read as a colour and as a normal: it is taken as a colour.")
    return names, frozenset(colors)


def _primvar(node: Node) -> str:
    """Return the name of the primvar that a reader node reads, "" for none."""
    return node.text(_READERS[node.id][0], "")


def _fed(surfaces: Iterable[Node], inputs: Sequence[str]) -> set[str]:
    """Return the primvars that are connected to these inputs."""
    given = [(surface, surface.shader.attribute(INPUT + name)) for surface in surfaces for name in inputs]
    sources = [surface.network.source(one) for surface, one in given if one is not None and one.connections]
    nodes = [source for source in sources if isinstance(source, Node) and source.id in _READERS]
    return {f"primvars:{name}" for node in nodes if (name := _primvar(node))}
