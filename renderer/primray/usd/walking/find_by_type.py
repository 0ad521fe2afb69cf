"""The prims that are looked for by their type, wherever they stand outside prototypes: one pass over the stage."""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Usd

from ...diagnostics import Diagnostics
from ..adapters.rendering.render_pass import note_render_pass


@dataclass
class Found:
    """Prims of some types, wherever they are outside prototypes."""

    cameras: list[Usd.Prim] = field(default_factory=list)
    settings: list[Usd.Prim] = field(default_factory=list)
    shaders: list[Usd.Prim] = field(default_factory=list)
    has_skeletons: bool = False


def find_by_type(stage: Usd.Stage, diagnostics: Diagnostics) -> Found:
    found = Found()
    for prim in stage.Traverse():
        name = prim.GetTypeName()
        if name == "Camera":
            found.cameras.append(prim)
        elif name == "RenderSettings":
            found.settings.append(prim)
        elif name == "Shader":
            found.shaders.append(prim)
        elif name == "SkelRoot":
            found.has_skeletons = True
        elif name == "RenderPass":
            note_render_pass(prim, diagnostics)
    return found
