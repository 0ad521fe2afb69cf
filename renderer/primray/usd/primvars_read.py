"""Which primvars the stage's materials read: asked before the walk, so that it hands down only these.

What no material reads must not be handed down: instances that differ in it would not share their prototype.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import chain

from pxr import Usd, UsdShade

from ..diagnostics import Diagnostics
from .context import Context
from .network import Node
from .network_nodes import is_reader, primvar_name


def primvars_read(shaders: Iterable[Usd.Prim], ctx: Context) -> frozenset[str]:
    """Property names of what primvar readers name, among these shaders and those in prototypes."""
    silent = replace(ctx, diagnostics=Diagnostics())  # most will be read again, for the shapes that they are bound to
    names = set()
    for prim in chain(shaders, *(Usd.PrimRange(prototype) for prototype in ctx.stage.GetPrototypes())):
        if prim.GetTypeName() == "Shader" and is_reader(str(UsdShade.Shader(prim).GetShaderId() or "")):
            names.add(primvar_name(Node(prim, ""), silent))
    return frozenset(f"primvars:{name}" for name in names if name)
