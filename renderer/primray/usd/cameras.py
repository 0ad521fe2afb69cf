"""The cameras that a stage offers, for people to choose from. Which one is rendered is decided in `view`."""

from __future__ import annotations

from pxr import Usd, UsdGeom


def camera_paths(stage: Usd.Stage) -> list[str]:
    """Paths of all active, defined cameras, in the stage's order."""
    return [str(prim.GetPath()) for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
