"""Light groups that the stage's render settings say: of collections lightGroup:NAME, what lights are in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd

PREFIX = "lightGroup:"


@dataclass(frozen=True)
class LightGroups:
    """In the order of their names; a light is in the first that has it."""

    queries: tuple[tuple[str, Any], ...] = ()  # a group's name, its collection's UsdCollectionMembershipQuery

    def name_of(self, prim: Usd.Prim) -> str:
        """ "" where it is in none. What is in an instance is asked for by the instance's own path."""
        if not self.queries:
            return ""
        path = prim.GetPath()
        return next((name for name, query in self.queries if query.IsPathIncluded(path)), "")


NO_GROUPS = LightGroups()


def light_groups(stage: Usd.Stage, settings_path: str) -> LightGroups:
    settings = stage.GetPrimAtPath(settings_path) if Sdf.Path.IsValidPathString(settings_path) else None
    if not settings:
        return NO_GROUPS
    found = []
    for collection in Usd.CollectionAPI.GetAll(settings):
        name = collection.GetName()
        if name.startswith(PREFIX) and len(name) > len(PREFIX):
            found.append((name.removeprefix(PREFIX), collection.ComputeMembershipQuery()))
    return LightGroups(tuple(sorted(found, key=lambda row: row[0])))
