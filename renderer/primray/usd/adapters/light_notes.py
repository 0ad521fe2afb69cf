"""What a light asks for and does not get, as diagnostics: filters, rectangle textures."""

from __future__ import annotations

from ..context import Context
from ..read import read
from ..resolve import ResolvedPrim


def note_ignored_inputs(prim: ResolvedPrim, ctx: Context) -> None:
    if prim.type_name == "RectLight" and read(prim.prim, "inputs:texture:file", ctx.when):
        ctx.warn("light-input", prim.path, "The texture of a RectLight is ignored.", "inputs:texture:file")
    if "light:filters" in prim.names and prim.prim.GetRelationship("light:filters").GetTargets():
        ctx.warn("light-input", prim.path, "Light filters are ignored.", "light:filters")
