"""Which primvars the stage's materials read, and which of these as colours: asked before the walk, so that it hands down only
these, in the rendering space where they are colours.

What no material reads must not be handed down: instances that differ in it would not share their prototype.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pxr import Usd

from ...diagnostics import Diagnostics
from ..querying.guarded import shader_id
from ..resolving.context import Context
from .network import Node, ShaderIds, find_source
from .network_nodes import NODES, is_reader, primvar_name

SURFACE_SHADERS = frozenset({"UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"})
COLOR_INPUTS = ("diffuseColor", "emissiveColor", "specularColor")
_COLORS = ("_color3", "_color4")  # MaterialX's readers of colours
SHOWN_COLOR = "primvars:displayColor"  # of shapes without a material


def primvars_read(shaders: Iterable[Usd.Prim], ctx: Context) -> tuple[frozenset[str], frozenset[str]]:
    """Property names of what primvar readers name, among these shaders; and of those that are colours, displayColor always
    being one."""
    silent = replace(ctx, diagnostics=Diagnostics())  # most will be read again, for the shapes that they are bound to
    prims = list(shaders)
    ids = [shader_id(prim) for prim in prims]
    ctx.kept.of(ShaderIds).update(zip([prim.GetPath() for prim in prims], ids, strict=True))
    readers = [(prim, name) for prim, name in zip(prims, ids, strict=True) if is_reader(name)]
    names = frozenset(f"primvars:{name}" for prim, _ in readers if (name := primvar_name(Node(prim, ""), silent)))
    if any(name.startswith("ND_geomcolor") for name in ids):
        names |= {SHOWN_COLOR}
    colors = {SHOWN_COLOR} | {
        f"primvars:{name}"
        for prim, kind in readers
        if kind.endswith(_COLORS) and (name := primvar_name(Node(prim, ""), silent))
    }
    if any(NODES[name].width >= 3 for _, name in readers):  # others read no colours: nothing is asked of surfaces
        surfaces = [prim for prim, name in zip(prims, ids, strict=True) if name in SURFACE_SHADERS]
        colors |= _fed(surfaces, COLOR_INPUTS, silent)
        for name in sorted((colors - {SHOWN_COLOR}) & _fed(surfaces, ("normal",), silent)):
            ctx.warn("color-space", "", f"{name} is read as a colour and as a normal: it is taken as a colour.")
    return names, frozenset(colors)


def _fed(surfaces: list[Usd.Prim], inputs: Iterable[str], ctx: Context) -> set[str]:
    """The primvars that feed these inputs."""
    attributes = [a for surface in surfaces for name in inputs if (a := surface.GetAttribute(f"inputs:{name}"))]
    sources = [find_source(attribute, ctx) for attribute in attributes if attribute.HasAuthoredConnections()]
    nodes = [source for source in sources if isinstance(source, Node) and is_reader(source.id)]
    return {f"primvars:{name}" for node in nodes if (name := primvar_name(node, ctx))}
