"""The cameras of a stage: first those outside of instances, then those inside native instances."""

from __future__ import annotations

from itertools import islice

from pxr import Usd

from ..stage.reads import type_name
from ..stage.traversal import prims_in_instances, world_prims

MOST_IN_INSTANCES = 1000  # a crowd of assets may each have left one behind


def cameras_of(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return all cameras, in the order in which the default camera is chosen."""
    return [prim for prim in world_prims(stage) if type_name(prim) == "Camera"] + cameras_in_instances(stage)


def cameras_in_instances(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return the instance proxies of cameras in native instances (each has its instance's transform), the first thousand."""
    return list(islice(prims_in_instances(stage, "Camera"), MOST_IN_INSTANCES))
