"""Diagnostics for light inputs that are not supported: light filters and shader ids of other renderers."""

from __future__ import annotations

from ...querying.guarded import targets
from ...resolving.context import Context
from ...resolving.read import read
from ...resolving.resolve import ResolvedPrim


def note_ignored_inputs(prim: ResolvedPrim, ctx: Context) -> None:
    """Report light filters, and a light:shaderId other than the schema's own."""
    if "light:filters" in prim.names and targets(prim.prim, "light:filters"):
        ctx.warn("light-input", prim.path, "Light filters are ignored.", "light:filters")
    _note_shader(prim, ctx)


def _note_shader(prim: ResolvedPrim, ctx: Context) -> None:
    """Report a light:shaderId that is not the schema's own: no other shaders are implemented."""
    if "light:shaderId" not in prim.names:
        return
    shader = read(prim.prim, "light:shaderId", ctx.when)
    own = {prim.type_name, prim.type_name.removesuffix("_1"), "MeshLight", ""}
    if shader not in own:
        message = f"light:shaderId = {shader!r} is ignored: the light is rendered as a {prim.type_name}."
        ctx.warn("light-input", prim.path, message, "light:shaderId")
