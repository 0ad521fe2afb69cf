"""Light groups, by which light path expressions name lights (<L.'key'>).

They are collections lightGroup:NAME of the stage's render settings; light_settings reads other renderers' attributes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd

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
