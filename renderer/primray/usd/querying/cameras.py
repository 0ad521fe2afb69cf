"""The cameras that a stage offers: those that stand in the world by themselves, then those inside native instances."""

from __future__ import annotations

from itertools import islice

from pxr import Usd

from .guarded import type_name
from .traversal import in_instances, in_world

MOST_IN_INSTANCES = 1000  # a crowd of assets may each have left one behind


def cameras_of(stage: Usd.Stage) -> list[Usd.Prim]:
    """In the order in which the first one is chosen."""
    return [prim for prim in in_world(stage) if type_name(prim) == "Camera"] + cameras_in_instances(stage)


def cameras_in_instances(stage: Usd.Stage) -> list[Usd.Prim]:
    """By their proxies: each has its own instance's transform. The first thousand of them."""
    return list(islice(in_instances(stage, "Camera"), MOST_IN_INSTANCES))
