"""Light groups, by which light path expressions name lights (<L.'key'>).

They are collections lightGroup:NAME of the stage's render settings, or attributes of the lights for other renderers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd

from ..scene.schemas import LIGHT_GROUPS
from ..stage.values import read

if TYPE_CHECKING:
    from ..scene.context import Context
    from ..scene.inheritance import ResolvedPrim

PREFIX = "lightGroup:"


@dataclass(frozen=True)
class LightGroups:
    """Light groups in the order of their names; a light is in the first that contains it."""

    queries: tuple[tuple[str, Any], ...] = ()  # a group's name, its collection's UsdCollectionMembershipQuery

    def name_of(self, prim: Usd.Prim) -> str:
        """Return the group of a light, "" if none; a light in an instance is looked up by its path in the prototype."""
        if not self.queries:
            return ""
        path = prim.GetPath()
        return next((name for name, query in self.queries if query.IsPathIncluded(path)), "")


NO_GROUPS = LightGroups()


def light_groups(stage: Usd.Stage, settings_path: str) -> LightGroups:
    """Return the light groups of these render settings."""
    settings = stage.GetPrimAtPath(settings_path) if Sdf.Path.IsValidPathString(settings_path) else None
    if not settings:
        return NO_GROUPS
    found = []
    for collection in Usd.CollectionAPI.GetAll(settings):
        name = collection.GetName()
        if name.startswith(PREFIX) and len(name) > len(PREFIX):
            found.append((name.removeprefix(PREFIX), collection.ComputeMembershipQuery()))
    return LightGroups(tuple(sorted(found, key=lambda row: row[0])))


ARNOLD, ARNOLD_DEFAULT = "primvars:arnold:aov", "default"


def read_group(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the group's name; "" if the light is in none. Groups in render settings come before attributes of the light."""
    named = ctx.light_groups.name_of(prim.prim)
    if named:
        return named
    for name in LIGHT_GROUPS:
        if name not in prim.names:
            continue
        value = read(prim.prim, name, ctx.when)
        if isinstance(value, str) and value.strip() and not (name == ARNOLD and value == ARNOLD_DEFAULT):
            return value.strip().replace("'", "")
    return ""
