"""A light's group, by which light path expressions name lights (<L.'key'>); read from attributes of other renderers."""

from __future__ import annotations

from ...resolving.context import Context
from ...resolving.read import read
from ...resolving.renderer_attributes import LIGHT_GROUPS
from ...resolving.resolve import ResolvedPrim

ARNOLD, ARNOLDS_NONE = "primvars:arnold:aov", "default"


def group_of(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the group's name; "" if the light is in none. Groups in render settings come before attributes of the light."""
    named = ctx.light_groups.name_of(prim.prim)
    if named:
        return named
    for name in LIGHT_GROUPS:
        if name not in prim.names:
            continue
        value = read(prim.prim, name, ctx.when)
        if isinstance(value, str) and value.strip() and not (name == ARNOLD and value == ARNOLDS_NONE):
            return value.strip().replace("'", "")
    return ""
