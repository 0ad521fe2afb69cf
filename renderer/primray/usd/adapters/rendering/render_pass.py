"""UsdRenderPass: told, not followed. What it says is for the software that submits renders, or asks for a changed scene."""

from __future__ import annotations

from pxr import Usd

from ....diagnostics import Diagnostics
from ...querying.guarded import property_names

ABOUT_JOBS = ("passType", "command", "renderSource", "inputPasses", "fileName")
COLLECTIONS = ("renderVisibility", "cameraVisibility", "prune", "matte")


def note_render_pass(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    """The pass itself, and whatever it authors, since each could have changed the picture."""
    path, authored = str(prim.GetPath()), property_names(prim)
    diagnostics.add("render-settings-input", path, "Render passes are ignored.")
    for name in ABOUT_JOBS:
        if name in authored:
            diagnostics.add("render-settings-input", path, f"{name} of a render pass is ignored.", name)
    for collection in COLLECTIONS:
        for name in authored:
            if name.startswith(f"collection:{collection}:"):
                message = f"The scene is rendered whole, whatever a render pass says of {collection}."
                diagnostics.add("render-settings-input", path, message, name)
